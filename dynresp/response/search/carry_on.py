"""Going on with the base motion: how well it fits after a hit.

It must fit `carry_on_exit_s` after contact, and after a graze at the earliest exit; entered by the
clock, or up to `carry_on_slack_s` earlier or later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynresp.motion.character import Character
from dynresp.response.alignment.alignment import Aligner
from dynresp.response.look_ahead import LookAhead, base_poses, kinematics_of_many
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.search.full_search import search
from dynresp.response.windows.windows import ReactionTrack, library_windows, make_windows


@dataclass(frozen=True)
class BaseMotionFit:
    """How the base motion fits a hit.

    Attributes:
        error: Least window error [m].
        exit: Frame after contact at which the simulation would be left.
        entry: Frame of the base motion that would be entered.
    """

    error: float
    exit: int
    entry: int


def search_base_motions(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[BaseMotionFit]:
    """Fit base motions as the oracle does; each with the bits it would have alone.

    Args:
        character: The character.
        config: Settings.
        hits: Simulated hits.
    """
    fits = []
    for row, (track, leave, first) in enumerate(_near(character, config, hits)):
        seen = hits.states_of(row)
        late = make_windows(seen.centers, seen.quaternions, [leave], config.window)
        best = search(late, library_windows([track], config.window)).best
        fits.append(_fit(hits, row, best.error, leave, first + best.entry_frame))
    return fits


def align_base_motions(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[BaseMotionFit]:
    """The same, but for rounding, in a tenth of the time: without cutting windows for a search.

    Args:
        character: The character.
        config: Settings.
        hits: Simulated hits.
    """
    fits, window = [], config.window
    for row, (track, leave, first) in enumerate(_near(character, config, hits)):
        seen = hits.states_of(row)
        room = len(track.positions) - window.window_frames + 1
        entries = np.arange(0, room, window.entry_step)
        leave_s = leave / window.fps
        aligner = Aligner([track], replace(window, exit_min_s=leave_s, exit_max_s=leave_s))
        errors = aligner.errors(seen.centers, seen.quaternions, CARRY_ON, leave, entries)
        best = int(errors.argmin())
        entry = first + int(entries[best])
        fits.append(_fit(hits, row, float(errors[best]), leave, entry))
    return fits


def _near(
    character: Character, config: ResponseConfig, hits: LookAhead
) -> list[tuple[ReactionTrack, int, int]]:
    """For each hit the base motion around that moment, the exit, and its first frame."""
    if not len(hits):
        return []
    window = config.window
    slack = round(config.carry_on_slack_s * window.fps)
    leaves_s = np.where(hits.grazes, window.exit_min_s, config.carry_on_exit_s)
    leaves = np.round(leaves_s * window.fps).astype(np.intp)
    firsts = hits.contacts + leaves - slack
    frames = firsts[:, None] + np.arange(2 * slack + window.window_frames)
    own = kinematics_of_many(character, base_poses(hits.bases, frames))
    tracks = [
        ReactionTrack(CARRY_ON, *states)
        for states in zip(own.centers, own.quaternions, strict=True)
    ]
    return list(zip(tracks, leaves.tolist(), firsts.tolist(), strict=True))


def _fit(hits: LookAhead, row: int, error: float, leave: int, entry: int) -> BaseMotionFit:
    # A base motion that has ended holds its last pose.
    return BaseMotionFit(error, leave, min(max(entry, 0), len(hits.bases[row]) - 1))
