"""The state of an avatar: its frame in a graph and its placement in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError


@dataclass(frozen=True, eq=False)
class AvatarState:
    """The frame and placement of an avatar, from which searches for a path start.

    Attributes:
        frame: Its frame.
        placement: (4,) of the frame's clip; see `dynresp.locomotion.graph.placement`.
        displacement: (91,) what remains of blends; see `Playback.displacement`. None if the frame
            was played as recorded.
    """

    frame: int
    placement: FloatArray
    displacement: FloatArray | None = None

    @classmethod
    def at(cls, graph: MotionGraph, frame: int, x: float, y: float, yaw: float) -> AvatarState:
        """The state whose root has a given position and yaw.

        Args:
            graph: The graph.
            frame: The frame.
            x: Position of its root [m].
            y: Position of its root [m].
            yaw: Yaw of its root [rad].

        Raises:
            UsageError: The graph has no such frame, or a number is not finite.
        """
        try:
            where = np.array([x, y, 0.0, yaw], dtype=np.float64)
            number = int(frame)
            is_right = bool(np.isfinite(where).all()) and number == frame
        except (TypeError, ValueError, OverflowError):
            is_right = False
        if not is_right:
            raise UsageError(
                f"a state needs a frame, and finite x, y [m] and yaw [rad], got {frame!r}, {x!r}, "
                f"{y!r} and {yaw!r}"
            )
        if not 0 <= number < len(graph.database):
            raise UsageError(f"the graph has frames 0 to {len(graph.database) - 1}, got {frame}")
        root = graph.database.planar[number]
        where[2] = root[2]
        return cls(number, placement.compose(where, placement.inverse(root)))

    def root(self, graph: MotionGraph) -> FloatArray:
        """(4,) x, y, z and yaw of the root."""
        return placement.compose(self.placement, graph.database.planar[self.frame])
