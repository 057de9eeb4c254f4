"""How far standing feet slide."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from dynresp.motion import rotations
from dynresp.motion.character import ROOT_QUAT, Character, default_character
from dynresp.motion.feet.skating import TOUCH, foot_slides, stance_slides
from dynresp.motion.feet.skating_kernel import least_slide, slides_kernel
from dynresp.motion.ground import sole_points
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from tests.motion.samples import smooth_motion
from tests.oracles import foot_fitting, kinematics
from tests.physics.samples import turned

_least_slide = njit(lambda ways, touching: least_slide(ways, touching))

FPS = 30.0
seeds = st.integers(0, 2**32 - 1)


class TestFootSkates:
    """How far standing feet slide over the ground."""

    def _sliding(self, character: Character, path: FloatArray, contacts: FloatArray) -> Motion:
        poses = turned(character, {}, len(path))
        poses[:, :2] += path
        return Motion(poses, FPS, contacts=contacts.astype(bool))

    def test_still_feet_do_not_slide(self, character: Character) -> None:
        motion = self._sliding(character, np.zeros((20, 2)), np.ones((20, 2)))
        assert stance_slides(motion, character) == pytest.approx([0.0, 0.0])

    def test_a_straight_slide_is_its_length(self, character: Character) -> None:
        path = np.outer(np.linspace(0.0, 0.5, 11), [0.6, 0.8])
        contacts = np.ones((11, 2))
        assert stance_slides(self._sliding(character, path, contacts), character) == pytest.approx(
            [0.5, 0.5]
        )

    def test_there_and_back_is_both_ways(self, character: Character) -> None:
        path = np.zeros((21, 2))
        path[:, 0] = np.abs(np.arange(21) - 10) * 0.01
        slides = stance_slides(self._sliding(character, path, np.ones((21, 2))), character)
        assert slides == pytest.approx([0.2, 0.2])

    def test_only_steps_between_standing_frames_count(self, character: Character) -> None:
        path = np.outer(np.arange(20), [0.01, 0.0])
        contacts = np.zeros((20, 2))
        contacts[2:6, 0] = contacts[10:18, 0] = 1
        contacts[5, 1] = 1  # one frame alone has no step
        slides = stance_slides(self._sliding(character, path, contacts), character)
        assert slides == pytest.approx([0.03, 0.07])

    def test_a_stance_that_lasts_to_the_end_counts(self, character: Character) -> None:
        path = np.outer(np.arange(10), [0.0, 0.02])
        contacts = np.zeros((10, 2))
        contacts[4:, 1] = 1
        slides = stance_slides(self._sliding(character, path, contacts), character)
        assert slides == pytest.approx([0.1])

    def test_rolling_over_the_heel_is_no_slide(self, character: Character) -> None:
        """A foot that turns about its lowest corner stays there."""
        angles = np.linspace(-0.3, -0.1, 8)
        poses = turned(character, {}, 8)
        poses[:, ROOT_QUAT] = rotations.about_axis((0, 1, 0), angles)
        poses[:, 2] = 1.0
        motion = Motion(poses, FPS, contacts=np.ones((8, 2), dtype=bool))
        rows = []
        for pose in motion.poses:
            origins, matrices, _ = kinematics.body_frames(character, pose)
            foot = character.body("left_foot")
            geom = character.model.geom("left_sole")
            heel = geom.pos + geom.size * np.array([-1.0, -1.0, -1.0])
            rows.append(origins[foot] + matrices[foot] @ heel)
        pinned = motion.poses.copy()
        pinned[:, :3] -= np.array(rows) - rows[0]
        slides = stance_slides(
            Motion(pinned, FPS, contacts=np.array([[True, False]] * 8)), character
        )
        assert slides == pytest.approx([0.0], abs=1e-9)

    @pytest.mark.parametrize("pivot", [(0.0, 0.0), (0.1, 0.03), (-0.05, -0.04)])
    def test_pivoting_on_the_sole_is_no_slide(
        self, character: Character, pivot: tuple[float, float]
    ) -> None:
        poses = self._turning(character, "left", pivot)
        contacts = np.array([[True, False]] * len(poses))
        assert stance_slides(Motion(poses, FPS, contacts=contacts), character) == pytest.approx(
            [0.0], abs=1e-9
        )

    def test_turning_about_a_point_beside_the_sole_is_one(self, character: Character) -> None:
        """As far as the nearest point of the sole does."""
        poses = self._turning(character, "left", (0.035, 0.144))
        contacts = np.array([[True, False]] * len(poses))
        way = 0.1 * 2.0 * np.sin(0.05) * (len(poses) - 1)
        skates = stance_slides(Motion(poses, FPS, contacts=contacts), character)
        assert skates == pytest.approx([way], rel=1e-3)

    def _turning(self, character: Character, side: str, about: tuple[float, float]) -> FloatArray:
        """The whole body turns about a point given in a flat foot's frame, 0.1 rad a frame."""
        poses = turned(character, {}, 8)
        ankle = character.kinematics(poses).positions[0, character.body(f"{side}_foot")]
        center = ankle + np.array([*about, 0.0])
        turn = rotations.from_yaw(0.1 * np.arange(len(poses)))
        poses[:, :3] = center + rotations.rotate(turn, poses[:, :3] - center)
        poses[:, ROOT_QUAT] = turn
        return poses


class TestTwins:
    """The compiled slides, and those found by minimising."""

    @given(seed=seeds, corners=st.integers(1, 4))
    def test_the_stillest_way_is_the_shortest_in_the_hull(self, seed: int, corners: int) -> None:
        rng = np.random.default_rng(seed)
        ways = rng.normal(size=(4, 2)) + rng.normal(size=2)
        touching = np.zeros(4, dtype=bool)
        touching[rng.permutation(4)[:corners]] = True
        found = np.array(_least_slide(ways, touching))
        twin = foot_fitting.stillest_way(ways[touching])
        np.testing.assert_allclose(np.linalg.norm(found), np.linalg.norm(twin), atol=1e-6)

    def test_equal_ways_have_that_way(self) -> None:
        ways = np.tile([0.3, -0.4], (4, 1))
        assert _least_slide(ways, np.ones(4, dtype=bool)) == pytest.approx((0.3, -0.4))

    @given(seed=seeds)
    def test_feet_anyhow(self, seed: int) -> None:
        character = default_character()
        states = character.kinematics(smooth_motion(np.random.default_rng(seed), 6).poses)
        slides = foot_slides(character, states)
        for i, side in enumerate(("left", "right")):
            foot = character.body(f"{side}_foot")
            sole = sole_points(character, side)
            steps = [
                (states.positions[k, foot], foot_fitting.as_rotation(states.quaternions[k, foot]))
                for k in range(6)
            ]
            twin = [
                np.linalg.norm(foot_fitting.slide(a, b, sole, TOUCH)) for a, b in pairwise(steps)
            ]
            np.testing.assert_allclose(slides[:, i], twin, atol=1e-6)

    def test_one_frame_has_no_step(self) -> None:
        assert slides_kernel(np.zeros((1, 4, 3)), TOUCH).shape == (0,)
