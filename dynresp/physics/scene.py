"""The world in which a hit is simulated: floor, character with servos, and what hits it.

It is composed with MjSpec from the files in `models/`. The character comes first, so the first 59
numbers of `qpos` and the first 45 of `qvel` are its pose and velocity, and the first 52 controls
are the joint part of the pose that the servos track.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import mujoco
import numpy as np

from dynresp.motion.character import Character
from dynresp.physics.servo import add_servos
from dynresp.support import paths
from dynresp.support.checks import check_number

PREFIX = "character/"
IMPACTOR_PREFIX = "impactor/"
# Stiffness of the weld that holds the pelvis to the base motion: time constant [s], damping ratio.
_HOLD_SOLREF = (0.01, 1.0)
# The weld that draws a striking arm along its recorded path is softer, like a shoulder.
_STRIKE_SOLREF = (0.012, 1.0)
# A weld damps the speed relative to its target, which MuJoCo takes to stand still. Targets are read
# this much ahead [s], which cancels the lag. From solref, damping over stiffness is
# 2 x time constant x ratio^2.
HOLD_LEAD_S = 2.0 * _HOLD_SOLREF[0] * _HOLD_SOLREF[1] ** 2
STRIKE_LEAD_S = 2.0 * _STRIKE_SOLREF[0] * _STRIKE_SOLREF[1] ** 2


class ImpactorKind(Enum):
    """What a scene contains besides the character."""

    NONE = "none"
    """Nothing; pushes are forces."""
    PROJECTILE = "projectile"
    """A sphere of any mass and size: a ball, or a fist."""
    STRIKER = "striker"
    """The forearm and fist of a second character."""


@dataclass(frozen=True)
class PhysicsConfig:
    """Settings of the simulation.

    Attributes:
        fps: Frames a second [1/s], 1 to 1000: the rate of base motions, targets and results.
        substeps: Steps of the simulation in each frame, 1 to 1000. With MuJoCo's `discrete`
            integrator 8 steps at 30 fps (4.2 ms) come as close to the limit of small steps as 16
            with `implicitfast`, in 0.6 of the time.

    Raises:
        UsageError: A number is out of its range.
    """

    fps: float = 30.0
    substeps: int = 8

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_number("fps", self.fps, 1.0, 1000.0)
        check_number("substeps", self.substeps, 1, 1000, whole=True)

    @property
    def timestep(self) -> float:
        """Length of a step of the simulation [s]."""
        return 1.0 / (self.fps * self.substeps)


class Scene:
    """A compiled world.

    Attributes:
        model: The MuJoCo model.
        character: The character in it.
        kind: What it contains besides the character.
        config: Settings of the simulation.
        hold_mocap: Index of the mocap body that holds the pelvis.
        strike_mocap: Index of the mocap body that draws a striking arm; None without a strike.
        hold_weld: Index of the equality that holds the pelvis.
        contact_bodies: Names of the character's bodies in the order of the contact sensors.
    """

    def __init__(self, character: Character, kind: ImpactorKind, config: PhysicsConfig) -> None:
        """Compose and compile the world."""
        self.character = character
        self.kind = kind
        self.config = config
        self.contact_bodies = character.body_names
        self.model = self._compose().compile()
        self.hold_mocap = int(self.model.body("hold").mocapid[0])
        strikes = kind is ImpactorKind.STRIKER
        self.strike_mocap = int(self.model.body("strike").mocapid[0]) if strikes else None
        self.hold_weld = self.model.equality("hold").id

    def _compose(self) -> mujoco.MjSpec:
        folder = paths.models_folder()
        spec = mujoco.MjSpec.from_file(str(folder / "scene.xml"))
        spec.option.timestep = self.config.timestep
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        ragdoll = mujoco.MjSpec.from_file(str(self.character.file))
        spec.attach(ragdoll, prefix=PREFIX, frame=spec.worldbody.add_frame())
        add_servos(spec, self.character, PREFIX)
        spec.worldbody.add_body(name="hold", mocap=True)
        self._weld(spec, "hold", f"{PREFIX}pelvis", _HOLD_SOLREF)
        if self.kind is ImpactorKind.PROJECTILE:
            self._attach(spec, "ball")
            self._add_contact_sensors(spec, "ball")
        elif self.kind is ImpactorKind.STRIKER:
            self._attach(spec, "striker")
            spec.worldbody.add_body(name="strike", mocap=True)
            self._weld(spec, "strike", f"{IMPACTOR_PREFIX}striker", _STRIKE_SOLREF)
            self._add_contact_sensors(spec, "striker")
        return spec

    @staticmethod
    def _attach(spec: mujoco.MjSpec, name: str) -> None:
        other = mujoco.MjSpec.from_file(str(paths.models_folder() / f"{name}.xml"))
        spec.attach(other, prefix=IMPACTOR_PREFIX, frame=spec.worldbody.add_frame())

    @staticmethod
    def _weld(spec: mujoco.MjSpec, target: str, body: str, solref: tuple[float, float]) -> None:
        """Weld a body to a mocap body so that their frames coincide."""
        weld = spec.add_equality(
            name=target,
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=target,
            name2=body,
            solref=solref,
        )
        # Anchor (3), relative position (3) and quaternion (4), torque scale.
        data = np.zeros(mujoco.mjNEQDATA)
        data[6] = data[10] = 1.0
        weld.data = data

    def _add_contact_sensors(self, spec: mujoco.MjSpec, impactor: str) -> None:
        """Add a sensor for each body: whether the impactor touches it, its force [N], and where."""
        fields = (
            mujoco.mjtConDataField.mjCONDATA_FOUND,
            mujoco.mjtConDataField.mjCONDATA_FORCE,
            mujoco.mjtConDataField.mjCONDATA_POS,
        )
        bits = sum(1 << int(x) for x in fields)
        strongest = 2
        for body in self.contact_bodies:
            spec.add_sensor(
                name=f"hit/{body}",
                type=mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                objname=IMPACTOR_PREFIX + impactor,
                reftype=mujoco.mjtObj.mjOBJ_BODY,
                refname=PREFIX + body,
                intprm=[bits, strongest, 1],
            )
