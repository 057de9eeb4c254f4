"""The exhaustive window search, slow and readable: the twin of the full search.

`dynresp.response.search.full_search` must equal it.

The window error itself is `studies.benchmarks.window_error_twin`, which a benchmark
times; here is the search around it.
"""

from collections.abc import Sequence

from dynresp.motion.rotations import FloatArray
from dynresp.response.windows.windows import ReactionTrack, WindowErrorConfig
from studies.benchmarks.window_error_twin import error_surface

__all__ = ["best_match", "error_surface", "reaction_surface"]


def reaction_surface(
    trace: tuple[FloatArray, FloatArray], track: ReactionTrack, config: WindowErrorConfig
) -> tuple[FloatArray, list[int], list[int]]:
    """Errors of all pairs, the exit frames, and the entry frames."""
    last = len(track.positions) - config.window_frames + 1
    bounds = track.entry_range or (0, last)
    exits = list(config.exit_frames)
    entries = list(range(*bounds, config.entry_step))
    clip = (track.positions, track.quaternions)
    return error_surface(trace, clip, exits, entries, config), exits, entries


def best_match(
    trace: tuple[FloatArray, FloatArray],
    tracks: Sequence[ReactionTrack],
    config: WindowErrorConfig,
) -> tuple[float, int, int, int]:
    """Least error, exit frame, entry frame and index of the reaction; ties in that order."""
    found = []
    for index, track in enumerate(tracks):
        surface, exits, entries = reaction_surface(trace, track, config)
        for row, exit_frame in enumerate(exits):
            for column, entry_frame in enumerate(entries):
                found.append((float(surface[row, column]), exit_frame, entry_frame, index))
    return min(found)
