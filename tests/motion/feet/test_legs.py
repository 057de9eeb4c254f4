import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet.legs import MAX_STRETCH, ankle_positions, place_ankles
from tests.motion.samples import bend_knees, random_poses

UPPER, LOWER = 0.4222, 0.4403
LONGEST = MAX_STRETCH * (UPPER + LOWER)
SHORTEST = LOWER - UPPER + 1e-3
LEGS = [f"{side}_{x}" for side in ("left", "right") for x in ("hip", "knee", "ankle")]


def hips(character: Character, poses: np.ndarray) -> np.ndarray:
    positions = character.kinematics(poses).positions
    return positions[:, [character.body("left_thigh"), character.body("right_thigh")]]


def ankles(character: Character, poses: np.ndarray) -> np.ndarray:
    return ankle_positions(character, character.kinematics(poses))


def forward_bend(character: Character, poses: np.ndarray) -> np.ndarray:
    """Sine of the knees' flexion about the thighs' lateral axes, (frames, 2); negative is wrong."""
    states = character.kinematics(poses)
    columns = []
    for side in ("left", "right"):
        thigh, shank, foot = (
            states.positions[:, character.body(f"{side}_{x}")] for x in ("thigh", "shank", "foot")
        )
        lateral = rotations.rotate(
            states.quaternions[:, character.body(f"{side}_thigh")], np.array([0.0, 1.0, 0.0])
        )
        axis = np.cross((shank - thigh) / UPPER, (foot - shank) / LOWER)
        columns.append(np.sum(axis * lateral, axis=1))
    return np.stack(columns, axis=1)


