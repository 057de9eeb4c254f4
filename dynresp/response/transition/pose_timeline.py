"""The poses that a character is to show from now on, frame by frame on its clock."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray


@dataclass(frozen=True, eq=False)
class TimelinePiece:
    """Consecutive poses and where they are placed.

    Attributes:
        first: Frame of the clock at which the first pose is due.
        poses: (frames, 59) as they were given, not yet placed.
        turn: Angle by which they are turned about the world's vertical axis [rad].
        shift: (3,) by which they are then moved [m].
    """

    first: int
    poses: FloatArray
    turn: float
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class PoseTimeline:
    """Pieces of poses; each counts until the next begins, and its last pose holds if it is short.

    Poses are kept as they were given and placed only when they are read. So a change costs the
    same, no matter how long the timeline is. Methods return new timelines.

    Attributes:
        pieces: In the order of their first frames; at least one.
    """

    pieces: tuple[TimelinePiece, ...]

    @classmethod
    def of(cls, poses: FloatArray, first: int) -> PoseTimeline:
        """A timeline of poses (frames, 59), the first of them due at frame `first`."""
        return cls((TimelinePiece(first, poses, 0.0, np.zeros(3)),))

    @property
    def end(self) -> int:
        """One past the last frame that has a pose; from there on the last pose holds."""
        return self.pieces[-1].first + len(self.pieces[-1].poses)

    def read(self, first: int, frames: int) -> FloatArray:
        """The poses (frames, 59) from frame `first` on; before the first pose, the first holds."""
        out = []
        stop = first + frames
        ends = [piece.first for piece in self.pieces[1:]]
        for k, (piece, end) in enumerate(zip(self.pieces, [*ends, stop], strict=True)):
            begin = first if k == 0 else max(first, piece.first)
            at = np.arange(begin, min(end, stop)) - piece.first
            if not len(at):
                continue
            poses = piece.poses[np.clip(at, 0, len(piece.poses) - 1)]
            if piece.turn or piece.shift.any():
                poses = move_poses(poses, piece.turn, piece.shift)
            out.append(poses)
        return np.concatenate(out)

    def replaced_from(self, poses: FloatArray, first: int) -> PoseTimeline:
        """The timeline with poses (frames, 59) in place of everything from frame `first` on."""
        return PoseTimeline((*self._before(first), *PoseTimeline.of(poses, first).pieces))

    def replaced_within(self, poses: FloatArray, first: int) -> PoseTimeline:
        """The timeline with poses (frames, 59) from `first` on; after them it is unchanged."""
        rest = self.without_before(first + len(poses)).pieces
        return PoseTimeline((*self.replaced_from(poses, first).pieces, *rest))

    def without_before(self, frame: int) -> PoseTimeline:
        """The timeline without what was due before a frame."""
        at = len(self._before(frame + 1)) - 1
        if at < 0:
            return self
        piece = self.pieces[at]
        passed = min(frame - piece.first, len(piece.poses) - 1)
        cut = replace(piece, first=frame, poses=piece.poses[passed:])
        return PoseTimeline((cut, *self.pieces[at + 1 :]))

    def moved(self, delay: int, turn: float, shift: FloatArray) -> PoseTimeline:
        """The timeline moved.

        Args:
            delay: By how many frames it comes later.
            turn: Angle by which it is turned about the vertical axis [rad].
            shift: (3,) by which it is then moved [m].
        """
        rotation = rotations.from_yaw(turn)
        return PoseTimeline(
            tuple(
                TimelinePiece(
                    piece.first + delay,
                    piece.poses,
                    piece.turn + turn,
                    rotations.rotate(rotation, piece.shift) + shift,
                )
                for piece in self.pieces
            )
        )

    def placed_on(self, pose: FloatArray, frame: int, delay: int = 0) -> PoseTimeline:
        """The timeline moved on the ground so that at a frame it stands and faces as a pose does.

        It is moved as `dynresp.response.transition.transition.place_on` moves a reaction.

        Args:
            pose: (59,) where the character is.
            frame: The frame at which it is there.
            delay: By how many frames the timeline is delayed first.
        """
        due = self.read(frame - delay, 1)[0]
        turn = float(rotations.yaw_of(pose[ROOT_QUAT]) - rotations.yaw_of(due[ROOT_QUAT]))
        turned = rotations.rotate(rotations.from_yaw(turn), due[ROOT])
        return self.moved(delay, turn, np.array([pose[0] - turned[0], pose[1] - turned[1], 0.0]))

    def _before(self, frame: int) -> tuple[TimelinePiece, ...]:
        """The pieces that begin before a frame."""
        return tuple(piece for piece in self.pieces if piece.first < frame)
