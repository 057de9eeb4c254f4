"""The servos: one orientation servo for each ball joint; gains follow from the inertia it moves.

MuJoCo's orientation servo applies the torque kp log(q^-1 q_target) - kv omega in the child's frame
and takes the target as a quaternion, so a row of controls is the joint part of a pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray

FREQUENCY = 40.0
"""Natural frequency [rad/s]; stiffness is the inertia felt times its square (Zordan et al. 2007,
section 6.1: inertia-scaled PD servos)."""

DAMPING_RATIO = 1.0
"""1 is critical damping."""

STIFFNESS_FLOORS: Mapping[str, float] = MappingProxyType({"knee": 2000.0, "ankle": 700.0})
"""Least stiffness [N m/rad] by joint without its side. What knees and ankles move is light, but
they carry the body. Both ankles together must exceed its weight times the height of its centre of
mass (73 kg x 9.81 m/s2 x 0.9 m = 640 N m/rad), or it topples like a pole. If a bent knee gives way,
the toe of the other foot hits the ground."""

TORQUE_LIMITS: Mapping[str, float] = MappingProxyType(
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
"""Largest torque [N m] by joint without its side: about one and a half times that of a strong man,
since a servo stands for the muscles on both sides of a joint."""

# Part of the damping that belongs to the joint itself. MuJoCo integrates a joint's own damping
# implicitly, but a saturated servo's explicitly. A servo with more than twice the damping of the
# joint can then make a light rotation oscillate, such as that of a thigh about its own axis.
_PASSIVE_SHARE = 1.0 / 3.0


def servo_settings() -> dict[str, Any]:
    """The constants above as `result.json`, manifests and classifiers record them."""
    return {
        "frequency": FREQUENCY,
        "damping_ratio": DAMPING_RATIO,
        "stiffness_floors": dict(STIFFNESS_FLOORS),
        "torque_limits": dict(TORQUE_LIMITS),
    }


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

        Damping acts against all movement. In a steady movement a target from this much later
        cancels the lag that the damping would cause.
        """
        return self.damping / self.stiffness


def servo_gains(character: Character) -> ServoGains:
    """Gains for a character: stiffness from inertia and frequency, damping from the ratio.

    The damping follows from the inertia that the joint moves, also where a floor has raised the
    stiffness.
    """
    inertia = joint_inertias(character) + character.model.dof_armature[6::3]
    kinds = [name.split("_")[-1] for name in character.joint_names]
    floors = np.array([STIFFNESS_FLOORS.get(kind, 0.0) for kind in kinds])
    stiffness = np.maximum(inertia * FREQUENCY**2, floors)
    damping = 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)
    return ServoGains(stiffness, damping, np.array([TORQUE_LIMITS[kind] for kind in kinds]))


def joint_inertias(character: Character) -> FloatArray:
    """Inertia that each joint moves, in the rest pose.

    Returns:
        (13,) largest principal moment [kg m2], about the joint, of all bodies that hang from it.
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


def add_servos(spec: mujoco.MjSpec, character: Character, prefix: str) -> None:
    """Add a servo for each ball joint to a model under construction.

    Args:
        spec: The model; its joints are named prefix + joint name.
        character: The character; its inertias scale the gains.
        prefix: Put before the names of joints and servos.
    """
    gains = servo_gains(character)
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
