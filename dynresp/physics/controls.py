"""What acts on a simulation from step to step: servo targets, forces, and what holds or draws.

Packed into the rows that `mujoco.batch.Batch.rollout` sets before every step.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, ROOT, ROOT_QUAT
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import PreparedImpact, push_profile
from dynresp.physics.scene import HOLD_LEAD_S, STRIKE_LEAD_S, Scene
from dynresp.physics.servo import servo_gains

_STATE = mujoco.mjtState
# In the order in which MuJoCo packs them.
_PARTS = (
    _STATE.mjSTATE_CTRL,
    _STATE.mjSTATE_XFRC_APPLIED,
    _STATE.mjSTATE_EQ_ACTIVE,
    _STATE.mjSTATE_MOCAP_POS,
    _STATE.mjSTATE_MOCAP_QUAT,
)


class Controls:
    """Rows of controls for one scene.

    Attributes:
        spec: The parts of MuJoCo's state that a row holds (bits of mjtState).
        hold: Column that says whether the pelvis is held to its target, 1 or 0.
    """

    def __init__(self, scene: Scene) -> None:
        """Find out where everything lies in a row."""
        self.spec = int(sum(int(part) for part in _PARTS))
        self._fps = scene.config.fps
        self._substeps = scene.config.substeps
        self._lead = servo_gains(scene.character, scene.config.servo).lead_s * self._fps
        columns, start = [], 0
        for part in _PARTS:
            size = mujoco.mj_stateSize(scene.model, int(part))
            columns.append(slice(start, start + size))
            start += size
        self._size = start
        self._servos, self._wrenches, self._welds, self._places, self._turns = columns
        self.hold = self._welds.start + scene.hold_weld

    def pack(
        self,
        impacts: Sequence[PreparedImpact],
        frames: Sequence[int],
        targets: Sequence[FloatArray],
        target_frames: Sequence[int],
        held: npt.ArrayLike,
    ) -> FloatArray:
        """Controls for the steps of one frame.

        Args:
            impacts: What hits in each simulation.
            frames: The frame that each is in, counted from its start.
            targets: For each, (frames, 59) poses to track; after the last, the last holds.
            target_frames: Where each is in its targets.
            held: Whether each pelvis is held to its target.

        Returns:
            (simulations, substeps, size of a row).
        """
        controls = np.zeros((len(impacts), self._substeps, self._size))
        controls[..., self._welds] = 1.0
        controls[..., self.hold] = np.asarray(held, dtype=np.float64)[:, None]
        steps = np.arange(self._substeps) / self._substeps
        for i, (target, at) in enumerate(zip(targets, target_frames, strict=True)):
            self._track(controls[i], target, at + steps)
        for row, impact, frame in zip(controls, impacts, frames, strict=True):
            self._hit(row, impact, frame + steps)
        return controls

    def _track(self, row: FloatArray, target: FloatArray, at: FloatArray) -> None:
        """Servo targets and where the pelvis is held, at fractional frames of the target."""
        joints = target[:, JOINTS].reshape(len(target), -1, 4)
        # The servo normalises its target, so a straight line between two poses will do.
        row[:, self._servos] = between(joints, at[:, None] + self._lead).reshape(len(at), -1)
        held = at + HOLD_LEAD_S * self._fps
        row[:, self._places.start : self._places.start + 3] = between(target[:, ROOT], held)
        turn = rotations.normalize(between(target[:, ROOT_QUAT], held))
        row[:, self._turns.start : self._turns.start + 4] = turn

    def _hit(self, row: FloatArray, impact: PreparedImpact, at: FloatArray) -> None:
        """The force of a push, or the path of a striking arm, at fractional frames."""
        if impact.push_force is not None:
            share = push_profile(at / self._fps, impact.push_start_s, impact.push_duration_s)
            column = self._wrenches.start + 6 * (impact.wrench_body + 1)
            row[:, column : column + 3] = share[:, None] * impact.push_force
        if impact.strike_poses is not None:
            drawn = at + STRIKE_LEAD_S * self._fps
            pose = between(impact.strike_poses, drawn)
            row[:, self._places.start + 3 : self._places.start + 6] = pose[:, :3]
            turn = rotations.normalize(pose[:, 3:])
            row[:, self._turns.start + 4 : self._turns.start + 8] = turn


def between(rows: FloatArray, at: FloatArray) -> FloatArray:
    """Rows at fractional indices, along straight lines; the last row holds after the end.

    Args:
        rows: (frames, n), or (frames, joints, n) where each joint is read at times of its own.
        at: (steps,), or (steps, joints).

    Returns:
        (steps, n) or (steps, joints, n).
    """
    at = np.minimum(at, len(rows) - 1.0)
    low = np.minimum(at.astype(np.intp), max(len(rows) - 2, 0))
    high = np.minimum(low + 1, len(rows) - 1)
    weight = (at - low)[..., None]
    if at.ndim == 1:
        return (1.0 - weight) * rows[low] + weight * rows[high]
    joint = np.arange(at.shape[1])
    return (1.0 - weight) * rows[low, joint] + weight * rows[high, joint]
