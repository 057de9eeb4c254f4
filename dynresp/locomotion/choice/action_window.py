"""Where and when the actions may end that a user is offered (Lee et al. 2002, figure 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError


class Area(Protocol):
    """A piece of ground."""

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] lie in it."""
        ...


@dataclass(frozen=True)
class Disc:
    """The ground up to a radius around a point [m]."""

    x: float
    y: float
    radius: float

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] lie in it."""
        inside: BoolArray = np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) <= self.radius
        return inside


@dataclass(frozen=True)
class Box:
    """The ground between two corners [m], along the world's axes."""

    low: tuple[float, float]
    high: tuple[float, float]

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] lie in it."""
        inside: BoolArray = np.all((points >= self.low) & (points <= self.high), axis=1)
        return inside


@dataclass(frozen=True)
class ChoiceWindow:
    """Which actions are offered.

    Attributes:
        wanted: How many; the paper offers three or four.
        least_s: Soonest that an action may begin to be what it is, its cluster entered [s].
        most_s: Latest that it may end [s]. None for 4 s, and where fewer than three actions are
            found so near, half as far again and again, up to the whole tree.
        area: Where it may end, in the world; None for anywhere.
    """

    wanted: int = 4
    least_s: float = 0.3
    most_s: float | None = None
    area: Area | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: They make no sense.
        """
        if self.wanted < 1:
            raise UsageError(f"wanted must be 1 or more, got {self.wanted}")
        if not 0.0 <= self.least_s < np.inf:
            raise UsageError(f"least_s must be 0 or more, got {self.least_s}")
        if self.most_s is not None and not self.least_s < self.most_s < np.inf:
            raise UsageError(f"most_s must be above least_s = {self.least_s}, got {self.most_s}")
