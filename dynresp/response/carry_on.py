"""Going on with the base motion: how well it fits after a hit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynresp.motion.character import Character
from dynresp.response.look_ahead import LookAhead, base_poses, kinematics_of_many
from dynresp.response.oracle import OracleResult, search
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.windows import ReactionTrack, library_windows, make_windows


def search_base_motions(
    character: Character, config: ResponseConfig, hits: LookAhead, rows: Sequence[int]
) -> list[tuple[OracleResult, int]]:
    """Search base motions around the moments at which they must fit.

    That is `carry_on_exit_s` after contact, and after a graze the earliest exit; entered by the
    clock, or up to `carry_on_slack_s` earlier or later.

    Args:
        character: The character.
        config: Settings.
        hits: Simulated hits.
        rows: Which of them.

    Returns:
        For each what the search found, and the frame of the base motion to enter. Each is bitwise
        what it would be alone.
    """
    if not len(rows):
        return []
    window = config.window
    slack = round(config.carry_on_slack_s * window.fps)
    at = np.asarray(rows)
    leaves_s = np.where(hits.grazes[at], window.exit_min_s, config.carry_on_exit_s)
    leaves = np.round(leaves_s * window.fps).astype(np.intp)
    firsts = hits.contacts[at] + leaves - slack
    near = firsts[:, None] + np.arange(2 * slack + window.window_frames)
    bases = [hits.bases[row] for row in rows]
    own = kinematics_of_many(character, base_poses(bases, near))
    results = []
    for k, row in enumerate(rows):
        track = ReactionTrack(CARRY_ON, own.centers[k], own.quaternions[k])
        simulated = hits.states.centers[row], hits.states.quaternions[row]
        late = make_windows(*simulated, [int(leaves[k])], window)
        found = search(late, library_windows([track], window))
        # A base motion that has ended holds its last pose.
        entry = int(firsts[k]) + found.best.entry_frame
        results.append((found, min(max(entry, 0), len(bases[k]) - 1)))
    return results
