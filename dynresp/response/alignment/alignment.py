"""Time alignment: when to leave the simulation, and where to enter the one reaction chosen.

Zordan et al. 2007 (section 5): the window error is sampled sparsely along both times, in sets that
begin at the start of the simulation and are cut when further sets do not improve; a descent by
BFGS from the best sample, with interpolated frames, finds the times. The exhaustive alignment
beside it is `oracle.search`, which tries every pair of whole frames.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from types import ModuleType

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment_result import Alignment, AlignmentConfig, Alignments
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
# Entries that are tried beside one that was shifted to a whole exit frame; itself first, so that of
# equals it is kept.
_NEARBY = np.array([0.0, -1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0])


class Aligner:
    """Aligns reactions with simulated traces; the reactions are laid out once.

    To fit a trace that grows with the simulation, align what is there and go on simulating while
    the result is not `complete`: a longer trace leaves a complete result as it is, to the last
    bit.

    Making one costs some tens of microseconds a reaction, so a track that is met once, such as
    the base motion around the hit, can have an aligner of its own.

    Attributes:
        names: Names of the reactions.
        window: The window error and the bounds of the exits.
        config: Quality against speed.
    """

    def __init__(
        self,
        tracks: Sequence[ReactionTrack],
        window: WindowErrorConfig,
        config: AlignmentConfig | None = None,
    ) -> None:
        """Lay out the reactions.

        Args:
            tracks: The reactions, at the frame rate of `window`.
            window: The window error; its exits bound the times at which the simulation is left.
                Entries are bounded by each track's `entry_range`; its `entry_step_s` is for the
                exhaustive search alone.
            config: Settings.

        Raises:
            MotionError: The tracks make no library (`windows.library_windows`).
        """
        self.names = tuple(track.name for track in tracks)
        self.window = window
        self.config = config = config or AlignmentConfig()
        self._rows = {name: row for row, name in enumerate(self.names)}
        laid = [self._lay_out(track) for track in tracks]
        alike = {len(track.positions[0]) for track, one in zip(tracks, laid, strict=True) if one}
        if None in laid or len(self._rows) < len(tracks) or len(alike) != 1:
            library_windows(tracks, window)
            raise MotionError("a quaternion of the reactions is not of unit length, w x y z.")
        self._bodies = alike.pop()
        kept = [one for one in laid if one]
        self._clips = np.concatenate([clip for clip, *_ in kept])
        ends = np.cumsum([len(clip) for clip, *_ in kept])
        self._places = np.array(
            [[end - len(clip), *place] for end, (clip, *place) in zip(ends, kept, strict=True)],
            np.int64,
        )
        self._step = config.step_s * window.fps
        self._exits, self._weights = _samples_and_weights(window, self._step, self._bodies)
        self._least = window.exit_frames[0] + window.window_frames
        self._settings = (
            config.sets_without_gain,
            config.starts,
            config.most_iterations if config.refine else 0,
            config.least_gain,
        )
        self._clips.flags.writeable = self._places.flags.writeable = False

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
            MotionError: Shapes do not fit, the trace is too short for the earliest exit, or what
                is looked at of it is not finite or not of unit length.
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
        """Align many traces of one length, bitwise as `align` would one by one.

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
                "traces."
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
        """Window errors for any times, whole frames or between them.

        Args:
            positions: (frames, bodies, 3), as for `align`.
            quaternions: (frames, bodies, 4).
            reaction: Its name.
            exit_frames: Frames after contact, 0 to the last that leaves a window.
            entry_frames: Frames of the reaction within its entry range; broadcast against the
                exits.

        Returns:
            Errors [m], of the shape that both have together.

        Raises:
            UnknownNameError: There is no reaction of that name.
            MotionError: As `align`, or a frame lies out of bounds.
        """
        position, quaternion = self._trace(positions, quaternions, 3)
        exits, entries = np.broadcast_arrays(
            np.asarray(exit_frames, np.float64), np.asarray(entry_frames, np.float64)
        )
        place = self._places[self.row(reaction)]
        first, latest = int(place[2]), int(place[2] + place[3])
        last = len(position) - self.window.window_frames
        for what, frames, low, high in (
            ("exit", exits, 0, last),
            ("entry", entries, first, latest),
        ):
            if not np.all((frames >= low) & (frames <= high)):
                raise MotionError(
                    f"{reaction!r}: {what} frames from {frames.min():g} to {frames.max():g} were "
                    f"asked for; expected {low} to {high}."
                )
        found = self._errors(position, quaternion, place, exits.ravel(), entries.ravel())
        return found.reshape(exits.shape)

    def snap(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, alignment: Alignment
    ) -> Alignment:
        """Move an alignment to a whole exit frame, where a simulation can be left.

        Exit and entry are shifted together, to the frame before or after; the entry is then tried
        up to a frame earlier and later, within its bounds, and what fits best is taken.

        Args:
            positions: (frames, bodies, 3), the trace that was aligned.
            quaternions: (frames, bodies, 4).
            alignment: What `align` found.

        Returns:
            The alignment there, with its error.

        Raises:
            UnknownNameError: The alignment is of a reaction that is not here.
            MotionError: As `align`, or the exit lies outside the trace.
        """
        position, quaternion = self._trace(positions, quaternions, 3)
        place = self._places[self.row(alignment.reaction)]
        _, _, earliest, room = place.tolist()
        last = len(position) - self.window.window_frames
        # Bounds are whole frames: with an exit, those on either side are within them.
        exits = sorted({math.floor(alignment.exit_frame), math.ceil(alignment.exit_frame)})
        if not 0 <= exits[0] <= exits[-1] <= last:
            raise MotionError(
                f"the exit is at frame {alignment.exit_frame:g}, the trace has {len(position)} "
                f"frames, so that it can be left at 0 to {last}. Give the trace that was aligned."
            )
        ends = np.repeat(np.array(exits, float), len(_NEARBY))
        shifted = alignment.entry_frame - alignment.exit_frame + ends
        entries = np.clip(shifted + np.tile(_NEARBY, len(exits)), earliest, earliest + room)
        errors = self._errors(position, quaternion, place, ends, entries)
        best = int(errors.argmin())
        return dataclasses.replace(
            alignment,
            error=float(errors[best]),
            exit_frame=float(ends[best]),
            entry_frame=float(entries[best]),
            evaluations=alignment.evaluations + len(ends),
        )

    # -- laying out and checking ----------------------------------------------------------------

    def _lay_out(
        self, track: ReactionTrack
    ) -> tuple[npt.NDArray[np.float32], int, int, int] | None:
        """Clip, row length, first entry and room for later ones; None if the track is unfit."""
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
        fit = _kernel().lay_out(position, quaternion, used, clip)
        return (clip, row, first, last - 1 - first) if fit else None

    def _trace(
        self, positions: npt.ArrayLike, quaternions: npt.ArrayLike, dims: int
    ) -> tuple[FloatArray, FloatArray]:
        """Arrays as the kernels want them, of the right shape and long enough."""
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
        unfit = _kernel().align_kernel(
            position,
            quaternion,
            rows,
            self._clips,
            self._places,
            *self._weights,
            self.window.window_frames,
            self._exits,
            self._step,
            *self._settings,
            found,
        )
        if unfit >= 0:
            self._refuse(position[unfit : unfit + 1], quaternion[unfit : unfit + 1])
        return found

    def _errors(
        self,
        position: FloatArray,
        quaternion: FloatArray,
        place: npt.NDArray[np.int64],
        exits: FloatArray,
        entries: FloatArray,
    ) -> FloatArray:
        """Call the kernel for pairs that are within bounds."""
        found = np.empty(len(exits))
        frames = self.window.window_frames
        if len(exits) and not _kernel().errors_kernel(
            position, quaternion, self._clips, place, *self._weights, frames, exits, entries, found
        ):
            self._refuse(position[None], quaternion[None])
        return found

    def _refuse(self, position: FloatArray, quaternion: FloatArray) -> None:
        """Say what is wrong with traces (traces, frames, bodies, ...)."""
        first = self._least - self.window.window_frames
        make_many_windows(position, quaternion, [first], self.window, name=_TRACE)
        if position.shape[2] != self._bodies:
            raise MotionError(
                f"the trace has {position.shape[2]} bodies, the reactions {self._bodies}. "
                "Both must be of one character."
            )
        raise MotionError(f"{_TRACE}: a quaternion is not of unit length, w x y z.")


@functools.cache
def _kernel() -> ModuleType:
    """The compiled part, loaded when it is needed: numba alone takes a third of a second."""
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
