"""No reaction (carry on): how well the base motion fits after a hit.

The exit is `CARRY_ON_EXIT_S` after contact, after a graze the earliest exit. The entry is where the
base motion would be then, or up to `CARRY_ON_SLACK_S` earlier or later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynresp.motion.character import Character
from dynresp.response.alignment.alignment import Aligner
from dynresp.response.look_ahead import LookAhead, base_poses, kinematics_of_many
from dynresp.response.response import (
    CARRY_ON,
    CARRY_ON_EXIT_S,
    CARRY_ON_SLACK_S,
    ResponseConfig,
)
from dynresp.response.search.full_search import search
from dynresp.response.windows.windows import ReactionTrack, library_windows, make_windows


@dataclass(frozen=True)
class BaseMotionFit:
    """Exit and entry where the base motion fits a hit best.

    Attributes:
        error: Least mismatch (window error) [m].
        exit: Frame after contact.
        entry: Frame of the base motion.
    """

    error: float
    exit: int
    entry: int


def search_base_motions(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[BaseMotionFit]:
    """Fit base motions as the full search does; each with the bits it would have alone.

    Args:
        character: The character.
        config: Settings.
        hits: Simulated hits.
    """
    fits = []
    for row, (track, exit_frame, first) in enumerate(_base_tracks(character, config, hits)):
        seen = hits.states_of(row)
        window = make_windows(seen.centers, seen.quaternions, [exit_frame], config.window)
        best = search(window, library_windows([track], config.window)).best
        fits.append(_fit(hits, row, best.error, exit_frame, first + best.entry_frame))
    return fits


def align_base_motions(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[BaseMotionFit]:
    """The same except for rounding, in a tenth of the time: no windows are cut for a search.

    Args:
        character: The character.
        config: Settings.
        hits: Simulated hits.
    """
    fits, window = [], config.window
    for row, (track, exit_frame, first) in enumerate(_base_tracks(character, config, hits)):
        seen = hits.states_of(row)
        room = len(track.positions) - window.window_frames + 1
        entries = np.arange(0, room, window.entry_step)
        exit_s = exit_frame / window.fps
        aligner = Aligner([track], replace(window, exit_min_s=exit_s, exit_max_s=exit_s))
        errors = aligner.errors(seen.centers, seen.quaternions, CARRY_ON, exit_frame, entries)
        best = int(errors.argmin())
        entry = first + int(entries[best])
        fits.append(_fit(hits, row, float(errors[best]), exit_frame, entry))
    return fits


def _base_tracks(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[tuple[ReactionTrack, int, int]]:
    """For each hit the base motion around its exit, the exit, and the track's first frame."""
    if not len(hits):
        return []
    window = config.window
    slack = round(CARRY_ON_SLACK_S * window.fps)
    exits_s = np.where(hits.grazes, window.exit_min_s, CARRY_ON_EXIT_S)
    exits = np.round(exits_s * window.fps).astype(np.intp)
    firsts = hits.contacts + exits - slack
    frames = firsts[:, None] + np.arange(2 * slack + window.window_frames)
    own = kinematics_of_many(character, base_poses(hits.bases, frames))
    tracks = [
        ReactionTrack(CARRY_ON, *states)
        for states in zip(own.centers, own.quaternions, strict=True)
    ]
    return list(zip(tracks, exits.tolist(), firsts.tolist(), strict=True))


def _fit(hits: LookAhead, row: int, error: float, exit_frame: int, entry: int) -> BaseMotionFit:
    # A base motion that has ended holds its last pose.
    return BaseMotionFit(error, exit_frame, min(max(entry, 0), len(hits.bases[row]) - 1))
