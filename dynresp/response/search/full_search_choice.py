"""Choose by full search (oracle): compare all reactions and the base motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.response.choice import Choice
from dynresp.response.look_ahead import LookAhead
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.search.carry_on import BaseMotionFit, search_base_motions
from dynresp.response.search.full_search import FullSearchResult, search
from dynresp.response.windows.windows import (
    LibraryWindows,
    ReactionTrack,
    library_windows,
    make_many_windows,
)


@dataclass(frozen=True)
class FullSearchAnswer:
    """What the full search found for one hit.

    Attributes:
        reactions: How the reactions fit.
        base_motion: How the base motion fits.
        carries_on: Whether the choice is no reaction (carry on).
    """

    reactions: FullSearchResult
    base_motion: BaseMotionFit
    carries_on: bool


def reaction_tracks(
    character: Character, library: ReactionLibrary, config: ResponseConfig
) -> list[ReactionTrack]:
    """Body states of all reactions, each with its entry range (`entry_range`)."""
    tracks = []
    for reaction in library.reactions:
        states = character.kinematics(reaction.motion.poses)
        bounds = entry_range(len(reaction.motion), config)
        tracks.append(ReactionTrack(reaction.name, states.centers, states.quaternions, bounds))
    return tracks


def entry_range(frames: int, config: ResponseConfig) -> tuple[int, int]:
    """Entries [first, last) into a reaction of so many frames.

    From the first frame to `entry_max_s`, if `remaining_s`, a blend and a window still follow.
    """
    fps = config.physics.fps
    remaining = round(max(config.remaining_s, config.transition.blend_s + 2 / fps) * fps)
    remaining = max(remaining, config.window.window_frames - 1)
    latest = round(config.entry_max_s * fps) + 1
    return 0, max(1, min(latest, frames - remaining))


class FullSearchChooser:
    """Chooses by full search (Zordan et al. 2005; 2007, section 4).

    A graze gets no reaction (carry on). Any other hit gets the reaction of the least mismatch
    (window error), unless the base motion fits better and its mismatch is at most
    `ResponseConfig.carry_on_max_error`.
    """

    def __init__(
        self, character: Character, library: ReactionLibrary, config: ResponseConfig
    ) -> None:
        """Cut the library's windows once.

        Raises:
            MotionError: A clip is shorter than a window.
        """
        self.character = character
        self.library = library
        self.config = config
        tracks = reaction_tracks(character, library, config)
        self.windows: LibraryWindows = library_windows(tracks, config.window)

    def choose(self, hits: LookAhead) -> list[Choice]:
        """Choose for each hit."""
        choices = []
        for base, answer in zip(hits.bases, self.answers(hits), strict=True):
            best, base_fit = answer.reactions.best, answer.base_motion
            found = zip(answer.reactions.names, answer.reactions.errors, strict=True)
            errors = {name: float(e) for name, e in found} | {CARRY_ON: base_fit.error}
            if answer.carries_on:
                choice = Choice(
                    CARRY_ON, base, base_fit.exit, base_fit.entry, base_fit.error, errors
                )
            else:
                motion = self.library.reaction(best.reaction).motion
                choice = Choice(
                    best.reaction, motion, best.exit_frame, best.entry_frame, best.error, errors
                )
            choices.append(choice)
        return choices

    def answers(self, hits: LookAhead) -> list[FullSearchAnswer]:
        """Search for each hit; each is bitwise what it would be alone."""
        if not len(hits):
            return []
        window = self.config.window
        traces = make_many_windows(
            hits.states.centers, hits.states.quaternions, window.exit_frames, window
        )
        base_fits = search_base_motions(self.character, self.config, hits)
        answers = []
        for trace, base_fit, graze in zip(traces, base_fits, hits.grazes, strict=True):
            found = search(trace, self.windows)
            limit = min(found.best.error, self.config.carry_on_max_error)
            carries_on = bool(graze) or base_fit.error <= limit
            answers.append(FullSearchAnswer(found, base_fit, carries_on))
        return answers


def choice_columns(
    answers: list[FullSearchAnswer],
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int64], npt.NDArray[np.int64], list[int]]:
    """What the full search found for each hit, as arrays over all classes; the last is carry on.

    Returns:
        Mismatches [m], exits in frames after contact and entry frames, each (hits, reactions + 1),
        and the class chosen for each hit. The entry of carry on is a frame of the base motion.
    """
    errors = [[*a.reactions.errors, a.base_motion.error] for a in answers]
    exits = [[*a.reactions.exit_frames, a.base_motion.exit] for a in answers]
    entries = [[*a.reactions.entry_frames, a.base_motion.entry] for a in answers]
    chosen = [
        len(a.reactions.names)
        if a.carries_on
        else a.reactions.names.index(a.reactions.best.reaction)
        for a in answers
    ]
    return np.array(errors, np.float32), np.array(exits), np.array(entries), chosen
