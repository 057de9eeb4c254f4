"""What is asked of an avatar that goes somewhere."""

from __future__ import annotations

from dataclasses import dataclass

from dynresp.motion.rotations import FloatArray


@dataclass(frozen=True, eq=False)
class Asked:
    """Where to go.

    Attributes:
        path: (k, 2) corners of the path to walk along [m]; None for none.
        goal: Where to go instead [m].
        start: Where it begins [m]; None for where the path does.
        maze: Whether it goes through a random maze; without path or goal from corner to corner.
        seed: Of the maze, or of the terrain.
    """

    path: FloatArray | None = None
    goal: tuple[float, float] | None = None
    start: tuple[float, float] | None = None
    maze: bool = False
    seed: int = 0
