"""The metrics find the faults that were put into a motion."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.character import ROOT_QUAT, Character
from dynresp.motion.motion import FEET, Motion
from dynresp.physics.prepared_impact import PreparedImpact
from dynresp.physics.scene import ImpactorKind
from dynresp.physics.trace import Contact
from dynresp.response.response import Response
from dynresp.response.response_quality import (
    Quality,
    joint_speed_steps,
    measure,
    root_shake,
)
from tests.motion.samples import random_quaternions, smooth_motion
from tests.oracles import kinematics, quaternions
from tests.physics.samples import standing, turned, walking

FPS = 30.0
seeds = st.integers(0, 2**32 - 1)
NO_IMPACT = PreparedImpact(ImpactorKind.NONE, 0, 0.0)


def _response(motion: Motion, contact: int, exit_frame: int, end: int) -> Response:
    """A response whose poses are those of the simulation and of the reaction."""
    return Response(
        motion,
        0,
        NO_IMPACT,
        contact=Contact(contact / motion.fps, contact, "chest", 1.0, (0.0, 0.0, 0.0)),
        contact_frame=contact,
        exit=exit_frame,
        end=end,
        choice="itself",
        entry=exit_frame,
        entered_motion=motion,
        simulated_after_exit=motion.poses[exit_frame + 1],
        placed_before_end=motion.poses[end - 1],
    )


def _measured(response: Response, character: Character) -> Quality:
    quality = measure(response, character)
    assert quality is not None
    return quality


class TestJointSpeedSteps:
    """Change of angular velocity from step to step."""

    @given(seed=seeds)
    def test_equals_a_slow_twin(self, seed: int) -> None:
        motion = smooth_motion(np.random.default_rng(seed), 6)
        steps = joint_speed_steps(motion)
        assert steps.shape == (4, 13)
        for joint in range(13):
            speeds = []
            for k in range(5):
                a, b = motion.joint_quaternions[k : k + 2, joint]
                inverse = np.array([a[0], -a[1], -a[2], -a[3]])
                turn = quaternions.multiply(inverse, b)
                turn = turn if turn[0] >= 0 else -turn
                angle = 2.0 * math.acos(min(turn[0], 1.0))
                axis = turn[1:] / max(float(np.linalg.norm(turn[1:])), 1e-12)
                speeds.append(angle * axis * FPS)
            for k in range(4):
                expected = float(np.linalg.norm(speeds[k + 1] - speeds[k]))
                assert steps[k, joint] == pytest.approx(expected, abs=1e-5)

    def test_a_steady_turn_has_none(self, character: Character) -> None:
        angles = np.linspace(0.0, 4.0, 30)
        vectors = np.outer(angles, [0.3, 0.4, 0.5])
        motion = Motion(turned(character, {"left_shoulder": vectors}, 30), FPS)
        assert joint_speed_steps(motion).max() < 1e-9

    @pytest.mark.parametrize("fps", [30.0, 120.0])
    def test_a_start_is_found_at_its_frame_and_size(self, character: Character, fps: float) -> None:
        angles = 3.0 * np.maximum(np.arange(20) - 8, 0) / fps
        vectors = np.outer(angles, [0.0, 1.0, 0.0])
        steps = joint_speed_steps(Motion(turned(character, {"neck": vectors}, 20), fps))
        neck = character.joint("neck")
        assert steps[7, neck] == pytest.approx(3.0)
        steps[7, neck] = 0.0
        assert steps.max() < 1e-9

    def test_another_axis_at_the_same_speed_counts(self, character: Character) -> None:
        """From 2 rad/s about y to 2 rad/s about x: the change is 2 sqrt 2."""
        turn = rotations.about_axis((0, 1, 0), 2.0 / FPS)
        other = rotations.about_axis((1, 0, 0), 2.0 / FPS)
        joint = [rotations.identity()]
        for k in range(10):
            joint.append(rotations.multiply(joint[-1], turn if k < 5 else other))
        poses = turned(character, {}, 11)
        column = 7 + 4 * character.joint("left_hip")
        poses[:, column : column + 4] = joint
        steps = joint_speed_steps(Motion(poses, FPS))
        assert steps.max() == pytest.approx(2.0 * math.sqrt(2.0))

    def test_signs_do_not_matter(self, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng, 12)
        flipped = motion.poses.copy()
        flipped[:, 3:] *= -1.0
        same = joint_speed_steps(Motion(flipped, FPS))
        np.testing.assert_allclose(joint_speed_steps(motion), same, atol=1e-9)


class TestRootShake:
    """How a step of the root differs from its neighbours."""

    @given(seed=seeds, frame=st.integers(1, 16))
    def test_none_for_any_speed_and_acceleration(self, seed: int, frame: int) -> None:
        rng = np.random.default_rng(seed)
        t = np.arange(20)[:, None] / FPS
        poses = np.zeros((20, 59))
        poses[:, 3:] = np.tile([1.0, 0.0, 0.0, 0.0], 14)
        poses[:, :3] = rng.normal(size=3) + 3.0 * rng.normal(size=3) * t + 9.0 * t**2
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = 2.0 * t[:, 0] + 3.0 * t[:, 0] ** 2
        start = random_quaternions(rng, 1)[0]
        poses[:, ROOT_QUAT] = rotations.multiply(rotations.about_axis(axis, angle), start)
        place, turn = root_shake(Motion(poses, FPS), frame)
        assert place < 1e-9
        assert turn < 1e-6

    @pytest.mark.parametrize("frame", [1, 7, 16])
    @pytest.mark.parametrize("shift", [(0.03, 0.0, 0.0), (0.01, -0.02, 0.005)])
    def test_a_shift_is_measured(
        self, character: Character, frame: int, shift: tuple[float, float, float]
    ) -> None:
        poses = walking(character, 0.6, speed=0.0).poses.copy()
        poses[:, 2] = 0.9  # a steady walk ahead, except for the shift
        poses[:, 0] = np.arange(len(poses)) * 0.05
        assert root_shake(Motion(poses, FPS), frame)[0] < 1e-9
        poses[frame + 1 :, :3] += shift
        place, turn = root_shake(Motion(poses, FPS), frame)
        assert place == pytest.approx(float(np.linalg.norm(shift)), abs=1e-9)
        assert turn < 1e-6

    @pytest.mark.parametrize("degrees", [0.5, 4.0])
    def test_a_jump_of_orientation_is_measured(self, character: Character, degrees: float) -> None:
        poses = standing(character, 0.6).poses.copy()
        steady = rotations.from_yaw(np.arange(len(poses)) * 0.03)
        leap = rotations.from_yaw(np.where(np.arange(len(poses)) > 8, np.radians(degrees), 0.0))
        poses[:, ROOT_QUAT] = rotations.multiply(leap, steady)
        place, turn = root_shake(Motion(poses, FPS), 8)
        assert turn == pytest.approx(degrees)
        assert place < 1e-12


class TestRootJump:
    """How far the blend moves the root from simulation and reaction."""

    def test_is_the_distance_from_simulation_and_reaction(self, character: Character) -> None:
        motion = walking(character, 2.0)
        plain = _response(motion, 10, 20, 30)
        assert _measured(plain, character).root_jump_m == 0.0
        assert _measured(plain, character).root_jump_deg < 1e-6
        left, joined = motion.poses[21].copy(), motion.poses[29].copy()
        left[:3] += (0.003, 0.004, 0.0)
        joined[ROOT_QUAT] = rotations.multiply(rotations.from_yaw(0.02), joined[ROOT_QUAT])
        moved = _measured(
            dataclasses.replace(plain, simulated_after_exit=left, placed_before_end=joined),
            character,
        )
        assert moved.root_jump_m == pytest.approx(0.005)
        assert moved.root_jump_deg == pytest.approx(math.degrees(0.02))


class TestMeasure:
    """A whole response."""

    def test_nothing_hit_nothing_measured(self, character: Character) -> None:
        assert measure(Response(standing(character), 0, NO_IMPACT), character) is None

    def test_times(self, character: Character) -> None:
        quality = _measured(_response(walking(character, 3.0), 12, 21, 36), character)
        assert quality.free_physics_s == pytest.approx(9 / 30)
        assert quality.physics_s == pytest.approx(24 / 30)

    @pytest.mark.parametrize("depth", [0.0, 0.015, 0.06])
    def test_depth_of_the_feet(self, character: Character, depth: float) -> None:
        motion = standing(character, 2.0)
        sole = kinematics.lowest_points(character, motion.poses[0])
        lowered = motion.moved(0.0, (0.0, 0.0, -sole.min() - depth))
        quality = _measured(_response(lowered, 5, 10, 20), character)
        assert quality.foot_depth_m == pytest.approx(depth, abs=1e-3)
        assert quality.body_depth_m == 0.0

    def test_depth_of_the_body(self, character: Character) -> None:
        """Lying on the back, 3 cm deep."""
        pose = character.rest_pose.copy()
        pose[ROOT_QUAT] = rotations.about_axis((0, 1, 0), -np.pi / 2)
        lowest = kinematics.lowest_points(character, pose)
        feet = [character.body(f"{side}_foot") for side in FEET]
        trunk = np.delete(lowest, feet).min()
        pose[2] -= trunk + 0.03
        motion = Motion(np.tile(pose, (40, 1)), FPS)
        quality = _measured(_response(motion, 5, 10, 20), character)
        assert quality.body_depth_m == pytest.approx(0.03, abs=1e-3)

    def test_only_what_comes_after_contact_counts(self, character: Character) -> None:
        poses = standing(character, 2.0).poses.copy()
        poses[:10, 2] -= 0.5
        quality = _measured(_response(Motion(poses, FPS), 10, 15, 25), character)
        assert quality.foot_depth_m < 0.01
        assert quality.body_depth_m == 0.0
        later = _measured(_response(Motion(poses, FPS), 9, 15, 25), character)
        assert later.body_depth_m > 0.1

    def test_skates_of_both_feet_are_summed(self, character: Character) -> None:
        poses = standing(character, 2.0).poses.copy()
        poses[:, 0] += np.arange(len(poses)) * 0.002
        motion = Motion(poses, FPS, contacts=np.ones((len(poses), 2), dtype=bool))
        quality = _measured(_response(motion, 11, 20, 30), character)
        distance = (len(poses) - 1 - 11) * 0.002
        assert quality.foot_skate_m == pytest.approx(2.0 * distance)
        assert quality.foot_skate_worst_m == pytest.approx(distance)

    def test_skates_in_the_blend(self, character: Character) -> None:
        poses = standing(character, 2.0).poses.copy()
        poses[:, 0] += np.cumsum(np.arange(len(poses)) > 24) * 0.002
        motion = Motion(poses, FPS, contacts=np.ones((len(poses), 2), dtype=bool))
        quality = _measured(_response(motion, 11, 20, 30), character)
        assert quality.foot_skate_blend_m == pytest.approx(2 * 6 * 0.002)

    @pytest.mark.parametrize(("seam", "name"), [(20, "exit"), (32, "end")])
    def test_a_kick_at_a_seam_is_found_there(
        self, character: Character, seam: int, name: str
    ) -> None:
        time = np.arange(61) / FPS
        swing = 0.2 * np.sin(2.0 * np.pi * time)
        calm = turned(character, {"left_elbow": np.outer(swing, [0.0, -1.0, 0.0])}, 61)
        kicked = np.outer(swing + 2.0 * np.maximum(time - time[seam], 0.0), [0.0, -1.0, 0.0])
        motion = Motion(turned(character, {"left_elbow": kicked}, 61), FPS)
        response = dataclasses.replace(
            _response(motion, 10, 20, 32), entered_motion=Motion(calm, FPS)
        )
        quality = _measured(response, character)
        at, other = quality.speed_step_exit, quality.speed_step_end
        if name == "end":
            at, other = other, at
        # The swing alone changes its speed by up to 0.26 rad/s a frame.
        assert at == pytest.approx(2.0, abs=0.3)
        assert other < 0.3
        reference = np.percentile(joint_speed_steps(Motion(calm, FPS)), 99.9)
        assert quality.speed_step_reference == pytest.approx(float(reference))
        assert quality.speed_step_ratio == pytest.approx(at / float(reference))

    def test_a_still_motion_has_the_least_reference(self, character: Character) -> None:
        quality = _measured(_response(standing(character), 10, 20, 30), character)
        assert quality.speed_step_reference == 0.1
        assert quality.speed_step_ratio == quality.speed_step_exit / 0.1

    def test_a_motion_without_faults_has_none(self, character: Character) -> None:
        poses = walking(character, 3.0).moved(0.0, (0.0, 0.0, 0.5)).poses
        quality = _measured(_response(Motion(poses, FPS), 10, 20, 30), character)
        assert quality.speed_step_ratio <= 1.0
        assert quality.root_jump_m == 0.0
        assert quality.root_shake_m < 0.005
        assert quality.foot_depth_m == quality.body_depth_m == quality.foot_skate_m == 0.0


def test_every_metric_is_explained() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "quality.md").read_text()
    for field in dataclasses.fields(Quality):
        assert f"`{field.name}`" in text
