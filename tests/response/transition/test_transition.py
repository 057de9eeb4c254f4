"""Targets that lead to the reaction, its placement, and the blend onto it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.response.transition.transition import (
    TransitionConfig,
    blend_onto,
    blended_targets,
    place_on,
)
from dynresp.response.windows.windows import facing_frames
from dynresp.support.errors import UsageError
from tests.motion.samples import random_poses, smooth_motion
from tests.oracles import blending, quaternions
from tests.physics.samples import walking

seeds = st.integers(0, 2**32 - 1)


def _motions(seed: int, frames: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    return smooth_motion(rng, frames).poses, smooth_motion(rng, frames).poses


def _same_poses(a: FloatArray, b: FloatArray, atol: float = 1e-9) -> None:
    """Equal as poses: a rotation has two signs."""
    np.testing.assert_allclose(a[:, ROOT], b[:, ROOT], atol=atol)
    turns = rotations.angle_between(
        a[:, 3:].reshape(len(a), 14, 4), b[:, 3:].reshape(len(b), 14, 4)
    )
    np.testing.assert_allclose(turns, 0.0, atol=10 * atol)


class TestEase:
    """The weight of the blend."""

    def test_slopes_and_middle(self) -> None:
        t = np.linspace(0.0, 1.0, 1001)
        weight = rotations.ease(t)
        np.testing.assert_allclose(weight, [blending.ease(x) for x in t], atol=1e-12)
        assert (weight[0], weight[-1]) == (0.0, 1.0)
        assert weight[500] == pytest.approx(0.5)
        assert np.all(np.diff(weight) > 0)
        slope = np.gradient(weight, t)
        assert abs(slope[0]) < 4e-3
        assert abs(slope[-1]) < 4e-3
        np.testing.assert_allclose(weight + weight[::-1], 1.0, atol=1e-15)
        np.testing.assert_array_equal(rotations.ease([-5.0, 7.0]), [0.0, 1.0])


class TestBlendOnto:
    """The simulated motion blended onto the reaction."""

    @given(seed=seeds, frames=st.integers(2, 25))
    def test_equals_its_twin(self, seed: int, frames: int) -> None:
        simulated, reaction = _motions(seed, frames)
        blend = blend_onto(simulated, reaction)
        _same_poses(blend, blending.blend_onto(simulated, reaction), 1e-7)

    @given(seed=seeds, frames=st.integers(2, 25))
    def test_begins_and_ends_exactly(self, seed: int, frames: int) -> None:
        simulated, reaction = _motions(seed, frames)
        blend = blend_onto(simulated, reaction)
        _same_poses(blend[:1], simulated[:1], 1e-12)
        _same_poses(blend[-1:], reaction[-1:], 1e-12)
        lengths = np.linalg.norm(blend[:, 3:].reshape(frames, 14, 4), axis=2)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-12)

    @given(seed=seeds)
    def test_between_two_still_poses_it_goes_straight(self, seed: int) -> None:
        """Every rotation turns about one axis, and farther in every frame."""
        rng = np.random.default_rng(seed)
        a, b = random_poses(rng, 2)
        frames = 12
        blend = blend_onto(np.tile(a, (frames, 1)), np.tile(b, (frames, 1)))
        whole = rotations.angle_between(a[3:].reshape(14, 4), b[3:].reshape(14, 4))
        turns = blend[:, 3:].reshape(frames, 14, 4)
        done = rotations.angle_between(a[3:].reshape(14, 4), turns)
        left = rotations.angle_between(turns, b[3:].reshape(14, 4))
        weight = np.array([blending.ease(i / (frames - 1)) for i in range(frames)])[:, None]
        np.testing.assert_allclose(done, weight * whole, atol=1e-7)
        np.testing.assert_allclose(done + left, np.tile(whole, (frames, 1)), atol=1e-7)
        distance = np.linalg.norm(blend[:, ROOT] - a[ROOT], axis=1)
        assert np.all(np.diff(distance) >= 0)

    @given(seed=seeds)
    def test_signs_of_quaternions_do_not_matter(self, seed: int) -> None:
        simulated, reaction = _motions(seed, 9)
        flipped = reaction.copy()
        flips = np.random.default_rng(seed).choice([-1.0, 1.0], size=14)
        flipped[:, 3:] = (reaction[:, 3:].reshape(9, 14, 4) * flips[:, None]).reshape(9, -1)
        _same_poses(blend_onto(simulated, reaction), blend_onto(simulated, flipped))

    def test_a_motion_blended_with_itself_is_itself(self, rng: np.random.Generator) -> None:
        poses = smooth_motion(rng, 11).poses
        _same_poses(blend_onto(poses, poses), poses, 1e-12)

    def test_each_rotation_keeps_its_direction(self, character: Character) -> None:
        """Two motions whose rotations come to differ by more than half a turn."""
        frames = 21
        a = np.tile(character.rest_pose, (frames, 1))
        b = a.copy()
        b[:, ROOT_QUAT] = rotations.from_yaw(np.linspace(2.9, 3.4, frames))
        blend = blend_onto(a, b)
        steps = rotations.angle_between(blend[:-1, ROOT_QUAT], blend[1:, ROOT_QUAT])
        assert steps.max() < 0.5


class TestTargets:
    """Servo targets."""

    @given(
        seed=seeds,
        entry=st.integers(0, 25),
        start=st.integers(0, 8),
        length=st.integers(1, 12),
    )
    def test_equals_its_twin(self, seed: int, entry: int, start: int, length: int) -> None:
        base, reaction = _motions(seed, 26)
        given_ = base[: start + length + 3]
        targets = blended_targets(given_, reaction, entry, start, start + length)
        twin = blending.blended_targets(given_, reaction, entry, start, start + length)
        _same_poses(targets, twin, 1e-7)

    @given(seed=seeds, entry=st.integers(3, 10), start=st.integers(0, 3))
    def test_leads_from_the_base_to_the_reaction(self, seed: int, entry: int, start: int) -> None:
        base, reaction = _motions(seed, 30)
        end = start + 10
        targets = blended_targets(base[: end + 3], reaction, entry, start, end)
        _same_poses(targets[:1], base[:1], 1e-12)
        after = reaction[entry + 10 : entry + 13]
        _same_poses(targets[end:], after, 1e-12)

    @given(seed=seeds)
    def test_comes_closer_in_every_frame(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        a, b = random_poses(rng, 2)
        targets = blended_targets(np.tile(a, (14, 1)), np.tile(b, (40, 1)), 5, 0, 10)
        left = rotations.angle_between(targets[:, 3:].reshape(14, 14, 4), b[3:].reshape(14, 4))
        assert np.all(np.diff(left, axis=0) <= 1e-9)
        np.testing.assert_allclose(left[10:], 0.0, atol=1e-7)

    def test_a_reaction_that_ends_is_held(self, rng: np.random.Generator) -> None:
        base, reaction = smooth_motion(rng, 20).poses, smooth_motion(rng, 6).poses
        targets = blended_targets(base, reaction, 2, 0, 10)
        _same_poses(targets[10:], np.repeat(reaction[[-1]], 10, axis=0), 1e-12)

    @given(seed=seeds)
    def test_neighbouring_targets_have_neighbouring_signs(self, seed: int) -> None:
        """The servos interpolate linearly between two targets."""
        rng = np.random.default_rng(seed)
        start = random_poses(rng, 1)[0]
        a = np.tile(start, (14, 1))
        turns = rotations.from_rotation_vector(rng.normal(scale=0.4, size=(14, 14, 3)))
        other = rotations.multiply(a[:, 3:].reshape(14, 14, 4), turns)
        b = np.concatenate([a[:, :3], other.reshape(14, -1)], axis=1)
        targets = blended_targets(a, b, 0, 0, 10)[:, 3:].reshape(14, 14, 4)
        assert np.sum(targets[1:] * targets[:-1], axis=-1).min() > 0.0

    def test_signs_hold_if_base_and_reaction_differ_by_half_a_turn(
        self, character: Character
    ) -> None:
        frames = 14
        a = np.tile(character.rest_pose, (frames, 1))
        b = a.copy()
        column = 7 + 4 * character.joint("left_shoulder")
        b[:, column : column + 4] = rotations.about_axis((0, 1, 0), -np.linspace(3.0, 3.3, frames))
        targets = blended_targets(a, b, 0, 0, 8)[:, column : column + 4]
        assert np.sum(targets[1:] * targets[:-1], axis=-1).min() > 0.0


class TestPlaceOn:
    """The reaction placed on the character's pose."""

    @given(seed=seeds, entry=st.integers(0, 9))
    def test_entry_stands_and_faces_like_the_pose(self, seed: int, entry: int) -> None:
        rng = np.random.default_rng(seed)
        reaction, pose = smooth_motion(rng, 10).poses, random_poses(rng, 1)[0]
        placed = place_on(reaction, entry, pose)
        ground, yaw = facing_frames(placed[entry, ROOT], placed[entry, ROOT_QUAT])
        wanted_ground, wanted_yaw = facing_frames(pose[ROOT], pose[ROOT_QUAT])
        np.testing.assert_allclose(ground, wanted_ground, atol=1e-9)
        off = float(yaw - wanted_yaw)
        assert abs(math.remainder(off, 2.0 * math.pi)) < 1e-6

    @given(seed=seeds, entry=st.integers(0, 9))
    def test_is_one_movement_on_the_ground(self, seed: int, entry: int) -> None:
        """Heights and joints stay; all frames have the same turn and shift."""
        rng = np.random.default_rng(seed)
        reaction, pose = smooth_motion(rng, 10).poses, random_poses(rng, 1)[0]
        placed = place_on(reaction, entry, pose)
        np.testing.assert_array_equal(placed[:, 7:], reaction[:, 7:])
        np.testing.assert_allclose(placed[:, 2], reaction[:, 2], atol=1e-12)
        turn = rotations.multiply(placed[0, ROOT_QUAT], rotations.conjugate(reaction[0, ROOT_QUAT]))
        angle = 2.0 * math.atan2(turn[3], turn[0])
        moved = blending.turned_about_vertical(reaction[0], angle, (0.0, 0.0))
        shift = (placed[0, 0] - moved[0], placed[0, 1] - moved[1])
        twin = [blending.turned_about_vertical(row, angle, shift) for row in reaction]
        _same_poses(placed, np.array(twin), 1e-8)

    @pytest.mark.parametrize("yaw", [0.0, 1.0, 3.1, -2.5])
    def test_facing_is_that_of_the_twin(self, character: Character, yaw: float) -> None:
        reaction = walking(character, yaw=-0.4).poses
        pose = character.rest_pose.copy()
        lean = rotations.about_axis((0.3, 1.0, 0.0), 0.5)
        pose[ROOT_QUAT] = rotations.multiply(rotations.from_yaw(yaw), lean)
        placed = place_on(reaction, 7, pose)
        faces, wanted = (quaternions.facing(row[ROOT_QUAT]) for row in (placed[7], pose))
        assert abs(math.remainder(faces - wanted, 2.0 * math.pi)) < 2e-4

    def test_placing_where_it_is_changes_nothing(self, character: Character) -> None:
        reaction = walking(character, yaw=2.0).poses
        _same_poses(place_on(reaction, 11, reaction[11]), reaction, 1e-12)


