"""The blend and what follows it: standing feet stay in place."""

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.response.choice import Choice
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.response_quality import measure
from dynresp.response.transition.choice_to_motion import MotionAfterExit, blend_into_choice
from tests.physics.samples import FPS, standing

LENGTH = ResponseConfig().transition.blend_frames(FPS)


def _crouching(character: Character, seconds: float, ahead: float = 0.0) -> Motion:
    """Standing with bent knees, the left foot ahead by so much [m]."""
    poses = standing(character, seconds).poses.copy()
    ankles = legs.ankle_positions(character, character.kinematics(poses))
    ankles[:, 0, 0] += 0.5 * ahead
    ankles[:, 1, 0] -= 0.5 * ahead
    poses[:, 2] -= 0.08
    return Motion(legs.place_ankles(character, poses, ankles), FPS, "crouching")


def _ended(
    character: Character, simulated: FloatArray, entered: Motion, name: str
) -> MotionAfterExit:
    choice = Choice(name, entered, 5, 0, 0.0, {})
    return blend_into_choice(character, ResponseConfig(), simulated, choice)


def _ankles(character: Character, poses: FloatArray) -> FloatArray:
    return legs.ankle_positions(character, character.kinematics(poses))


class TestStandingFeet:
    """A blend between two ways to stand."""

    @pytest.mark.parametrize("ahead", [0.0, 0.1, 0.25])
    def test_they_stay_through_the_blend_and_after(
        self, character: Character, ahead: float
    ) -> None:
        simulated = _crouching(character, 1.0).poses[: LENGTH + 1]
        end = _ended(character, simulated, _crouching(character, 3.0, ahead), "standing")
        gone = _ankles(character, end.poses) - _ankles(character, simulated[:1])
        np.testing.assert_allclose(gone, 0.0, atol=2e-3)

    def test_without_a_reaction_the_end_is_the_base_motion(self, character: Character) -> None:
        """After the blend the base motion goes on alone."""
        simulated = _crouching(character, 1.0).poses[: LENGTH + 1]
        base = _crouching(character, 6.0, 0.1)
        end = _ended(character, simulated, base, CARRY_ON)
        gone = _ankles(character, end.poses) - _ankles(character, simulated[:1])
        np.testing.assert_allclose(gone[: LENGTH + 20], 0.0, atol=2e-3)
        np.testing.assert_allclose(end.poses[-1, 2:], base.poses[-1, 2:], atol=1e-9)

    def test_a_foot_in_the_air_comes_down_smoothly(self, character: Character) -> None:
        """The motion entered has it on the ground at once."""
        simulated = _crouching(character, 1.0).poses[: LENGTH + 1]
        ankles = _ankles(character, simulated)
        ankles[:, 0] += (0.1, 0.0, 0.15)
        raised = legs.place_ankles(character, simulated, ankles)
        end = _ended(character, raised, _crouching(character, 3.0), "standing")
        steps = np.diff(_ankles(character, end.poses)[:, 0], axis=0)
        assert np.linalg.norm(steps, axis=1).max() < 0.06
        assert _ankles(character, end.poses)[-1, 0, 2] == pytest.approx(0.07, abs=0.01)

    def test_steps_after_the_blend_do_not_slide_while_a_correction_fades(
        self, character: Character
    ) -> None:
        """The left foot stands ahead, and is put down beside the other soon after the blend."""
        simulated = _crouching(character, 1.0).poses[: LENGTH + 1]
        entered = _crouching(character, 4.0, 0.25)
        ankles = _ankles(character, entered.poses)
        at = np.clip((np.arange(len(ankles)) - 5 - LENGTH - 6) / 4.0, 0.0, 1.0)
        ankles[:, 0, 0] -= 0.2 * at
        ankles[:, 0, 2] += 0.1 * np.sin(np.pi * at)
        stepping = Motion(legs.place_ankles(character, entered.poses, ankles), FPS, "stepping")
        for name in ("stepping", CARRY_ON):
            end = _ended(character, simulated, stepping, name)
            steps = np.diff(_ankles(character, end.poses)[:, 0, :2], axis=0)
            # While it stands again, until its correction ends (without a reaction).
            after = np.linalg.norm(steps, axis=1)[LENGTH + 17 : LENGTH + 36]
            assert after.max() < 1e-3

    def test_a_lying_character_has_no_standing_feet(self, character: Character) -> None:
        """Legs that lie on the ground are blended as before."""
        poses = standing(character, 3.0).poses.copy()
        poses[:, 3:7] = np.array([1.0, 0.0, -1.0, 0.0]) / np.sqrt(2.0)
        poses[:, 2] = 0.15
        moved = poses.copy()
        moved[:, 7 + 4 * character.joint("left_hip") :][:, :4] = [np.cos(0.2), 0, -np.sin(0.2), 0]
        lying = Motion(moved, FPS, "lying")
        end = _ended(character, poses[: LENGTH + 1], lying, "lying")
        np.testing.assert_allclose(end.poses[LENGTH + 1 :, 7:], lying.poses[LENGTH + 1 :, 7:])


def test_responses_hardly_slide_in_the_blend(
    character: Character, responses: list[Response]
) -> None:
    found = [measure(response, character) for response in responses]
    slid = [quality.foot_skate_blend_m for quality in found if quality is not None]
    assert np.median(slid) < 0.02


def test_a_stance_is_measured_over_both_seams(character: Character) -> None:
    """One stance lasts from the simulation to the end of the motion entered."""
    simulated = _crouching(character, 1.0).poses[: LENGTH + 1]
    end = _ended(character, simulated, _crouching(character, 2.0, 0.15), "standing")
    contacts = np.ones((len(end.poses), len(FEET)), dtype=bool)
    skates = stance_slides(Motion(end.poses, FPS, contacts=contacts), character)
    assert max(skates) < 2e-3
