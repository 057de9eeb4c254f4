"""Time alignment, slow and readable: what `dynresp.response.alignment.alignment` must equal."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment import AlignmentConfig
from dynresp.response.windows.windows import ReactionTrack, WindowErrorConfig
from studies.benchmarks.window_error_twin import cut_window, window_error

Track = tuple[FloatArray, FloatArray]


def interpolated(track: Track, start: float, frames: int) -> Track:
    """The track at `start`, `start` + 1, ...: lines for positions, chords for quaternions."""
    positions, quaternions = track
    states = np.empty((frames, *positions.shape[1:])), np.empty((frames, *quaternions.shape[1:]))
    for i in range(frames):
        before = math.floor(start + i)
        after = min(before + 1, len(positions) - 1)
        share = start + i - before
        states[0][i] = (1.0 - share) * positions[before] + share * positions[after]
        for body in range(positions.shape[1]):
            a, b = quaternions[before, body], quaternions[after, body]
            if np.dot(a, b) < 0.0:
                b = -b
            chord = (1.0 - share) * a + share * b
            states[1][i, body] = chord / np.linalg.norm(chord)
    return states


def error_between(
    trace: Track, clip: Track, exit_frame: float, entry_frame: float, config: WindowErrorConfig
) -> float:
    """Window error for an exit and an entry between frames [m]."""
    frames = config.window_frames
    windows = [
        cut_window(*interpolated(track, start, frames), 0, frames)
        for track, start in ((trace, exit_frame), (clip, entry_frame))
    ]
    return window_error(*windows, config)


@dataclass(frozen=True)
class Sampled:
    """The samples, and the best of them.

    Attributes:
        error: Of the best [m].
        exit_frame: Of the best.
        entry_frame: Of the best.
        sets: How many were sampled.
        count: How many samples that is.
        complete: Whether the search ended by itself.
        last: The last exit sampled.
    """

    error: float
    exit_frame: float
    entry_frame: float
    sets: int
    count: int
    complete: bool
    last: float


def samples(first: float, last: float, step: float) -> list[float]:
    """From first to last, both included, evenly, at most `step` apart."""
    gaps = math.ceil((last - first) / step - 1e-9)
    return [first + (last - first) * i / max(gaps, 1) for i in range(gaps + 1)]


def entry_bounds(track: ReactionTrack, window: WindowErrorConfig) -> tuple[int, int]:
    """First and last entry frame."""
    first, last = track.entry_range or (0, len(track.positions) - window.window_frames + 1)
    return first, last - 1


def sample(
    trace: Track, track: ReactionTrack, window: WindowErrorConfig, config: AlignmentConfig
) -> Sampled:
    """All entries of one exit after the other, until further sets do not improve."""
    step = config.step_s * window.fps
    exits = samples(window.exit_frames[0], window.exit_frames[-1], step)
    entries = samples(*entry_bounds(track, window), step)
    clip = (track.positions, track.quaternions)
    best = (math.inf, 0.0, 0.0)
    without = sets = 0
    for exit_frame in exits:
        if math.ceil(exit_frame) + window.window_frames > len(trace[0]):
            break
        if without == config.sets_without_gain:
            break
        sets += 1
        found = min((error_between(trace, clip, exit_frame, m, window), m) for m in entries)
        if found[0] < best[0]:
            best, without = (found[0], exit_frame, found[1]), 0
        else:
            without += 1
    complete = sets == len(exits) or without == config.sets_without_gain
    return Sampled(*best, sets, sets * len(entries), complete, exits[sets - 1])


def descend(
    trace: Track, track: ReactionTrack, window: WindowErrorConfig, start: Sampled
) -> tuple[float, float, float]:
    """SciPy's descent from the best sample: error, exit and entry."""
    clip = (track.positions, track.quaternions)
    bounds = [(window.exit_frames[0], start.last), entry_bounds(track, window)]
    found = minimize(
        lambda x: error_between(trace, clip, x[0], x[1], window),
        (start.exit_frame, start.entry_frame),
        method="L-BFGS-B",
        bounds=bounds,
        options={"eps": 1e-3},
    )
    return float(found.fun), float(found.x[0]), float(found.x[1])
