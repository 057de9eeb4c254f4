"""Packs what acts on a simulation in each step: servo targets, push forces, targets of welds.

`mujoco.batch.Batch.rollout` sets one row before every step.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, ROOT, ROOT_QUAT
from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import PreparedImpact, push_profile
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
        read_ahead: How many frames of its targets a frame needs, itself included.
    """

    def __init__(self, scene: Scene) -> None:
        """Find the columns of a row, and the time at which each target is read."""
        self.spec = int(sum(int(part) for part in _PARTS))
        self._fps = scene.config.fps
        self._substeps = scene.config.substeps
        columns, start = [], 0
        for part in _PARTS:
            size = mujoco.mj_stateSize(scene.model, int(part))
            columns.append(slice(start, start + size))
            start += size
        self._size = start
        self._servos, self._wrenches, self._welds, self._positions, self._turns = columns
        self.hold = self._welds.start + scene.hold_weld
        self._hold_target = self._target(scene.hold_mocap)
        self._strike_target = self._target(scene.strike_mocap or 0)
        self._steps = np.arange(self._substeps) / self._substeps
        # Fractional frames at which targets are read, counted from a whole frame: the same for all
        # simulations.
        lead = servo_gains(scene.character).lead_s * self._fps
        self._joints_at = self._steps[:, None] + lead
        self._hold_at = self._steps + HOLD_LEAD_S * self._fps
        latest = max(self._joints_at.max(), self._hold_at.max())
        self.read_ahead = int(np.floor(latest)) + 2

    def _target(self, mocap: int) -> tuple[slice, slice]:
        """Columns of the position and the orientation of a mocap body."""
        first, turn = self._positions.start + 3 * mocap, self._turns.start + 4 * mocap
        return slice(first, first + 3), slice(turn, turn + 4)

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
            frames: The present frame of each, counted from its start.
            targets: For each, (frames, 59) poses to track; after the last, the last holds.
            target_frames: The present frame of each in its targets.
            held: Whether each pelvis is held to its target.

        Returns:
            (simulations, substeps, size of a row).
        """
        controls = np.zeros((len(impacts), self._substeps, self._size))
        controls[..., self._welds] = 1.0
        controls[..., self.hold] = np.asarray(held, dtype=np.float64)[:, None]
        near = np.stack(
            [
                target[np.minimum(at + np.arange(self.read_ahead), len(target) - 1)]
                for target, at in zip(targets, target_frames, strict=True)
            ]
        )
        # The servo normalises its target, so linear interpolation between poses is enough.
        joints = near[..., JOINTS].reshape(*near.shape[:2], -1, 4)
        controls[..., self._servos] = between(joints, self._joints_at).reshape(
            len(near), self._substeps, -1
        )
        position, turn = self._hold_target
        controls[..., position] = between(near[..., ROOT], self._hold_at)
        controls[..., turn] = rotations.normalize(between(near[..., ROOT_QUAT], self._hold_at))
        for row, impact, frame in zip(controls, impacts, frames, strict=True):
            self._hit(row, impact, frame + self._steps)
        return controls

    def _hit(self, row: FloatArray, impact: PreparedImpact, at: FloatArray) -> None:
        """The force of a push, or the path of a striking arm, at fractional frames."""
        if impact.push_force is not None:
            share = push_profile(at / self._fps, impact.push_start_s, impact.push_duration_s)
            column = self._wrenches.start + 6 * (impact.wrench_body + 1)
            row[:, column : column + 3] = share[:, None] * impact.push_force
        if impact.strike_poses is not None:
            drawn = at + STRIKE_LEAD_S * self._fps
            pose = between(impact.strike_poses[None], drawn)[0]
            position, turn = self._strike_target
            row[:, position] = pose[:, :3]
            row[:, turn] = rotations.normalize(pose[:, 3:])


def between(rows: FloatArray, at: FloatArray) -> FloatArray:
    """Rows at fractional indices, by linear interpolation; the last row holds after the end.

    Args:
        rows: (simulations, frames, n), or (simulations, frames, joints, n) if each joint is read
            at its own times.
        at: (steps,), or (steps, joints).

    Returns:
        (simulations, steps, n), or (simulations, steps, joints, n).
    """
    last = rows.shape[1] - 1
    at = np.minimum(at, float(last))
    low = np.minimum(at.astype(np.intp), max(last - 1, 0))
    high = np.minimum(low + 1, last)
    weight = (at - low)[..., None]
    if at.ndim == 1:
        return (1.0 - weight) * rows[:, low] + weight * rows[:, high]
    joint = np.arange(at.shape[1])
    return (1.0 - weight) * rows[:, low, joint] + weight * rows[:, high, joint]
