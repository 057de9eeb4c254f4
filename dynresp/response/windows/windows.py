"""Cut windows out of motions, each in its own facing frame, ready for the window search.

The mismatch (window error) of Zordan et al. 2007 (section 5) compares a short piece of the
simulation with one of a reaction after "an alignment step removes the global differences and
facing direction". Here that step is done once for each window, not once for each pair: a window is
moved so that its first frame stands at the origin and faces along +X. The mismatch of two windows
is then a plain sum over frames and bodies, see `window_kernel`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.response.windows.window_config import WindowErrorConfig
from dynresp.support.arrays import frozen
from dynresp.support.errors import MotionError, UnknownNameError

__all__ = [
    "LANES",
    "LibraryWindows",
    "ReactionTrack",
    "WindowErrorConfig",
    "WindowSet",
    "facing_frames",
    "library_windows",
    "make_many_windows",
    "make_windows",
    "trace_windows",
]

# The number of windows is padded to a multiple of this, the size of a vector. Every pair of windows
# then runs through the same vector instructions, and its mismatch has the same bits wherever it is
# in a clip.
LANES = 8

_UNIT_TOLERANCE = 1e-3

_Scalar = TypeVar("_Scalar", bound=np.generic)


@dataclass(frozen=True)
class ReactionTrack:
    """World states of the bodies over one reaction clip.

    Attributes:
        name: Name of the reaction.
        positions: (frames, bodies, 3) [m], body 0 the pelvis, Z up.
        quaternions: (frames, bodies, 4), w x y z, unit length.
        entry_range: Entries that are allowed, frames [first, last) of the clip; None for all that
            a whole window follows.
    """

    name: str
    positions: npt.NDArray[np.floating]
    quaternions: npt.NDArray[np.floating]
    entry_range: tuple[int, int] | None = None


@dataclass(frozen=True)
class WindowSet:
    """Windows of one track as a structure of arrays, read-only.

    Attributes:
        data: (window frames, bodies, 7, windows padded to a multiple of `LANES`), float32:
            position x y z [m] and quaternion w x y z in the facing frame of the window. Padding
            repeats the last window.
        starts: (windows,) first frame of each window within its track.
        config: The settings they were cut with.
    """

    data: npt.NDArray[np.float32]
    starts: npt.NDArray[np.int64]
    config: WindowErrorConfig

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return int(self.data.shape[1])

    def __len__(self) -> int:
        """Number of windows without padding."""
        return len(self.starts)


@dataclass(frozen=True)
class LibraryWindows:
    """Windows of all reactions, one after the other in one buffer; built once and kept.

    Attributes:
        names: Names of the reactions.
        windows: Windows of each reaction; their `data` are views into `buffer`.
        buffer: All windows, flat float32.
        offsets: (reactions,) where the windows of each reaction begin in `buffer`.
        config: The settings they were cut with.
    """

    names: tuple[str, ...]
    windows: tuple[WindowSet, ...]
    buffer: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64]
    config: WindowErrorConfig

    def index(self, name: str) -> int:
        """Index of a reaction in `names`.

        Raises:
            UnknownNameError: There is no reaction of that name.
        """
        if name not in self.names:
            raise UnknownNameError("reaction", name, self.names)
        return self.names.index(name)

    def subset(self, names: Sequence[str]) -> LibraryWindows:
        """The named reactions alone, in the order given, over the same buffer.

        Raises:
            UnknownNameError: There is no reaction of one of the names.
        """
        rows = [self.index(name) for name in names]
        return LibraryWindows(
            names=tuple(names),
            windows=tuple(self.windows[row] for row in rows),
            buffer=self.buffer,
            offsets=frozen(self.offsets[rows]),
            config=self.config,
        )


def facing_frames(
    pelvis_positions: npt.ArrayLike, pelvis_quaternions: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Ground point and facing of a character, from the pelvis alone.

    The facing is the twist of the pelvis about the vertical (`rotations.yaw_of`). It is defined
    also for somebody who lies, where the forward axis of the pelvis may point straight up or down.
    A pelvis exactly upside down has no twist; its yaw is zero.

    Args:
        pelvis_positions: (..., 3) [m].
        pelvis_quaternions: (..., 4), w x y z.

    Returns:
        Ground points (..., 2) [m] below the pelvis, and yaws (...) [rad].
    """
    positions = np.asarray(pelvis_positions, dtype=np.float64)
    return positions[..., :2], rotations.yaw_of(pelvis_quaternions)


