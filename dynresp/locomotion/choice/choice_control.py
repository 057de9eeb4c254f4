"""Play the action that a user chose, else a random walk (Lee et al. 2002, section 5.1)."""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.choice.actions import OfferedAction
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component, random_walk
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError


class ChoiceControl:
    """The frames that an avatar plays: those of the chosen action, else of a random walk.

    Attributes:
        frame: The avatar's frame.
    """

    def __init__(self, graph: MotionGraph, frame: int, rng: np.random.Generator) -> None:
        """Start at a frame.

        Raises:
            UsageError: The frame is not in the graph's component.
        """
        check_in_component(graph, frame)
        self.frame = frame
        self._graph = graph
        self._rng = rng
        self._chosen = np.empty(0, dtype=np.int32)

    @property
    def is_acting(self) -> bool:
        """Whether frames of a chosen action are still to come."""
        return len(self._chosen) > 0

    def take(self, action: OfferedAction) -> None:
        """Play an action from now on, in place of the one before.

        Args:
            action: Offered at the avatar's frame, or shortly before if the avatar has stayed on the
                frames of the action since then.

        Raises:
            UsageError: The avatar's frame is not one of the action.
        """
        frames = np.concatenate([[action.start], action.frames])
        at = np.flatnonzero(frames == self.frame)
        if len(at) == 0:
            raise UsageError(
                f"the action starts at frame {action.start} and does not contain frame "
                f"{self.frame}, where the avatar is; call offer_actions for that frame"
            )
        self._chosen = action.frames[at[0] :]

    def advance(self, frames: int) -> IntArray:
        """The next frames to play, (frames,).

        Raises:
            UsageError: `frames` is below 1.
        """
        if frames < 1:
            raise UsageError(f"an avatar advances by at least 1 frame, got {frames}")
        played, self._chosen = self._chosen[:frames], self._chosen[frames:]
        if len(played) < frames:
            last = int(played[-1]) if len(played) else self.frame
            walk = random_walk(self._graph, frames - len(played), self._rng, start=last)
            played = np.concatenate([played, walk])
        self.frame = int(played[-1])
        return played
