import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.motion import (
    Label,
    Motion,
    interpolate_with_velocities,
    move_poses,
    pose_velocities,
)
from dynresp.support.errors import MotionError
from tests.motion.samples import random_poses, smooth_motion
from tests.oracles import kinematics as slow
from tests.oracles.quaternions import matrix


def counting(frames: int, fps: float = 30.0, labels: tuple[Label, ...] = ()) -> Motion:
    """A motion whose root is at x = frame number."""
    poses = np.zeros((frames, 59))
    poses[:, 0] = np.arange(frames)
    poses[:, 3::4] = 1.0
    return Motion(poses, fps, "counting", labels=labels)


class TestValidation:
    def test_what_it_holds(self) -> None:
        motion = counting(31)
        assert len(motion) == 31
        assert motion.duration == 1.0
        assert motion.joint_quaternions.shape == (31, 13, 4)
        assert motion.contacts.shape == (31, 2)
        assert not motion.contacts.any()

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"poses": np.zeros((0, 59))}, "no frame"),
            ({"poses": np.zeros((3, 58))}, r"\(frames, 59\), got \(3, 58\)"),
            ({"fps": 0.0}, "frame rate must be 0.001 to 10000"),
            ({"fps": 1e-320}, "got 1e-320"),
            ({"fps": -30.0}, "got -30"),
            ({"fps": math.nan}, "got nan"),
            ({"fps": 1e9}, "got 1000000000"),
            ({"contacts": np.zeros((4, 2))}, r"contacts must be \(3, 2\), got \(4, 2\)"),
            ({"contacts": np.zeros(3)}, "contacts must be"),
            ({"labels": (Label("late", 2, 4),)}, "'late' spans frames 2 to 4"),
            ({"labels": (Label("empty", 1, 1),)}, "'empty'"),
            ({"labels": (Label("early", -1, 1),)}, "'early'"),
        ],
    )
    def test_what_it_refuses(self, change: dict[str, object], message: str) -> None:
        given_ = {"poses": counting(3).poses, "fps": 30.0, **change}
        with pytest.raises(MotionError, match=message):
            Motion(**given_)  # type: ignore[arg-type]

    @pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
    def test_numbers_that_are_not_finite(self, number: float) -> None:
        poses = np.array(counting(5).poses)
        poses[3, 17] = number
        with pytest.raises(MotionError, match=r"not finite \(frame 3\)"):
            Motion(poses, 30.0)

    def test_a_root_out_of_the_world(self) -> None:
        poses = np.array(counting(5).poses)
        poses[2, 1] = 1e200
        with pytest.raises(MotionError, match="100000 m of the origin"):
            Motion(poses, 30.0)

    def test_arrays_are_copies_and_read_only(self) -> None:
        poses = np.array(counting(3).poses)
        motion = Motion(poses, 30)
        poses[0, 0] = 7.0
        assert motion.poses[0, 0] == 0.0
        for array in (motion.poses, motion.contacts, motion.root_positions):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0
        assert isinstance(motion.fps, float)

    def test_labels_become_a_tuple(self) -> None:
        labels = [Label("a", 0, 1)]
        assert Motion(counting(3).poses, 30.0, labels=labels).labels == tuple(labels)  # type: ignore[arg-type]

    def test_quaternions_become_unit_and_continuous(self, rng: np.random.Generator) -> None:
        smooth = smooth_motion(rng)
        poses = np.array(smooth.poses)
        signs = np.where(rng.random((len(smooth), 14, 1)) > 0.5, 1.0, -1.0)
        sizes = rng.uniform(0.1, 10.0, (len(smooth), 14, 1))
        poses[:, 3:] = (poses[:, 3:].reshape(-1, 14, 4) * signs * sizes).reshape(-1, 56)
        quaternions = Motion(poses, 30.0).poses[:, 3:].reshape(-1, 14, 4)
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1.0, atol=1e-15)
        assert (np.sum(quaternions[1:] * quaternions[:-1], axis=-1) > 0).all()

    def test_a_motion_of_a_motions_poses_is_the_same_bit_for_bit(
        self, rng: np.random.Generator
    ) -> None:
        motion = Motion(random_poses(rng, 500), 30.0)
        np.testing.assert_array_equal(Motion(motion.poses, 30.0).poses, motion.poses)
        np.testing.assert_array_equal(motion.slice(100, 300).poses, motion.poses[100:300])