def make_windows(
    positions: npt.ArrayLike,
    quaternions: npt.ArrayLike,
    starts: Iterable[int],
    config: WindowErrorConfig,
    *,
    name: str = "track",
) -> WindowSet:
    """Cut windows out of a track and move each into its own facing frame.

    Args:
        positions: (frames, bodies, 3) [m], body 0 the pelvis, Z up.
        quaternions: (frames, bodies, 4), w x y z, unit length.
        starts: First frame of each window.
        config: Gives the length of the windows.
        name: What error messages call the track.

    Returns:
        The windows.

    Raises:
        MotionError: Shapes do not fit, a value is not finite, a quaternion is not of unit length,
            or the track is too short for a window.
    """
    tracks = (np.asarray(positions)[None], np.asarray(quaternions)[None])
    return make_many_windows(*tracks, starts, config, name=name)[0]


def make_many_windows(
    positions: npt.ArrayLike,
    quaternions: npt.ArrayLike,
    starts: Iterable[int],
    config: WindowErrorConfig,
    *,
    name: str = "track",
) -> list[WindowSet]:
    """Cut the same windows out of several tracks, with the bits that each would have alone.

    Args:
        positions: (tracks, frames, bodies, 3) [m], body 0 the pelvis, Z up.
        quaternions: (tracks, frames, bodies, 4), w x y z, unit length.
        starts: First frame of each window.
        config: Gives the length of the windows.
        name: What error messages call the tracks.

    Returns:
        The windows of each track.

    Raises:
        MotionError: As `make_windows`.
    """
    position, quaternion = _checked_tracks(positions, quaternions, name)
    first = np.array(list(starts), dtype=np.int64)
    frames = config.window_frames
    if len(first) == 0:
        raise MotionError(f"{name}: no window was given; expected at least one first frame")
    if first.min() < 0 or first.max() + frames > position.shape[1]:
        raise MotionError(
            f"{name}: has {position.shape[1]} frames; windows of {frames} frames that begin at "
            f"frames {first.min()} to {first.max()} need {first.max() + frames}, and none may "
            "begin before frame 0; give a longer track or narrower bounds"
        )
    ground, yaw = facing_frames(position[:, first, 0], quaternion[:, first, 0])
    turn = rotations.from_yaw(-yaw)[:, :, None, None]
    rows = first[:, None] + np.arange(frames)
    local = position[:, rows]
    local[..., :2] -= ground[:, :, None, None]
    states = np.concatenate(
        [rotations.rotate(turn, local), rotations.multiply(turn, quaternion[:, rows])], axis=-1
    )
    padding = -len(first) % LANES
    states = np.concatenate([states, np.repeat(states[:, -1:], padding, axis=1)], axis=1)
    data = np.ascontiguousarray(states.transpose(0, 2, 3, 4, 1), dtype=np.float32)
    frozen(data)
    starts_alike = frozen(first)
    return [WindowSet(data=own, starts=starts_alike, config=config) for own in data]


def trace_windows(
    positions: npt.ArrayLike, quaternions: npt.ArrayLike, config: WindowErrorConfig
) -> WindowSet:
    """Windows of a simulated trace, one for each exit.

    Args:
        positions: (frames, bodies, 3) [m]; frame 0 is the first contact.
        quaternions: (frames, bodies, 4), w x y z.
        config: Gives the exits and the length of the windows.

    Returns:
        The windows; `starts` are frames after contact.

    Raises:
        MotionError: As `make_windows`.
    """
    return make_windows(positions, quaternions, config.exit_frames, config, name="simulated trace")


