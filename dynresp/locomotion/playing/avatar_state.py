"""Where an avatar is in a graph and in the world: where searches for a way begin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError


@dataclass(frozen=True, eq=False)
class AvatarState:
    """Where an avatar is.

    Attributes:
        frame: The frame it is at.
        placement: (4,) where that frame's clip is put; see `dynresp.locomotion.graph.placement`.
        displacement: (91,) what is left of blends: the displacement at the last jump (45), its
            rate of change then (45) and the time since [s]; see `displacement_kernel`. None where
            the frame was played as recorded.
    """

    frame: int
    placement: FloatArray
    displacement: FloatArray | None = None

    @classmethod
    def at(cls, graph: MotionGraph, frame: int, x: float, y: float, yaw: float) -> AvatarState:
        """The state in which a frame's root is somewhere.

        Args:
            graph: Whose frame.
            frame: The frame.
            x: Where its root is [m].
            y: The same.
            yaw: Where it faces [rad].

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
