"""Time alignment: find exit and entry of one reaction, fast and between frames.

Zordan et al. 2007 (section 5): the mismatch (window error) is sampled sparsely along both times, in
sets that begin at the start of the simulation, until further sets do not improve it. Then a descent
by BFGS from the best sample, with interpolated frames, finds the times. `full_search.search` aligns
by trying every pair of whole frames.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment_result import (
    LEAST_GAIN,
    Alignment,
    AlignmentConfig,
    Alignments,
)
from dynresp.response.windows.window_config import WindowErrorConfig
from dynresp.response.windows.windows import (
    LANES,
    ReactionTrack,
    library_windows,
    make_many_windows,
)
from dynresp.support.errors import MotionError, UnknownNameError

__all__ = ["Aligner", "Alignment", "AlignmentConfig", "Alignments"]

_Clip = npt.NDArray[np.float32]

_TRACE = "simulated trace"
# Shifts of an entry [frames] that are tried after its exit was moved to a whole frame. Zero is
# first, so that it wins among equals.
_ENTRY_SHIFTS = np.array([0.0, -1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0])


class Aligner:
    """Aligns reactions with simulated traces; the reactions are prepared once.

    To align with a simulation that still runs, align what there is, and simulate more while the
    result is not `complete`. A longer trace does not change a complete result by a single bit.

    An aligner takes some tens of microseconds a reaction to make, so a track that is needed once,
    such as the base motion around the hit, can have its own.

    Attributes:
        names: Names of the reactions.
        window: Settings of the mismatch, and the bounds of the exits.
        config: Settings of the alignment.
    """

    def __init__(
        self,
        tracks: Sequence[ReactionTrack],
        window: WindowErrorConfig,
        config: AlignmentConfig | None = None,
    ) -> None:
        """Prepare the reactions.

        Args:
            tracks: The reactions, at the frame rate of `window`; each has the range of its entries.
            window: Settings of the mismatch, and the range of the exits. Its `entry_step_s` has no
                effect here.
            config: Settings of the alignment.

        Raises:
            MotionError: `windows.library_windows` refuses the tracks.
        """
        self.names = tuple(track.name for track in tracks)
        self.window = window
        self.config = config = config or AlignmentConfig()
        self._rows = {name: row for row, name in enumerate(self.names)}
        made = [self._lay_out(track) for track in tracks]
        bodies = {len(track.positions[0]) for track, one in zip(tracks, made, strict=True) if one}
        if None in made or len(self._rows) < len(tracks) or len(bodies) != 1:
            library_windows(tracks, window)  # Raises an error that says what is wrong.
            raise MotionError("a quaternion of the reactions is not of unit length, w x y z")
        self._bodies = bodies.pop()
        clips = [one for one in made if one]
        rows = np.concatenate([clip for clip, *_ in clips])
        ends = np.cumsum([len(clip) for clip, *_ in clips])
        layouts = np.array(
            [[end - len(clip), *layout] for end, (clip, *layout) in zip(ends, clips, strict=True)],
            np.int64,
        )
        rows.flags.writeable = layouts.flags.writeable = False
        step = config.step_s * window.fps
        exits, weights = _samples_and_weights(window, step, self._bodies)
        self._least = window.exit_frames[0] + window.window_frames
        kernel = _kernel()
        self._clips = kernel.Clips(rows, layouts)
        self._weights = kernel.Weights(*weights)
        self._sampling = kernel.Sampling(
            window.window_frames, exits, step, config.sets_without_gain
        )
        most = config.most_iterations if config.refine else 0
        self._descent = kernel.Descent(config.starts, most, LEAST_GAIN)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the state of a pickled aligner."""
        self.__dict__ |= state
        # Unpickled arrays can be written; the kernels' signatures know read-only ones.
        for array in (*self._clips, *self._weights, self._sampling.exits):
            array.flags.writeable = False

    def row(self, reaction: str) -> int:
        """Index of a reaction in `names`.

        Raises:
            UnknownNameError: There is no reaction of that name.
        """
        if reaction not in self._rows:
            raise UnknownNameError("reaction", reaction, self.names)
        return self._rows[reaction]

    def align(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, reactions: Sequence[str]
    ) -> list[Alignment]:
        """Align some reactions with one trace.

        Args:
            positions: (frames, bodies, 3) [m], body 0 the pelvis, Z up; frame 0 is the first at or
                after contact.
            quaternions: (frames, bodies, 4), w x y z, unit length.
            reactions: Their names.

        Returns:
            An alignment of each, in their order.

        Raises:
            UnknownNameError: There is no reaction of one of the names.
            MotionError: Shapes do not fit, the trace is too short for the earliest exit, or the
                part of it that is used is not finite or not of unit length.
        """
        position, quaternion = self._trace(positions, quaternions, 3)
        rows = np.array([[self.row(name) for name in reactions]], np.int64)
        found = self._align(position[None], quaternion[None], rows)[0].tolist()
        return [
            Alignment(name, error, exit_, entry, int(cost), int(sets), complete > 0, refined > 0)
            for name, (error, exit_, entry, cost, sets, complete, refined) in zip(
                reactions, found, strict=True
            )
        ]

    def align_many(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, rows: npt.ArrayLike
    ) -> Alignments:
        """Align many traces of one length, with the bits that `align` would give for each.

        Args:
            positions: (traces, frames, bodies, 3), as for `align`.
            quaternions: (traces, frames, bodies, 4).
            rows: (traces,) or (traces, k): reactions to align with each trace, as indices into
                `names`.

        Returns:
            The alignments.

        Raises:
            MotionError: As `align`, or `rows` does not fit.
        """
        position, quaternion = self._trace(positions, quaternions, 4)
        chosen = np.asarray(rows)
        fits = chosen.ndim in (1, 2) and len(chosen) == len(position) and chosen.dtype.kind in "iu"
        if not fits or (chosen.size and not 0 <= chosen.min() <= chosen.max() < len(self.names)):
            raise MotionError(
                f"rows has shape {chosen.shape} and type {chosen.dtype}; expected a whole number "
                f"from 0 to {len(self.names) - 1}, or a row of them, for each of {len(position)} "
                "traces"
            )
        chosen = chosen.astype(np.int64)
        found = self._align(
            position, quaternion, chosen.reshape(len(chosen), math.prod(chosen.shape[1:]))
        )
        columns = np.moveaxis(found, -1, 0).reshape(found.shape[-1], *chosen.shape)
        error, exit_, entry, cost, sets, complete, refined = columns
        return Alignments(
            names=self.names,
            rows=chosen,
            errors=error,
            exit_frames=exit_,
            entry_frames=entry,
            evaluations=cost.astype(np.int64),
            sets=sets.astype(np.int64),
            complete=complete > 0,
            refined=refined > 0,
        )

    def errors(
        self,
        positions: npt.ArrayLike,
        quaternions: npt.ArrayLike,
        reaction: str,
        exit_frames: npt.ArrayLike,
        entry_frames: npt.ArrayLike,
    ) -> FloatArray:
        """Mismatches (window errors) at any times, whole frames or between them.

        Args:
            positions: (frames, bodies, 3), as for `align`.
            quaternions: (frames, bodies, 4).
            reaction: Its name.
            exit_frames: Frames after contact, 0 to the last that a whole window follows.
            entry_frames: Frames of the reaction within its entry range; broadcast against the
                exits.

        Returns:
            Mismatches [m], in the shape to which exits and entries are broadcast.

        Raises:
            UnknownNameError: There is no reaction of that name.
            MotionError: As `align`, or a frame is out of range.
        """
        position, quaternion = self._trace(positions, quaternions, 3)
        exits, entries = np.broadcast_arrays(
            np.asarray(exit_frames, np.float64), np.asarray(entry_frames, np.float64)
        )
        row = self.row(reaction)
        first, latest = self._entry_range(row)
        last = len(position) - self.window.window_frames
        for what, frames, low, high in (
            ("exit", exits, 0, last),
            ("entry", entries, first, latest),
        ):
            if not np.all((frames >= low) & (frames <= high)):
                raise MotionError(
                    f"{reaction!r}: {what} frames from {frames.min():g} to {frames.max():g} were "
                    f"given; expected {low} to {high}"
                )
        found = self._errors(position, quaternion, row, exits.ravel(), entries.ravel())
        return found.reshape(exits.shape)

    def snap(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, alignment: Alignment
    ) -> Alignment:
        """Move an alignment to a whole exit frame.

        Exit and entry move together, to the frame before or after. Then entries up to a frame
        earlier and later are tried, within the entry range, and the best is taken.

        Args:
            positions: (frames, bodies, 3), the trace that was aligned.
            quaternions: (frames, bodies, 4).
            alignment: What `align` found.

        Returns:
            The alignment there, with its mismatch.

        Raises:
            UnknownNameError: This aligner has no such reaction.
            MotionError: As `align`, or the exit is outside the trace.
        """
        position, quaternion = self._trace(positions, quaternions, 3)
        row = self.row(alignment.reaction)
        first, latest = self._entry_range(row)
        last = len(position) - self.window.window_frames
        # Bounds are whole frames, so the frames before and after an exit are within them, too.
        exits = sorted({math.floor(alignment.exit_frame), math.ceil(alignment.exit_frame)})
        if not 0 <= exits[0] <= exits[-1] <= last:
            raise MotionError(
                f"the exit is at frame {alignment.exit_frame:g}; in this trace of {len(position)} "
                f"frames, expected an exit from 0 to {last}; give the trace that was aligned"
            )
        ends = np.repeat(np.array(exits, float), len(_ENTRY_SHIFTS))
        shifted = alignment.entry_frame - alignment.exit_frame + ends
        entries = np.clip(shifted + np.tile(_ENTRY_SHIFTS, len(exits)), first, latest)
        errors = self._errors(position, quaternion, row, ends, entries)
        best = int(errors.argmin())
        return dataclasses.replace(
            alignment,
            error=float(errors[best]),
            exit_frame=float(ends[best]),
            entry_frame=float(entries[best]),
            evaluations=alignment.evaluations + len(ends),
        )

    def _entry_range(self, row: int) -> tuple[int, int]:
        """First and last entry of a reaction [frames]."""
        layout, kernel = self._clips.layouts[row], _kernel()
        return int(layout[kernel.FIRST]), int(layout[kernel.FIRST] + layout[kernel.LATER])

    # -- memory layout and checks ---------------------------------------------------------------

    def _lay_out(
        self, track: ReactionTrack
    ) -> tuple[npt.NDArray[np.float32], int, int, int] | None:
        """Clip, row length, first entry and number of later ones; None if the track is invalid."""
        shape, frames = np.shape(track.positions), self.window.window_frames
        if len(shape) != 3 or shape[1] == 0 or shape[2] != 3:
            return None
        room = shape[0] - frames + 1
        first, last = track.entry_range or (0, room)
        if np.shape(track.quaternions) != (*shape[:2], 4) or not 0 <= first < last <= room:
            return None
        used = last - 1 - first + frames
        row = (used + 1) * shape[1] + LANES
        clip = np.empty(_kernel().ROWS * row, np.float32)
        part = slice(first, first + used)
        position = np.ascontiguousarray(track.positions[part], np.float64)
        quaternion = np.ascontiguousarray(track.quaternions[part], np.float64)
        valid = _kernel().lay_out(position, quaternion, used, clip)
        return (clip, row, first, last - 1 - first) if valid else None

    def _trace(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, dims: int
    ) -> tuple[FloatArray, FloatArray]:
        """Positions and quaternions as the kernels need them, of checked shape and length."""
        position = np.ascontiguousarray(positions, np.float64)
        quaternion = np.ascontiguousarray(quaternions, np.float64)
        shape = position.shape
        fits = len(shape) == dims and shape[-1] == 3 and quaternion.shape == (*shape[:-1], 4)
        if not fits or shape[-2] != self._bodies or shape[-3] < self._least:
            lead = (None,) * (4 - dims)
            self._refuse(position[lead], quaternion[lead])
        return position, quaternion

    def _align(
        self, position: FloatArray, quaternion: FloatArray, rows: npt.NDArray[np.int64]
    ) -> FloatArray:
        """Call the kernel."""
        found = np.empty((*rows.shape, _kernel().COLUMNS))
        invalid = _kernel().align_kernel(
            position,
            quaternion,
            rows,
            self._clips,
            self._weights,
            self._sampling,
            self._descent,
            found,
        )
        if invalid >= 0:
            self._refuse(position[invalid : invalid + 1], quaternion[invalid : invalid + 1])
        return found

    def _errors(
        self,
        position: FloatArray,
        quaternion: FloatArray,
        row: int,
        exits: FloatArray,
        entries: FloatArray,
    ) -> FloatArray:
        """Call the kernel for pairs that are within bounds."""
        found = np.empty(len(exits))
        if len(exits) and not _kernel().errors_kernel(
            position, quaternion, row, self._clips, self._weights, self.window.window_frames,
            exits, entries, found,
        ):  # fmt: skip
            self._refuse(position[None], quaternion[None])
        return found

    def _refuse(self, position: FloatArray, quaternion: FloatArray) -> None:
        """Say what is wrong with traces (traces, frames, bodies, ...)."""
        first = self._least - self.window.window_frames
        make_many_windows(position, quaternion, [first], self.window, name=_TRACE)
        if position.shape[2] != self._bodies:
            raise MotionError(
                f"the trace has {position.shape[2]} bodies, the reactions {self._bodies}; "
                "both must be of one character"
            )
        raise MotionError(f"{_TRACE}: a quaternion is not of unit length, w x y z")


@functools.cache
def _kernel() -> ModuleType:
    """The compiled part, loaded when it is needed: importing numba takes a third of a second."""
    from dynresp.response.alignment import alignment_kernel

    return alignment_kernel


@functools.lru_cache(maxsize=16)
def _samples_and_weights(
    window: WindowErrorConfig, step: float, bodies: int
) -> tuple[FloatArray, tuple[_Clip, _Clip]]:
    """Exits to sample at most `step` frames apart, and weights of each body of each frame.

    The weights, of a metre and of a radian, are padded with zeros to whole vectors.
    """
    first, last = window.exit_frames[0], window.exit_frames[-1]
    exits = np.linspace(first, last, math.ceil((last - first) / step - 1e-9) + 1)
    shares = window.frame_weights()[:, None]
    metre, radian = (
        np.pad((shares * weights).ravel(), (0, -window.window_frames * bodies % LANES))
        for weights in window.body_weights(bodies)
    )
    weights = metre.astype(np.float32), radian.astype(np.float32)
    for array in (exits, *weights):
        array.flags.writeable = False
    return exits, weights
