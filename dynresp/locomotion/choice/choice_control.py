"""The avatar under control by choice: it acts as chosen, or walks on (Lee et al. 2002, 5.1)."""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.choice.actions import OfferedAction
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component, random_walk
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError


class ChoiceControl:
    """Frames to play: of the action that was chosen, and otherwise by probability.

    Attributes:
        frame: The frame it is at.
    """

    def __init__(self, graph: MotionGraph, frame: int, rng: np.random.Generator) -> None:
        """Begin at a frame.

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

    def take(self, choice: OfferedAction) -> None:
        """Do this from now on; it replaces what was chosen before.

        Args:
            choice: Offered at the frame at hand, or a little earlier while the avatar has gone
                along its way.

        Raises:
            UsageError: The avatar is not on the way of the action.
        """
        way = np.concatenate([[choice.start], choice.frames])
        at = np.flatnonzero(way == self.frame)
        if len(at) == 0:
            raise UsageError(
                f"the action begins at frame {choice.start} and does not come through frame "
                f"{self.frame}, where the avatar is; ask for choices at that frame"
            )
        self._chosen = choice.frames[at[0] :]

    def advance(self, frames: int) -> IntArray:
        """The next frames to play, (frames,).

        Raises:
            UsageError: No frame was asked for.
        """
        if frames < 1:
            raise UsageError(f"an avatar advances by at least 1 frame, got {frames}")
        played, self._chosen = self._chosen[:frames], self._chosen[frames:]
        if len(played) < frames:
            last = int(played[-1]) if len(played) else self.frame
            on = random_walk(self._graph, frames - len(played), self._rng, start=last)
            played = np.concatenate([played, on])
        self.frame = int(played[-1])
        return played