class TestConfig:
    """Length of the blend."""

    @pytest.mark.parametrize(
        ("blend_s", "fps", "frames"), [(1 / 3, 30.0, 10), (0.5, 60.0, 30), (0.001, 30.0, 1)]
    )
    def test_frames(self, blend_s: float, fps: float, frames: int) -> None:
        assert TransitionConfig(blend_s).blend_frames(fps) == frames

    @pytest.mark.parametrize("blend_s", [0.0, -1.0, math.nan, math.inf])
    def test_refuses_what_is_not_a_length(self, blend_s: float) -> None:
        with pytest.raises(UsageError, match="blend_s"):
            TransitionConfig(blend_s)


def test_slerp_against_shoemakes_formula(rng: np.random.Generator) -> None:
    for _ in range(100):
        a, b = rotations.normalize(rng.normal(size=(2, 4)))
        for t in (0.0, 0.2, 0.5, 0.9, 1.0):
            one, other = rotations.slerp(a, b, t), quaternions.slerp(a, b, t)
            assert float(rotations.angle_between(one, rotations.normalize(other))) < 1e-6


def test_a_blend_of_motions_makes_a_motion(rng: np.random.Generator) -> None:
    a, b = smooth_motion(rng, 11).poses, smooth_motion(rng, 11).poses
    motion = Motion(blend_onto(a, b), 30.0)
    q = motion.poses[:, 3:].reshape(len(motion), 14, 4)
    assert np.sum(q[1:] * q[:-1], axis=-1).min() >= 0.0