def directions(rng: np.random.Generator, frames: int) -> np.ndarray:
    v = rng.normal(size=(frames, 2, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def bent_poses(character: Character, rng: np.random.Generator, frames: int) -> np.ndarray:
    return bend_knees(character, random_poses(rng, frames), rng.uniform(0.0, 2.6, (frames, 2)))


class TestWithinReach:
    def test_ankles_meet_their_targets(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        poses = bent_poses(character, rng, 500)
        distance = rng.uniform(SHORTEST, LONGEST, (500, 2, 1))
        targets = hips(character, poses) + distance * directions(rng, 500)
        placed = place_ankles(character, poses, targets)
        np.testing.assert_allclose(ankles(character, placed), targets, atol=1e-9)

    def test_poses_of_any_kind_do(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 300)
        distance = rng.uniform(SHORTEST, LONGEST, (300, 2, 1))
        targets = hips(character, poses) + distance * directions(rng, 300)
        placed = place_ankles(character, poses, targets)
        np.testing.assert_allclose(ankles(character, placed), targets, atol=1e-9)

    @given(st.floats(-17.0, -1.0), st.integers(0, 2**32 - 1))
    def test_targets_on_the_other_side_of_the_hip(self, power: float, seed: int) -> None:
        character, rng = default_character(), np.random.default_rng(seed)
        poses = bent_poses(character, rng, 4)
        hip = hips(character, poses)
        aim = hip - ankles(character, poses) + 10.0**power * directions(rng, 4)
        aim *= 0.5 / np.linalg.norm(aim, axis=-1, keepdims=True)
        placed = place_ankles(character, poses, hip + aim)
        np.testing.assert_allclose(ankles(character, placed), hip + aim, atol=1e-9)

    def test_only_the_legs_change_and_feet_keep_their_orientation(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        poses = bent_poses(character, rng, 50)
        targets = hips(character, poses) + 0.6 * directions(rng, 50)
        placed = place_ankles(character, poses, targets)
        joints = [character.joint(name) for name in LEGS]
        columns = np.setdiff1d(np.arange(59), [7 + 4 * j + i for j in joints for i in range(4)])
        np.testing.assert_allclose(placed[:, columns], poses[:, columns], atol=1e-14)
        feet = [character.body("left_foot"), character.body("right_foot")]
        before = character.kinematics(poses).quaternions[:, feet]
        after = character.kinematics(placed).quaternions[:, feet]
        np.testing.assert_allclose(rotations.angle_between(before, after), 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(placed[:, 3:].reshape(-1, 4), axis=1), 1.0)

    def test_feet_turn_as_asked(self, character: Character, rng: np.random.Generator) -> None:
        poses = bent_poses(character, rng, 20)
        feet = rotations.normalize(rng.normal(size=(20, 2, 4)))
        placed = place_ankles(character, poses, ankles(character, poses), feet)
        columns = [character.body("left_foot"), character.body("right_foot")]
        after = character.kinematics(placed).quaternions[:, columns]
        np.testing.assert_allclose(rotations.angle_between(after, feet), 0.0, atol=1e-12)

    def test_ankles_where_they_are_change_nothing(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        poses = bend_knees(character, random_poses(rng, 50), rng.uniform(0.07, 2.6, (50, 2)))
        placed = place_ankles(character, poses, ankles(character, poses))
        np.testing.assert_allclose(placed, poses, atol=1e-9)

    def test_a_bent_knee_keeps_its_own_plane(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        # Knees that bend 30 degrees off the thigh's lateral axis, as retargeted legs may.
        poses = random_poses(rng, 50)
        axis = (math.sin(0.5), math.cos(0.5), 0.0)
        for side in ("left", "right"):
            column = 7 + 4 * character.joint(f"{side}_knee")
            poses[:, column : column + 4] = rotations.about_axis(axis, rng.uniform(0.1, 2.0, 50))
        placed = place_ankles(character, poses, ankles(character, poses))
        np.testing.assert_allclose(placed, poses, atol=1e-9)


class TestOutOfReach:
    @pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-3, LONGEST + 1e-4, 2.0, 1e6])
    def test_ankles_stay_on_the_line(
        self, character: Character, rng: np.random.Generator, distance: float
    ) -> None:
        poses = bent_poses(character, rng, 50)
        aim = directions(rng, 50)
        hip = hips(character, poses)
        placed = place_ankles(character, poses, hip + distance * aim)
        assert np.isfinite(placed).all()
        reached = ankles(character, placed) - hip
        expected = min(max(distance, SHORTEST), LONGEST)
        np.testing.assert_allclose(np.linalg.norm(reached, axis=-1), expected, atol=1e-9)
        if distance > 1e-6:
            np.testing.assert_allclose(reached, expected * aim, atol=1e-7)

    def test_a_target_at_the_hip_keeps_the_legs_direction(self, character: Character) -> None:
        poses = bend_knees(character, character.rest_pose[None], np.array([[1.0, 0.5]]))
        hip = hips(character, poses)
        placed = place_ankles(character, poses, hip)
        reached = ankles(character, placed) - hip
        assert np.isfinite(placed).all()
        np.testing.assert_allclose(np.linalg.norm(reached, axis=-1), SHORTEST, atol=1e-9)


class TestKnees:
    def test_never_bend_backward(self, character: Character, rng: np.random.Generator) -> None:
        poses = bent_poses(character, rng, 300)
        targets = hips(character, poses) + rng.uniform(0.0, 1.0, (300, 2, 1)) * directions(rng, 300)
        assert forward_bend(character, poses).min() >= 0.0
        assert forward_bend(character, place_ankles(character, poses, targets)).min() > -1e-9

    @pytest.mark.parametrize(
        "flexion", [-0.3, -math.asin(0.05), -0.05, -0.02, -1e-9, 0.0, 1e-12, 1e-3]
    )
    def test_straight_or_hyperextended_ones_bend_forward(
        self, character: Character, flexion: float
    ) -> None:
        poses = bend_knees(character, character.rest_pose[None], np.full((1, 2), flexion))
        targets = hips(character, poses) + np.array([0.1, 0.0, -0.7])
        placed = place_ankles(character, poses, targets)
        np.testing.assert_allclose(ankles(character, placed), targets, atol=1e-9)
        flexed = (UPPER**2 + LOWER**2 - 0.5) / (2.0 * UPPER * LOWER)
        expected = math.sqrt(1.0 - flexed**2)
        np.testing.assert_allclose(forward_bend(character, placed), expected, atol=1e-9)

    def test_standing_on_straight_legs_barely_changes(self, character: Character) -> None:
        poses = character.rest_pose[None]
        placed = place_ankles(character, poses, ankles(character, poses))
        moved = np.linalg.norm(ankles(character, placed) - ankles(character, poses), axis=-1)
        assert moved.max() < 5e-4
        assert 0.0 < forward_bend(character, placed).min() < 0.1

    def test_vary_smoothly_as_a_leg_straightens_and_overextends(self, character: Character) -> None:
        frames = 400
        flexion = np.linspace(0.3, -0.3, frames)[:, None].repeat(2, axis=1)
        poses = bend_knees(character, np.tile(character.rest_pose, (frames, 1)), flexion)
        targets = hips(character, poses) + np.array([0.05, 0.0, -0.8])
        placed = place_ankles(character, poses, targets)
        steps = rotations.angle_between(
            placed[1:, 7:].reshape(-1, 13, 4), placed[:-1, 7:].reshape(-1, 13, 4)
        )
        assert steps.max() < 0.01
