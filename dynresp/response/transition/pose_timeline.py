"""What a character is to show: poses laid one after the other on its clock."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray


@dataclass(frozen=True, eq=False)
class Stretch:
    """Poses that follow each other, and where they are put.

    Attributes:
        first: When the first of them is due.
        poses: (frames, 59) as they were given.
        turn: They are turned by it about the world's vertical [rad],
        shift: and then shifted (3,) [m].
    """

    first: int
    poses: FloatArray
    turn: float
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class Plan:
    """Stretches of poses, each until the next begins; where one is too short its last pose holds.

    Poses are kept as they were given and moved when they are read, so that to change a plan costs
    the same however long it is.

    Attributes:
        stretches: In the order of their first frames; at least one.
    """

    stretches: tuple[Stretch, ...]

    @classmethod
    def of(cls, poses: FloatArray, first: int) -> Plan:
        """Poses (frames, 59), the first of them due at a frame."""
        return cls((Stretch(first, poses, 0.0, np.zeros(3)),))

    @property
    def end(self) -> int:
        """One past the last frame for which there is a pose; from there on the last one holds."""
        return self.stretches[-1].first + len(self.stretches[-1].poses)

    def read(self, first: int, frames: int) -> FloatArray:
        """(frames, 59) what is due from a frame on; before the first pose, the first holds."""
        out = []
        stop = first + frames
        ends = [stretch.first for stretch in self.stretches[1:]]
        for k, (stretch, end) in enumerate(zip(self.stretches, [*ends, stop], strict=True)):
            begin = first if k == 0 else max(first, stretch.first)
            at = np.arange(begin, min(end, stop)) - stretch.first
            if not len(at):
                continue
            poses = stretch.poses[np.clip(at, 0, len(stretch.poses) - 1)]
            if stretch.turn or stretch.shift.any():
                poses = move_poses(poses, stretch.turn, stretch.shift)
            out.append(poses)
        return np.concatenate(out)

    def laid(self, poses: FloatArray, first: int) -> Plan:
        """The plan with poses (frames, 59) in place of all that was due from a frame on."""
        return Plan((*self._before(first), *Plan.of(poses, first).stretches))

    def patched(self, poses: FloatArray, first: int) -> Plan:
        """The plan with poses (frames, 59) from a frame on, and then as it was."""
        rest = self.since(first + len(poses)).stretches
        return Plan((*self.laid(poses, first).stretches, *rest))

    def since(self, frame: int) -> Plan:
        """The plan without what was due before a frame."""
        at = len(self._before(frame + 1)) - 1
        if at < 0:
            return self
        stretch = self.stretches[at]
        gone = min(frame - stretch.first, len(stretch.poses) - 1)
        cut = replace(stretch, first=frame, poses=stretch.poses[gone:])
        return Plan((cut, *self.stretches[at + 1 :]))

    def moved(self, later: int, turn: float, shift: FloatArray) -> Plan:
        """The plan so many frames later, turned about the vertical [rad], then shifted (3,) [m]."""
        round_about = rotations.from_yaw(turn)
        return Plan(
            tuple(
                Stretch(
                    stretch.first + later,
                    stretch.poses,
                    stretch.turn + turn,
                    rotations.rotate(round_about, stretch.shift) + shift,
                )
                for stretch in self.stretches
            )
        )

    def placed_on(self, pose: FloatArray, frame: int, later: int = 0) -> Plan:
        """The plan moved on the ground so that at a frame it stands and faces where a pose does.

        As `dynresp.response.transition.transition.place_on` moves a reaction.

        Args:
            pose: (59,) where the character is.
            frame: When.
            later: By how many frames the plan is put off before.
        """
        due = self.read(frame - later, 1)[0]
        turn = float(rotations.yaw_of(pose[ROOT_QUAT]) - rotations.yaw_of(due[ROOT_QUAT]))
        now = rotations.rotate(rotations.from_yaw(turn), due[ROOT])
        return self.moved(later, turn, np.array([pose[0] - now[0], pose[1] - now[1], 0.0]))

    def _before(self, frame: int) -> tuple[Stretch, ...]:
        """The stretches that begin before a frame."""
        return tuple(stretch for stretch in self.stretches if stretch.first < frame)
