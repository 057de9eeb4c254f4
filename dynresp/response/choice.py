"""What was decided for one hit: how it goes on, from when and from where."""

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
    """A reaction, or to carry on with the base motion, and its timing.

    Attributes:
        name: Name of the reaction, or `CARRY_ON`.
        motion: Its clip, or the base motion; read between its frames where there is an offset.
        exit: Frame after contact at which the simulation is left.
        entry: Frame of the motion that is entered.
        offset: How much later than in the clip the motion's frames are, a part of a frame.
        error: Window error there [m].
        errors: Window error [m] of everything that was aligned, by name.
    """

    name: str
    motion: Motion
    exit: int
    entry: int
    error: float
    errors: dict[str, float]
    offset: float = 0.0


class Chooser(Protocol):
    """What decides how hits go on.

    Attributes:
        character: Whom it chooses for.
        library: What it chooses from.
        config: Settings; those of whoever simulates the hits are the same.
    """

    character: Character
    library: ReactionLibrary
    config: ResponseConfig

    def choose(self, hits: LookAhead) -> list[Choice]:
        """Choose for each hit."""