class TestSlice:
    def test_frames_contacts_and_labels(self, rng: np.random.Generator) -> None:
        labels = (Label("before", 0, 5), Label("over", 3, 12), Label("in", 6, 8), Label("a", 0, 20))
        motion = Motion(counting(20).poses, 30.0, "x", rng.random((20, 2)) > 0.5, labels)
        part = motion.slice(5, 10)
        np.testing.assert_array_equal(part.root_positions[:, 0], np.arange(5, 10))
        np.testing.assert_array_equal(part.contacts, motion.contacts[5:10])
        assert part.labels == (Label("over", 0, 5), Label("in", 1, 3), Label("a", 0, 5))
        assert part.name == "x"
        assert part.fps == 30.0

    @pytest.mark.parametrize(("start", "stop"), [(-1, 3), (3, 3), (4, 2), (0, 21)])
    def test_ranges_outside(self, start: int, stop: int) -> None:
        with pytest.raises(MotionError, match="it has frames 0 to 20"):
            counting(20).slice(start, stop)


class TestSampling:
    def test_between_frames(self) -> None:
        x = counting(11).sample([-1.0, 0.0, 0.05, 0.1, 1 / 3, 9.0])[:, 0]
        np.testing.assert_allclose(x, [0.0, 0.0, 1.5, 3.0, 10.0, 10.0], atol=1e-12)

    def test_rotations_turn_evenly(self) -> None:
        poses = np.array(counting(2, 1.0).poses)
        poses[1, 7:11] = rotations.about_axis((0.0, 1.0, 0.0), 2.0)
        joint = Motion(poses, 1.0).sample(np.linspace(0.0, 1.0, 5))[:, 7:11]
        expected = rotations.about_axis((0.0, 1.0, 0.0), np.linspace(0.0, 2.0, 5))
        np.testing.assert_allclose(joint, expected, atol=1e-15)

    def test_at_frames_it_is_the_frames(self, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng, 300, 29.97)
        sampled = motion.sample(np.arange(300) / 29.97)
        np.testing.assert_array_equal(sampled, motion.poses)

    def test_a_single_frame(self) -> None:
        motion = counting(1)
        assert motion.sample([0.0, 3.0]).shape == (2, 59)
        assert len(motion.resampled(60.0)) == 1


class TestResampling:
    @pytest.mark.parametrize(("fps", "other"), [(30.0, 60.0), (30.0, 120.0), (24.0, 120.0)])
    @pytest.mark.parametrize("frames", [1, 2, 7, 40, 41])
    def test_there_and_back_is_exact(
        self, rng: np.random.Generator, fps: float, other: float, frames: int
    ) -> None:
        smooth = smooth_motion(rng, max(frames, 8), fps).slice(0, frames)
        labels = tuple(Label(f"{k}", k, min(k + 3, frames)) for k in range(0, frames, 3))
        motion = Motion(smooth.poses, fps, "x", smooth.contacts, labels)
        back = motion.resampled(other).resampled(fps)
        np.testing.assert_array_equal(back.poses, motion.poses)
        np.testing.assert_array_equal(back.contacts, motion.contacts)
        assert back.labels == motion.labels
        assert back.name == motion.name

    def test_lengths(self) -> None:
        assert len(counting(31, 30.0).resampled(60.0)) == 61
        assert len(counting(61, 60.0).resampled(30.0)) == 31
        assert len(counting(60, 60.0).resampled(30.0)) == 30
        assert len(counting(121, 120.0).resampled(25.0)) == 26

    @given(st.floats(1.0, 240.0), st.floats(1.0, 240.0), st.integers(1, 60))
    def test_any_rates(self, fps: float, other: float, frames: int) -> None:
        labels = tuple(Label("", k, min(k + 4, frames)) for k in range(0, frames, 4))
        motion = counting(frames, fps, labels)
        result = motion.resampled(other)
        times = np.arange(len(result)) / other
        np.testing.assert_allclose(result.root_positions[:, 0], times * fps, atol=1e-4)
        assert motion.duration - result.duration < 1.0 / other + 1e-9
        assert result.duration <= motion.duration + 1e-6 / other
        # Labels that meet still meet, from the first frame on.
        if result.labels:
            stops = [0, *(label.stop for label in result.labels)]
            assert [label.start for label in result.labels] == stops[:-1]

    def test_the_same_rate_is_the_same_motion(self) -> None:
        motion = counting(5)
        assert motion.resampled(30.0) is motion

    @pytest.mark.parametrize("fps", [0.0, -1.0, math.nan, 1e6])
    def test_impossible_rates(self, fps: float) -> None:
        with pytest.raises(MotionError, match="frame rate must be"):
            counting(5).resampled(fps)


