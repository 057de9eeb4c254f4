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
    return MappingProxyType({"knee": 300.0, "ankle": 300.0})


@dataclass(frozen=True)
class ServoConfig:
    """Gains of the tracking servos, all in one place.

    Attributes:
        frequency: Natural frequency [rad/s]; stiffness is the inertia felt times its square
            (Zordan et al. 2007, section 6.1: inertia-scaled PD servos).
        damping_ratio: 1 is critical.
        stiffness_floors: Least stiffness [N m/rad] by joint without its side. What a knee or an
            ankle moves is light, but they also carry the body: with less, the feet fold.
        torque_limits: Largest torque [N m] by joint without its side: about what a strong man
            musters, with half as much again, since the servos stand for both sides of a joint.
    """

    frequency: float = 40.0
    damping_ratio: float = 1.0
    stiffness_floors: Mapping[str, float] = field(default_factory=_stiffness_floors)
    torque_limits: Mapping[str, float] = field(default_factory=_torque_limits)

    @property
    def lead_s(self) -> float:
        """How far ahead [s] the target must be read: kv / kp.

        The damping acts towards standing still; a target that is this much later cancels the lag
        it would cause in a steady movement.
        """
        return 2.0 * self.damping_ratio / self.frequency


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


def add_servos(
    spec: mujoco.MjSpec, character: Character, config: ServoConfig, prefix: str
) -> None:
    """Add a servo for each ball joint to a model under construction.

    Args:
        spec: The model; its joints are named prefix + joint name.
        character: The character whose inertias scale the gains.
        config: Frequency, damping, floors and limits.
        prefix: Put before the names of joints and servos.
    """
    for name, inertia in zip(character.joint_names, joint_inertias(character), strict=True):
        kind = name.split("_")[-1]
        stiffness = max(inertia * config.frequency**2, config.stiffness_floors.get(kind, 0.0))
        servo = spec.add_actuator(
            name=prefix + name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=prefix + name
        )
        servo.set_to_orientation(
            kp=stiffness, kv=stiffness * config.lead_s, ctrlspec=mujoco.mjtCtrlChart.mjCHART_QUAT
        )
        servo.forcerange = (0.0, config.torque_limits[kind])
        servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
