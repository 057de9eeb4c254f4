"""The servos: one orientation servo a ball joint, its gains scaled by the inertia it moves.

MuJoCo's orientation servo applies the torque kp log(q^-1 q_target) - kv omega in the child's frame
and takes the target as a quaternion, so a row of controls is the joint part of a pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import mujoco
import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError


def _torque_limits() -> Mapping[str, float]:
    return MappingProxyType(
        {
            "waist": 400.0,
            "back": 300.0,
            "neck": 60.0,
            "shoulder": 120.0,
            "elbow": 90.0,
            "hip": 350.0,
            "knee": 300.0,
            "ankle": 220.0,
        }
    )


def _stiffness_floors() -> Mapping[str, float]:
    return MappingProxyType({"knee": 2000.0, "ankle": 700.0})


# Part of the damping that the joint has by itself. MuJoCo integrates a joint's own damping
# implicitly but a saturated servo's explicitly; a servo that damps more than twice what the joint
# does can then drive a light turn, such as a thigh's about its own axis, to and fro.
_PASSIVE_SHARE = 1.0 / 3.0


@dataclass(frozen=True)
class ServoConfig:
    """Gains of the tracking servos, all in one place.

    Attributes:
        frequency: Natural frequency [rad/s]; stiffness is the inertia felt times its square
            (Zordan et al. 2007, section 6.1: inertia-scaled PD servos).
        damping_ratio: 1 is critical.
        stiffness_floors: Least stiffness [N m/rad] by joint without its side. What knees and ankles
            move is light, but they carry the body. Two ankles must together exceed its weight
            times the height of its centre of mass (73 kg x 9.81 m/s2 x 0.9 m = 640 N m/rad), or
            it topples as a pole would; a bent knee that gives lets the other foot stub its toe.
        torque_limits: Largest torque [N m] by joint without its side: about what a strong man
            musters, with half as much again, since the servos stand for both sides of a joint.
    """

    frequency: float = 40.0
    damping_ratio: float = 1.0
    stiffness_floors: Mapping[str, float] = field(default_factory=_stiffness_floors)
    torque_limits: Mapping[str, float] = field(default_factory=_torque_limits)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is not positive, or a joint has no torque limit.
        """
        for name in ("frequency", "damping_ratio"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise UsageError(f"{name} must be above 0, got {getattr(self, name)}")
        missing = sorted(set(_torque_limits()) - set(self.torque_limits))
        if missing:
            raise UsageError(f"torque_limits must name every joint; missing: {', '.join(missing)}")


@dataclass(frozen=True)
class ServoGains:
    """Gains of all servos, in the order of the joints.

    Attributes:
        stiffness: (13,) kp [N m/rad].
        damping: (13,) kv [N m s/rad], the joint's own damping included.
        torque_limit: (13,) [N m].
    """

    stiffness: FloatArray
    damping: FloatArray
    torque_limit: FloatArray

    @property
    def lead_s(self) -> FloatArray:
        """How far ahead (13,) [s] each target must be read: kv / kp.

        The damping acts towards standing still; a target that is this much later cancels the lag
        it would cause in a steady movement.
        """
        return self.damping / self.stiffness


def servo_gains(character: Character, config: ServoConfig) -> ServoGains:
    """Gains for a character: stiffness from inertia and frequency, damping from the ratio.

    The damping is that of the inertia which the joint itself moves, also where a floor has raised
    the stiffness.
    """
    inertia = joint_inertias(character) + character.model.dof_armature[6::3]
    kinds = [name.split("_")[-1] for name in character.joint_names]
    floors = np.array([config.stiffness_floors.get(kind, 0.0) for kind in kinds])
    stiffness = np.maximum(inertia * config.frequency**2, floors)
    damping = 2.0 * config.damping_ratio * np.sqrt(stiffness * inertia)
    return ServoGains(stiffness, damping, np.array([config.torque_limits[kind] for kind in kinds]))


def joint_inertias(character: Character) -> FloatArray:
    """Inertia felt at each joint in the rest pose.

    Returns:
        (13,) largest principal moment [kg m2] of all that hangs from the joint, about the joint.
    """
    data = mujoco.MjData(character.model)
    mujoco.mj_forward(character.model, data)
    inertias = np.empty(len(character.joint_names))
    for joint in range(len(inertias)):
        body = joint + 1
        origin = data.xpos[body + 1]
        total = np.zeros((3, 3))
        for other in range(body, len(character.body_names)):
            if not _hangs_from(character, other, body):
                continue
            axes = data.ximat[other + 1].reshape(3, 3)
            arm = data.xipos[other + 1] - origin
            mass = character.masses[other]
            total += axes @ np.diag(character.model.body_inertia[other + 1]) @ axes.T
            total += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        inertias[joint] = np.linalg.eigvalsh(total)[-1]
    return inertias


def _hangs_from(character: Character, body: int, ancestor: int) -> bool:
    while body > ancestor:
        body = int(character.parents[body])
    return body == ancestor


def add_servos(spec: mujoco.MjSpec, character: Character, config: ServoConfig, prefix: str) -> None:
    """Add a servo for each ball joint to a model under construction.

    Args:
        spec: The model; its joints are named prefix + joint name.
        character: The character whose inertias scale the gains.
        config: Frequency, damping, floors and limits.
        prefix: Put before the names of joints and servos.
    """
    gains = servo_gains(character, config)
    for i, name in enumerate(character.joint_names):
        servo = spec.add_actuator(
            name=prefix + name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=prefix + name
        )
        servo.set_to_orientation(
            kp=gains.stiffness[i],
            kv=(1.0 - _PASSIVE_SHARE) * gains.damping[i],
            ctrlspec=mujoco.mjtCtrlChart.mjCHART_QUAT,
        )
        servo.forcerange = (0.0, gains.torque_limit[i])
        servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        spec.joint(prefix + name).damping[0] = _PASSIVE_SHARE * gains.damping[i]