def library_windows(tracks: Sequence[ReactionTrack], config: WindowErrorConfig) -> LibraryWindows:
    """Windows of all reactions, one for each entry.

    Args:
        tracks: The reactions.
        config: Gives the step of the entries and the length of the windows.

    Returns:
        The windows of all reactions.

    Raises:
        MotionError: No reaction is given, a name is given twice, two reactions differ in their
            number of bodies, or `make_windows` refuses one (too short, not finite, ...).
    """
    if not tracks:
        raise MotionError("the reaction library is empty; expected at least one reaction")
    names = tuple(track.name for track in tracks)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise MotionError(f"names of reactions given more than once: {', '.join(twice)}")
    made = []
    for track in tracks:
        label = f"reaction {track.name!r}"
        entries = _entries(len(track.positions), track.entry_range, config, label)
        made.append(make_windows(track.positions, track.quaternions, entries, config, name=label))
        if made[-1].bodies != made[0].bodies:
            raise MotionError(
                f"{label} has {made[-1].bodies} bodies, reaction {names[0]!r} has "
                f"{made[0].bodies}; all must be of one character"
            )
    ends = np.cumsum([windows.data.size for windows in made])
    buffer = _aligned(int(ends[-1]))
    np.concatenate([windows.data.ravel() for windows in made], out=buffer)
    frozen(buffer)
    views = [
        WindowSet(buffer[end - w.data.size : end].reshape(w.data.shape), w.starts, config)
        for w, end in zip(made, ends, strict=True)
    ]
    offsets = np.array([0, *ends[:-1]], dtype=np.int64)
    return LibraryWindows(names, tuple(views), buffer, frozen(offsets), config)


def _aligned(size: int) -> npt.NDArray[np.float32]:
    """An array of float32 that begins at a cache line, so that no vector crosses one."""
    line = 64
    raw = np.empty(size * 4 + line, dtype=np.uint8)
    start = -raw.ctypes.data % line
    return raw[start : start + size * 4].view(np.float32)


def _entries(
    frames: int, bounds: tuple[int, int] | None, config: WindowErrorConfig, label: str
) -> range:
    """Entries into a clip of so many frames, within [first, last) where bounds are given."""
    room = frames - config.window_frames + 1
    if room < 1:
        raise MotionError(
            f"{label}: has {frames} frames, a window needs {config.window_frames}; "
            "take a longer range of the clip"
        )
    first, last = bounds if bounds is not None else (0, room)
    if not 0 <= first < last <= room:
        raise MotionError(
            f"{label}: the entry range is frames {first} to {last} (not included); with "
            f"{frames} frames and windows of {config.window_frames}, expected "
            f"0 <= first < last <= {room}"
        )
    return range(first, last, config.entry_step)


def _checked_tracks(
    positions: npt.ArrayLike, quaternions: npt.ArrayLike, name: str
) -> tuple[FloatArray, FloatArray]:
    """The tracks as float64 with quaternions of exactly unit length, or an error."""
    position = np.asarray(positions, dtype=np.float64)
    quaternion = np.asarray(quaternions, dtype=np.float64)
    fits = position.ndim == 4 and position.shape[2] > 0 and position.shape[3] == 3
    if not fits or quaternion.shape != (*position.shape[:3], 4):
        raise MotionError(
            f"{name}: positions have shape {position.shape[1:]}, quaternions "
            f"{quaternion.shape[1:]}; expected (frames, bodies, 3) and (frames, bodies, 4) with at "
            "least one body"
        )
    finite = np.isfinite(position).all(axis=3) & np.isfinite(quaternion).all(axis=3)
    if not finite.all():
        _, frame, body = np.argwhere(~finite)[0]
        raise MotionError(
            f"{name}: {np.count_nonzero(~finite)} body states are not finite, the first at frame "
            f"{frame}, body {body}; leave such frames out"
        )
    norms = np.linalg.norm(quaternion, axis=3)
    off = np.abs(norms - 1.0) > _UNIT_TOLERANCE
    if off.any():
        track, frame, body = np.argwhere(off)[0]
        raise MotionError(
            f"{name}: the quaternion at frame {frame}, body {body} has length "
            f"{norms[track, frame, body]:.4g}; expected unit length, w x y z"
        )
    return position, quaternion / norms[..., None]