class TestVelocities:
    def test_equal_mujocos_differences(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        motion = smooth_motion(rng)
        velocities = motion.velocities()
        expected = np.zeros(45)
        for k in range(len(motion)):
            a, b = max(k - 1, 0), min(k + 1, len(motion) - 1)
            span = (b - a) / motion.fps
            mujoco.mj_differentiatePos(
                character.model, expected, span, motion.poses[a], motion.poses[b]
            )
            np.testing.assert_allclose(velocities[k], expected, atol=1e-9)

    def test_move_the_body_as_mujoco_integrates_them(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        a = random_poses(rng, 1)[0]
        velocity = rng.normal(size=45)
        b = a.copy()
        mujoco.mj_integratePos(character.model, b, velocity, 0.01)
        found = pose_velocities(np.stack([a, b]), 100.0)
        np.testing.assert_allclose(found, np.tile(velocity, (2, 1)), atol=1e-9)

    def test_even_spins(self, rng: np.random.Generator) -> None:
        fps, frames = 120.0, 30
        times = np.arange(frames) / fps
        start = rotations.normalize(rng.normal(size=(14, 4)))
        rates = rng.normal(size=(14, 3)) * 5.0  # rad/s in the frame of the body
        turns = rotations.from_rotation_vector(times[:, None, None] * rates)
        poses = np.zeros((frames, 59))
        poses[:, ROOT] = times[:, None] * [1.0, -2.0, 0.5]
        poses[:, 3:] = rotations.multiply(start, turns).reshape(frames, -1)
        velocities = Motion(poses, fps).velocities()
        np.testing.assert_allclose(velocities[:, :3], np.tile([1.0, -2.0, 0.5], (frames, 1)))
        np.testing.assert_allclose(
            velocities[:, 3:], np.tile(rates.ravel(), (frames, 1)), rtol=1e-9
        )

    def test_a_single_frame_stands_still(self) -> None:
        np.testing.assert_array_equal(counting(1).velocities(), np.zeros((1, 45)))


class TestMirrored:
    def test_twice_is_nothing_and_contacts_swap(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        motion = smooth_motion(rng)
        mirrored = motion.mirrored(character)
        np.testing.assert_array_equal(mirrored.contacts, motion.contacts[:, ::-1])
        assert mirrored.labels == motion.labels
        assert "mirrored" in mirrored.name
        back = mirrored.mirrored(character)
        np.testing.assert_array_equal(back.poses, motion.poses)
        np.testing.assert_array_equal(back.contacts, motion.contacts)

    def test_kinematics_are_reflected(self, character: Character, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng)
        there = character.kinematics(motion.poses).positions[:, character.mirror_bodies]
        here = character.kinematics(motion.mirrored(character).poses).positions
        np.testing.assert_allclose(here, there @ slow.REFLECTION, atol=1e-12)


class TestPlacing:
    def test_moves_all_bodies_alike(self, character: Character, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng)
        moved = motion.moved(0.7, (1.0, 2.0, 3.0))
        turn = matrix(rotations.from_yaw(0.7))
        before = character.kinematics(motion.poses).positions
        after = character.kinematics(moved.poses).positions
        np.testing.assert_allclose(after, before @ turn.T + [1.0, 2.0, 3.0], atol=1e-12)

    def test_velocities_of_the_joints_stay(self, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng)
        moved = motion.moved(2.0, (5.0, 0.0, 0.0))
        np.testing.assert_allclose(moved.velocities()[:, 3:], motion.velocities()[:, 3:], atol=1e-9)

    @pytest.mark.parametrize("frame", [0, 17, -1])
    def test_puts_a_frame_where_it_should_be(self, rng: np.random.Generator, frame: int) -> None:
        motion = smooth_motion(rng)
        placed = motion.placed(3.0, -4.0, 1.5, frame)
        np.testing.assert_allclose(placed.poses[frame, :2], [3.0, -4.0], atol=1e-12)
        facing = rotations.yaw_of(placed.poses[frame, ROOT_QUAT])
        assert float(facing) == pytest.approx(1.5, abs=1e-12)
        # Heights stay, and so does what the motion is: only the frame of reference changed.
        np.testing.assert_allclose(placed.poses[:, 2], motion.poses[:, 2], atol=1e-12)
        np.testing.assert_allclose(placed.poses[:, 7:], motion.poses[:, 7:], atol=1e-15)

    def test_there_and_back(self, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 20)
        back = move_poses(move_poses(poses, 1.0, (0.0, 0.0, 0.0)), -1.0, (0.0, 0.0, 0.0))
        np.testing.assert_allclose(back, poses, atol=1e-14)

    @pytest.mark.parametrize("frame", [20, -21])
    def test_frames_that_are_not_there(self, frame: int) -> None:
        with pytest.raises(MotionError, match="it has frames 0 to 19"):
            counting(20).placed(frame=frame)


class TestInterpolateMoving:
    @given(st.integers(0, 10_000))
    def test_begins_and_ends_as_told(self, seed: int) -> None:
        motion = smooth_motion(np.random.default_rng(seed), 12)
        a, b = motion.poses[3:4], motion.poses[4:5]
        moving = motion.velocities()
        seconds, tick = 1.0 / motion.fps, 1e-4
        times = np.array([0.0, tick, 1.0 - tick, 1.0])
        poses = interpolate_with_velocities(
            np.repeat(a, 4, axis=0), np.repeat(b, 4, axis=0), np.repeat(moving[3:4], 4, axis=0),
            np.repeat(moving[4:5], 4, axis=0), times, seconds,
        )  # fmt: skip
        np.testing.assert_allclose(poses[0, ROOT], a[0, ROOT], atol=1e-12)
        np.testing.assert_array_equal(poses[3], b[0])
        for first, wanted in ((0, moving[3]), (2, moving[4])):
            found = pose_velocities(poses[first : first + 2], 1.0 / (tick * seconds))[0]
            np.testing.assert_allclose(found[:3], wanted[:3], atol=2e-2)
            # Angular velocities at b hold to first order in how far a joint turns.
            np.testing.assert_allclose(
                found[3:], wanted[3:], atol=0.05 + 0.1 * abs(wanted[3:]).max()
            )

    def test_is_nearer_to_a_person_than_slerp(self, character: Character) -> None:
        fine = load_builtin("walk", character).resampled(60.0)
        coarse = fine.resampled(15.0)
        step, part = np.divmod(np.arange(4 * (len(coarse) - 1)), 4)
        moving = coarse.velocities()
        smooth = interpolate_with_velocities(
            coarse.poses[step], coarse.poses[step + 1], moving[step], moving[step + 1],
            part / 4.0, 1.0 / 15.0,
        )  # fmt: skip
        straight = coarse.resampled(60.0).poses
        errors = [
            rotations.angle_between(
                poses[8 : len(smooth) - 8, 3:].reshape(-1, 14, 4),
                fine.poses[8 : len(smooth) - 8, 3:].reshape(-1, 14, 4),
            ).mean()
            for poses in (smooth, straight)
        ]
        assert errors[0] < 0.8 * errors[1]
