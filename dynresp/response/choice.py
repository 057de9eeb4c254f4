"""A choice for one hit (reaction, exit, entry), and what every chooser must offer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.response.look_ahead import LookAhead
from dynresp.response.response import ResponseConfig


@dataclass(frozen=True)
class Choice:
    """A reaction, or no reaction (carry on), with exit and entry.

    Attributes:
        name: Name of the reaction, or `CARRY_ON`.
        motion: Its clip, or the base motion; with an offset, sampled between the clip's frames.
        exit: Frame after contact.
        entry: Frame of the motion.
        error: Mismatch (window error) there [m].
        errors: Mismatch [m] of everything that was compared, by name.
        offset: How much later the motion was sampled than the clip's frames, 0 to 1 frame.
    """

    name: str
    motion: Motion
    exit: int
    entry: int
    error: float
    errors: dict[str, float]
    offset: float = 0.0


class Chooser(Protocol):
    """Chooses a reaction for each hit.

    Attributes:
        character: The character that is hit.
        library: The reactions.
        config: Settings; the hits must be simulated with the same.
    """

    character: Character
    library: ReactionLibrary
    config: ResponseConfig

    def choose(self, hits: LookAhead) -> list[Choice]:
        """Choose for each hit."""
