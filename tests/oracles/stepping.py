"""One hit, simulated slowly and plainly: what `dynresp.physics.simulation` must equal bit by bit.

A loop of `mj_step` on one `MjData`. What hits is compiled into a model of its own; the first
contact is looked for in `MjData.contact` before every step; nothing is ever restored: to go back
to a frame is to simulate again from the start.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import mujoco
import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, POSE_SIZE, ROOT, ROOT_QUAT, VELOCITY_SIZE, Character
from dynresp.motion.motion import pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import WAIT_S, PreparedImpact
from dynresp.physics.scene import (
    HOLD_LEAD_S,
    IMPACTOR_PREFIX,
    PREFIX,
    STRIKE_LEAD_S,
    ImpactorKind,
    PhysicsConfig,
    Scene,
)
from dynresp.physics.servo import servo_gains
from dynresp.physics.trace import Setup
from dynresp.support import paths


@dataclass
class Stepped:
    """What the loop saw.

    Attributes:
        poses: One (59,) a frame.
        velocities: One (45,) a frame.
        impactor: One (7,) a frame; empty without impactor.
        contact_step: First step, counted from the start, before which there was contact.
        forces: Strongest contact force [N] on each body that is touched before that step.
        torques: Size of the 13 servos' torques [N m], one (13,) a step.
    """

    poses: list[FloatArray] = field(default_factory=list)
    velocities: list[FloatArray] = field(default_factory=list)
    impactor: list[FloatArray] = field(default_factory=list)
    contact_step: int | None = None
    forces: dict[str, float] = field(default_factory=dict)
    torques: list[FloatArray] = field(default_factory=list)


def compile_for(
    character: Character, impact: PreparedImpact, config: PhysicsConfig, folder: Path
) -> mujoco.MjModel:
    """The scene of one impact, with its ball written into the model's file.

    Args:
        character: The character.
        impact: What hits.
        config: The simulation's settings.
        folder: A folder for the changed model files.
    """
    for file in paths.models_folder().glob("*.xml"):
        (folder / file.name).write_text(file.read_text())
    if impact.kind is ImpactorKind.PROJECTILE:
        moment = 0.4 * impact.mass * impact.radius**2
        text = (folder / "ball.xml").read_text()
        for name, value in {
            "mass": repr(float(impact.mass)),
            "diaginertia": f"{moment!r} {moment!r} {moment!r}",
            "size": repr(float(impact.radius)),
            "gravcomp": "1" if impact.weightless else "0",
        }.items():
            text, found = re.subn(rf'\b{name}="[^"]*"', f'{name}="{value}"', text)
            assert found == 1, name
        (folder / "ball.xml").write_text(text)
    with mock.patch.object(paths, "models_folder", return_value=folder):
        return Scene(character, impact.kind, config).model


def row_at(rows: FloatArray, frame: int, ahead: float) -> FloatArray:
    """What stands some frames ahead of a frame, between two rows; the last row after the end."""
    whole = int(ahead)
    low = rows[min(frame + whole, len(rows) - 1)]
    high = rows[min(frame + whole + 1, len(rows) - 1)]
    return (1.0 - (ahead - whole)) * low + (ahead - whole) * high


class SlowSimulation:
    """One character and what hits it."""

    def __init__(
        self,
        character: Character,
        setup: Setup,
        config: PhysicsConfig,
        folder: Path,
        held: bool = True,
    ) -> None:
        """Compile the scene.

        Args:
            character: The character.
            setup: Base motion and impact.
            config: The simulation's settings.
            folder: A folder for model files.
            held: Whether the pelvis is held to the base motion until contact.
        """
        self.model = compile_for(character, setup.impact, config, folder)
        self.setup = setup
        self.config = config
        self.held = held
        self.probe = mujoco.MjData(self.model)
        self.leads = servo_gains(character).lead_s * config.fps

    @property
    def frames_until_miss(self) -> int:
        """Frames after which an impact that has touched nothing is given up."""
        return int(np.ceil((self.setup.impact.due_s + WAIT_S) * self.config.fps))

    def run(self, frames: int, then: FloatArray | None = None, length: int = 0) -> Stepped:
        """Track the base motion for some frames, and then other targets for some more.

        Args:
            frames: Frames in which the base motion is tracked.
            then: (n, 59) targets from that frame on.
            length: Frames in which they are tracked.
        """
        model, setup = self.model, self.setup
        data, seen = mujoco.MjData(model), Stepped()
        data.qpos[:POSE_SIZE] = setup.base[0]
        data.qvel[:VELOCITY_SIZE] = pose_velocities(setup.base[:2], self.config.fps)[0]
        if setup.impact.impactor_pose is not None:
            data.qpos[POSE_SIZE:] = setup.impact.impactor_pose
            data.qvel[VELOCITY_SIZE:] = setup.impact.impactor_velocity
        _see(data, seen)
        for frame in range(frames + length):
            for step in range(self.config.substeps):
                fraction = step / self.config.substeps
                if frame < frames or then is None:
                    self._track(data, setup.base, frame, fraction)
                else:
                    self._track(data, then, frame - frames, fraction)
                self._impact(data, frame + fraction)
                if seen.contact_step is None and self._is_hit(data, frame, step):
                    seen.contact_step = frame * self.config.substeps + step
                    seen.forces = self._contact_forces(data)
                hold = self.held and seen.contact_step is None
                data.eq_active[model.equality("hold").id] = hold
                mujoco.mj_step(model, data)
                seen.torques.append(np.linalg.norm(data.actuator_force.reshape(-1, 3), axis=1))
            _see(data, seen)
        return seen

    def _track(self, data: mujoco.MjData, rows: FloatArray, frame: int, fraction: float) -> None:
        """Servo targets, each joint's as far ahead of the frame as it needs, and the hold."""
        joints = rows[:, JOINTS].reshape(len(rows), -1, 4)
        for joint, lead in enumerate(self.leads):
            target = row_at(joints[:, joint], frame, fraction + lead)
            data.ctrl[4 * joint : 4 * joint + 4] = target
        hold = self.model.body("hold").mocapid[0]
        ahead = fraction + HOLD_LEAD_S * self.config.fps
        data.mocap_pos[hold] = row_at(rows[:, ROOT], frame, ahead)
        data.mocap_quat[hold] = rotations.normalize(row_at(rows[:, ROOT_QUAT], frame, ahead))

    def _impact(self, data: mujoco.MjData, at: float) -> None:
        """The push's force, and the place to which a striking arm is drawn."""
        impact = self.setup.impact
        data.xfrc_applied[:] = 0.0
        if impact.push_force is not None:
            phase = (at / self.config.fps - impact.push_start_s) / impact.push_duration_s
            if 0.0 <= phase <= 1.0:
                share = np.sin(np.pi * phase)
                data.xfrc_applied[impact.wrench_body + 1, :3] = share * impact.push_force
        if impact.strike_poses is not None:
            strike = self.model.body("strike").mocapid[0]
            ahead = at + STRIKE_LEAD_S * self.config.fps
            data.mocap_pos[strike] = row_at(impact.strike_poses[:, :3], 0, ahead)
            turn = row_at(impact.strike_poses[:, 3:], 0, ahead)
            data.mocap_quat[strike] = rotations.normalize(turn)

    def _is_hit(self, data: mujoco.MjData, frame: int, step: int) -> bool:
        """Whether the impact touches the character in the state before the next step."""
        impact, rate = self.setup.impact, self.config.fps * self.config.substeps
        if impact.push_force is not None:
            now = frame * self.config.substeps + step
            return now == round(impact.push_start_s * rate)
        return bool(self._contact_forces(data))

    def _contact_forces(self, data: mujoco.MjData) -> dict[str, float]:
        """Strongest force [N] between impactor and each of the character's bodies it touches."""
        model, probe, state = self.model, self.probe, mujoco.mjtState.mjSTATE_INTEGRATION
        numbers = np.empty(mujoco.mj_stateSize(model, state))
        mujoco.mj_getState(model, data, numbers, state)
        mujoco.mj_setState(model, probe, numbers, state)
        mujoco.mj_fwdPosition(model, probe)
        if not self._touched(probe):
            return {}
        mujoco.mj_forward(model, probe)
        found: dict[str, float] = {}
        for index, body in self._touched(probe):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, probe, index, wrench)
            found[body] = max(found.get(body, 0.0), float(np.linalg.norm(wrench[:3])))
        return found

    def _touched(self, data: mujoco.MjData) -> list[tuple[int, str]]:
        """Contacts between impactor and character, with the body's name."""
        touched = []
        for index, contact in enumerate(data.contact):
            ends = (self.model.body(self.model.geom_bodyid[geom]).name for geom in contact.geom)
            first, second = sorted(ends)
            if first.startswith(PREFIX) and second.startswith(IMPACTOR_PREFIX):
                touched.append((index, first.removeprefix(PREFIX)))
        return touched


def _see(data: mujoco.MjData, seen: Stepped) -> None:
    seen.poses.append(data.qpos[:POSE_SIZE].copy())
    seen.velocities.append(data.qvel[:VELOCITY_SIZE].copy())
    if data.qpos.size > POSE_SIZE:
        seen.impactor.append(data.qpos[POSE_SIZE:].copy())
