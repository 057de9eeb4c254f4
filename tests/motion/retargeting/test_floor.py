import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet import legs
from dynresp.motion.ground import clearances
from dynresp.motion.motion import FEET
from dynresp.motion.retargeting.floor import (
    PULL_DOWN,
    RAMP_S,
    SINK,
    find_floor,
    raise_above,
    settle,
)
from tests.motion.samples import bend_knees


def standing(character: Character, frames: int = 60, flexion: float = 0.3) -> np.ndarray:
    """Poses (frames, 59) of somebody who stands still on bent knees, the feet level on z = 0."""
    poses = np.repeat(character.rest_pose[None], frames, axis=0)
    poses = bend_knees(character, poses, np.full((frames, 2), flexion))
    ankles = legs.ankle_positions(character, character.kinematics(poses))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 2, 1))
    poses = legs.place_ankles(character, poses, ankles, level)
    poses[:, 2] -= depth(character, poses, "feet").min()
    return poses


def raised(poses: np.ndarray, height: float) -> np.ndarray:
    """The same poses (frames, 59), higher [m]."""
    higher = poses.copy()
    higher[:, 2] += height
    return higher


def depth(character: Character, poses: np.ndarray, which: str) -> np.ndarray:
    """Heights of the lowest points of the feet, or of all other bodies (frames, ...)."""
    low = clearances(character, character.kinematics(poses))
    feet = [character.body(f"{side}_foot") for side in FEET]
    return low[:, feet] if which == "feet" else np.delete(low, feet, axis=1)


class TestFindFloor:
    @given(st.floats(-3.0, 3.0))
    def test_is_where_feet_stand(self, height: float) -> None:
        character = default_character()
        poses = standing(character, 5)
        poses[:, 2] += height
        assert find_floor(character, poses, 30.0) == pytest.approx(height, abs=1e-9)

    @pytest.mark.parametrize("name", ["walk", "side_fall", "forward_roll", "backward_roll"])
    def test_of_a_motion_on_it(self, character: Character, name: str) -> None:
        motion = load_builtin(name, character)
        found = find_floor(character, raised(motion.poses, 0.5), motion.fps)
        assert found == pytest.approx(0.5, abs=0.01)

    def test_feet_held_up_do_not_count(self, character: Character) -> None:
        """Somebody who sits with the feet in the air for most of the time, then stands."""
        stand = standing(character, 20)
        sit = np.repeat(stand[:1], 200, axis=0)
        sit[:, 2] = 0.1
        for side in FEET:
            column = 7 + 4 * character.joint(f"{side}_hip")
            sit[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), -1.9)
        assert depth(character, sit, "feet").min() > 0.2
        assert find_floor(character, np.concatenate([sit, stand]), 30.0) == pytest.approx(
            0, abs=5e-3
        )

    def test_of_somebody_who_only_lies(self, character: Character) -> None:
        poses = np.repeat(character.rest_pose[None], 40, axis=0)
        poses[:, 3:7] = rotations.about_axis((0.0, 1.0, 0.0), -np.pi / 2.0)  # on the back
        for side in FEET:
            column = 7 + 4 * character.joint(f"{side}_hip")
            poses[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), -0.6)
        lowest = depth(character, poses, "others").min()
        assert find_floor(character, poses, 30.0) == pytest.approx(lowest)


class TestSettle:
    def test_leaves_who_stands_on_it(self, character: Character) -> None:
        poses = standing(character)
        np.testing.assert_allclose(settle(character, poses, 30.0), poses, atol=1e-9)

    @given(st.floats(-0.05, PULL_DOWN))
    def test_sets_standing_feet_on_it(self, height: float) -> None:
        character = default_character()
        poses = standing(character, flexion=1.2)
        poses[:, 2] += height
        settled = settle(character, poses, 30.0)
        np.testing.assert_allclose(depth(character, settled, "feet"), 0.0, atol=1e-9)
        np.testing.assert_array_equal(settled[:, :3], poses[:, :3])

    def test_does_not_straighten_knees_for_it(self, character: Character) -> None:
        poses = standing(character, flexion=0.15)
        poses[:, 2] += 0.02
        np.testing.assert_allclose(settle(character, poses, 30.0), poses, atol=1e-9)

    def test_swinging_legs_are_left_alone(self, character: Character) -> None:
        """A foot that hovered while it stood is let go of as soon as it has left the ground."""
        fps, frames = 120.0, 120
        poses = standing(character, frames, flexion=1.0)
        ankles = legs.ankle_positions(character, character.kinematics(poses)).copy()
        ankles[:, :, 2] += 0.02
        time = np.maximum(np.arange(frames) / fps - 0.4, 0.0)
        ankles[:, 0, 2] += 2.0 * time**2
        poses = legs.place_ankles(character, poses, ankles)
        settled = settle(character, poses, fps)
        shift = (
            legs.ankle_positions(character, character.kinematics(settled))[:, 0]
            - legs.ankle_positions(character, character.kinematics(poses))[:, 0]
        )[:, 2]
        np.testing.assert_allclose(shift[:40], -0.02, atol=1e-6)
        left = int(np.argmax(shift > -0.0199))
        after = left + round(RAMP_S * fps)
        np.testing.assert_allclose(shift[after:], 0.0, atol=1e-6)
        assert np.abs(np.diff(shift)).max() < 0.006

    def test_who_leans_on_the_hands_is_not_lifted(self, character: Character) -> None:
        """Who sits and leans back on flat palms has the character's stiff hands in the floor."""
        poses = np.repeat(character.rest_pose[None], 30, axis=0)
        poses[:, 2] = 0.12
        poses[:, 3:7] = rotations.about_axis((0.0, 1.0, 0.0), -0.4)
        for side in FEET:
            for joint, angle in (("hip", 0.4 - np.pi / 2.0), ("shoulder", 0.4)):
                column = 7 + 4 * character.joint(f"{side}_{joint}")
                poses[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), angle)
        assert depth(character, poses, "others").min() < -0.1
        settled = settle(character, poses, 30.0)
        assert depth(character, settled, "others").min() > -SINK - 1e-3
        np.testing.assert_allclose(settled[:, 2], poses[:, 2], atol=0.01)

    def test_lifts_who_lies_in_it(self, character: Character) -> None:
        poses = np.repeat(character.rest_pose[None], 30, axis=0)
        poses[:, 3:7] = rotations.about_axis((0.0, 1.0, 0.0), -np.pi / 2.0)
        poses[:, 2] = 0.02
        settled = settle(character, poses, 30.0)
        assert depth(character, settled, "others").min() > -SINK - 1.5e-3
        assert depth(character, settled, "feet").min() > -1e-9

    @pytest.mark.parametrize(
        "name", ["walk", "side_fall", "forward_roll", "multiple_steps_forward"]
    )
    def test_twice_is_once(self, character: Character, name: str) -> None:
        motion = load_builtin(name, character)
        once = settle(character, raised(motion.poses, -0.01), motion.fps)
        twice = settle(character, once, motion.fps)
        a, b = (character.kinematics(x).positions for x in (once, twice))
        assert np.quantile(np.linalg.norm(a - b, axis=-1), 0.99) < 0.01


def test_raise_above_only_lifts(character: Character) -> None:
    motion = load_builtin("walk", character)
    poses = motion.poses.copy()
    poses[20:40, 2] -= 0.05
    lifted = raise_above(character, poses, motion.fps)
    assert depth(character, lifted, "feet").min() > -SINK - 1e-9
    np.testing.assert_array_equal(lifted[60:], poses[60:])
