"""The servos: their gains, how they track, and how long they keep a character standing."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, ROOT, ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics import servo
from dynresp.physics.impacts import Ball, Push
from dynresp.physics.scene import PREFIX, ImpactorKind, PhysicsConfig
from dynresp.physics.servo import joint_inertias, servo_gains
from dynresp.physics.trace import Setup
from tests.oracles.stepping import SlowSimulation, Stepped
from tests.physics.conftest import SceneMaker
from tests.physics.samples import about_y, setups_of, standing, turned, walking


def _tracked(
    character: Character, config: PhysicsConfig, base: Motion, folder: Path, *, held: bool
) -> Stepped:
    """Track the base motion from beginning to end; the push never comes."""
    push = setups_of(character, base, [Push(0.0)], config)[0].impact
    prepared = replace(push, push_start_s=1e6)
    slow = SlowSimulation(character, Setup(base.poses, prepared), config, folder, held)
    return slow.run(len(base) - 1)


def _joint_errors(seen: Stepped, base: Motion) -> FloatArray:
    """Angle between every joint and its target [degrees], (frames, 13)."""
    poses = np.array(seen.poses)
    joints = poses[:, JOINTS].reshape(len(poses), -1, 4)
    errors: FloatArray = np.degrees(
        rotations.angle_between(joints, base.joint_quaternions[: len(poses)])
    )
    return errors


def _root_errors(seen: Stepped, base: Motion) -> tuple[FloatArray, FloatArray]:
    """How far the root is from its target [m] and [degrees], frame by frame."""
    poses = np.array(seen.poses)
    turns = rotations.angle_between(poses[:, ROOT_QUAT], base.root_quaternions[: len(poses)])
    return np.linalg.norm(poses[:, ROOT] - base.root_positions, axis=1), np.degrees(turns)


class TestGains:
    """Stiffness from inertia and frequency, with floors."""

    def test_inertia_is_what_mujocos_mass_matrix_says(self, character: Character) -> None:
        """The joint's own block of the joint-space inertia, without armature."""
        model, data = character.model, mujoco.MjData(character.model)
        mujoco.mj_forward(model, data)
        whole = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, whole)
        for joint, inertia in enumerate(joint_inertias(character)):
            at = slice(6 + 3 * joint, 9 + 3 * joint)
            block = whole[at, at] - np.diag(model.dof_armature[at])
            assert inertia == pytest.approx(np.linalg.eigvalsh(block)[-1], rel=1e-6)

    def test_left_and_right_are_alike(self, character: Character) -> None:
        gains = servo_gains(character)
        for i, name in enumerate(character.joint_names):
            j = character.joint_names.index(
                name.replace("left", "x").replace("right", "left").replace("x", "right")
            )
            for values in (gains.stiffness, gains.damping, gains.torque_limit):
                assert values[i] == pytest.approx(values[j], rel=1e-9)

    @pytest.mark.parametrize("frequency", [10.0, 40.0, 80.0])
    @pytest.mark.parametrize("ratio", [0.5, 1.0])
    def test_stiffness_is_inertia_times_frequency_squared_or_the_floor(
        self,
        character: Character,
        frequency: float,
        ratio: float,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(servo, "FREQUENCY", frequency)
        monkeypatch.setattr(servo, "DAMPING_RATIO", ratio)
        monkeypatch.setattr(servo, "STIFFNESS_FLOORS", {"elbow": 500.0})
        gains = servo_gains(character)
        moved = joint_inertias(character) + character.model.dof_armature[6::3]
        for joint, name in enumerate(character.joint_names):
            floor = 500.0 if name.endswith("elbow") else 0.0
            expected = max(moved[joint] * frequency**2, floor)
            assert gains.stiffness[joint] == pytest.approx(expected)
            critical = 2.0 * np.sqrt(expected * moved[joint])
            assert gains.damping[joint] == pytest.approx(ratio * critical)

    def test_the_model_has_them(self, scene_of: SceneMaker, character: Character) -> None:
        """Servo and joint together damp as much as the gains say."""
        scene = scene_of(ImpactorKind.NONE)
        gains = servo_gains(character)
        for i, name in enumerate(character.joint_names):
            motor, joint = scene.model.actuator(PREFIX + name), scene.model.joint(PREFIX + name)
            assert motor.gainprm[0] == pytest.approx(gains.stiffness[i])
            assert motor.biasprm[1] == pytest.approx(-gains.stiffness[i])
            np.testing.assert_allclose(joint.damping - motor.biasprm[2], gains.damping[i])
            assert motor.forcerange[1] == pytest.approx(gains.torque_limit[i])

    def test_controls_are_the_joint_part_of_a_pose(self, scene_of: SceneMaker) -> None:
        model = scene_of(ImpactorKind.NONE).model
        names = [model.actuator(i).name for i in range(model.na or len(model.actuator_trnid))]
        joints = [model.joint(i).name for i in range(1, model.njnt)]
        assert names[:13] == joints[:13]
        assert model.nu == JOINTS.stop - JOINTS.start


def test_the_documented_table_is_that_of_the_code(character: Character) -> None:
    gains, inertias = servo_gains(character), joint_inertias(character)
    rows = []
    for i, name in enumerate(character.joint_names):
        row = (
            f"| {name.split('_')[-1]} | {inertias[i]:.3f} | {gains.stiffness[i]:.0f} "
            f"| {gains.damping[i]:.1f} | {1e3 * gains.lead_s[i]:.0f} "
            f"| {gains.torque_limit[i]:.0f} |"
        )
        if row not in rows:
            rows.append(row)
    text = (Path(__file__).resolve().parents[2] / "docs" / "physics.md").read_text()
    table = "\n".join(rows)
    assert table in text, f"the table in docs/physics.md should be\n{table}"


def test_the_servo_pulls_in_the_shortest_direction(
    character: Character, scene_of: SceneMaker, rng: np.random.Generator
) -> None:
    """Torque kp log(q^-1 q_target) in the child's frame, at rest and below its limit."""
    model = scene_of(ImpactorKind.NONE).model
    data = mujoco.MjData(model)
    gains = servo_gains(character)
    limit = (0.9 * gains.torque_limit / gains.stiffness)[:, None]
    direction = rng.normal(size=(13, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    at = rotations.from_rotation_vector(0.3 * rng.normal(size=(13, 3)))
    to = rotations.multiply(at, rotations.from_rotation_vector(limit * direction))
    data.qpos[:59] = character.rest_pose
    data.qpos[JOINTS] = at.ravel()
    for sign in (1.0, -1.0, 7.0):  # a rotation has two signs, and any length will do
        data.ctrl[:] = sign * to.ravel()
        mujoco.mj_forward(model, data)
        expected = gains.stiffness[:, None] * limit * direction
        np.testing.assert_allclose(data.qfrc_actuator[6:45].reshape(13, 3), expected, atol=1e-6)


def test_torque_limits_are_kept(
    character: Character, config: PhysicsConfig, tmp_path: Path
) -> None:
    """Targets that jump need far more torque than the limits allow."""
    poses = turned(character, {}, 31)
    rng = np.random.default_rng(3)
    poses[5:, JOINTS] = rotations.from_rotation_vector(rng.normal(size=(26, 13, 3))).reshape(26, -1)
    base = Motion(poses, config.fps, "jumping")
    seen = _tracked(character, config, base, tmp_path, held=True)
    limits = servo_gains(character).torque_limit
    torques = np.array(seen.torques)
    assert (torques <= limits * (1.0 + 1e-9)).all()
    assert (torques.max(axis=0) > 0.99 * limits).all()


class TestTracking:
    """How close the held character stays to its targets."""

    def test_standing(self, character: Character, config: PhysicsConfig, tmp_path: Path) -> None:
        base = standing(character, 2.0)
        seen = _tracked(character, config, base, tmp_path, held=True)
        place, turn = _root_errors(seen, base)
        assert place.max() < 0.01
        assert turn.max() < 1.0
        assert _joint_errors(seen, base).max() < 2.0

    @pytest.mark.parametrize("height", [0.0, 0.3], ids=["on the floor", "in the air"])
    def test_walking_for_ten_seconds(
        self, character: Character, config: PhysicsConfig, tmp_path: Path, height: float
    ) -> None:
        base = walking(character, 10.0).moved(0.0, (0.0, 0.0, height))
        seen = _tracked(character, config, base, tmp_path, held=True)
        place, turn = _root_errors(seen, base)
        errors = _joint_errors(seen, base)
        assert place.max() < 0.03
        assert turn.max() < 5.0
        # The synthetic walk slides its feet, which the floor resists.
        assert np.percentile(errors, 95) < (8.0 if height == 0.0 else 2.0)
        assert errors.max() < (30.0 if height == 0.0 else 4.0)
        # The end is as good as the beginning.
        third = len(errors) // 3
        assert errors[-third:].mean() < 1.2 * errors[third : 2 * third].mean() + 0.1

    def test_the_lead_cancels_the_lag(
        self, character: Character, config: PhysicsConfig, tmp_path: Path
    ) -> None:
        """A steady swing in the air is tracked without delay, whatever its speed."""
        time = np.arange(61) / 30.0
        for rate in (1.0, 3.0):
            swing = about_y(np.minimum(rate * time, 1.3))
            poses = turned(character, {"left_shoulder": -swing, "right_hip": -swing}, 61)
            base = Motion(poses, 30.0, "swing").moved(0.0, (0.0, 0.0, 3.0))
            errors = _joint_errors(_tracked(character, config, base, tmp_path, held=True), base)
            steady = (time > 0.15) & (rate * time < 1.1)
            for name in ("left_shoulder", "right_hip"):
                assert errors[steady, character.joint(name)].max() < 2.0

    def test_does_not_oscillate(
        self, character: Character, config: PhysicsConfig, tmp_path: Path
    ) -> None:
        """Held still, nothing turns, not even the light feet."""
        base = standing(character, 3.0)
        for lift in (0.0, 1.0):
            moved = base.moved(0.0, (0.0, 0.0, lift))
            seen = _tracked(character, config, moved, tmp_path, held=True)
            late = np.array(seen.velocities)[60:]
            assert np.abs(late[:, 6:]).max() < 0.02

    def test_after_a_hard_hit_no_joint_oscillates(
        self, character: Character, config: PhysicsConfig, tmp_path: Path
    ) -> None:
        """A second after the hit, in the air, all joints are at their targets."""
        base = standing(character, 4.0).moved(0.0, (0.0, 0.0, 20.0))
        ball = Ball(1.0, speed=14.0, mass=8.0, target="head", from_deg=60.0)
        setup = setups_of(character, base, [ball], config)[0]
        seen = SlowSimulation(character, setup, config, tmp_path).run(50)
        assert seen.contact_step is not None
        speeds = np.linalg.norm(np.array(seen.velocities)[:, 6:].reshape(-1, 13, 3), axis=2)
        assert speeds.max() > 3.0
        assert speeds[-10:].max() < 0.5


def test_stands_for_half_a_second_without_being_held(
    character: Character, config: PhysicsConfig, tmp_path: Path
) -> None:
    """Servos alone do not balance for long; a look-ahead needs half a second."""
    base = standing(character, 1.0)
    seen = _tracked(character, config, base, tmp_path, held=False)
    place, turn = _root_errors(seen, base)
    assert turn[:16].max() < 5.0
    assert place[:16].max() < 0.03
    assert _joint_errors(seen, base)[:16].max() < 5.0
