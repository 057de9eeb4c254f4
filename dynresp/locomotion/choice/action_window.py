"""Limits on the actions that a user is offered: how many, when and where (Lee et al. 2002, fig. 6).

A window in time and an area of the ground select the actions of control by choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError


class Area(Protocol):
    """An area of the ground."""

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] are inside."""
        ...


@dataclass(frozen=True)
class Disc:
    """The ground up to a radius around a point [m]."""

    x: float
    y: float
    radius: float

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] are inside."""
        inside: BoolArray = np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) <= self.radius
        return inside


@dataclass(frozen=True)
class Box:
    """The ground between two corners [m], along the world's axes."""

    low: tuple[float, float]
    high: tuple[float, float]

    def contains(self, points: FloatArray) -> BoolArray:
        """(k,) which of the points (k, 2) [m] are inside."""
        inside: BoolArray = np.all((points >= self.low) & (points <= self.high), axis=1)
        return inside


@dataclass(frozen=True)
class ActionWindow:
    """Which actions are offered.

    Attributes:
        count: How many, at least 1; the paper offers three or four.
        earliest_s: Soonest time at which an action may enter its cluster, at least 0 [s].
        latest_s: Latest time at which it may end, above `earliest_s` [s]. None starts with 4 s and
            extends that by half, up to the whole tree, until three actions are found.
        area: Where it may end, in the world; None for anywhere.

    Raises:
        UsageError: A number is out of range.
    """

    count: int = 4
    earliest_s: float = 0.3
    latest_s: float | None = None
    area: Area | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.count < 1:
            raise UsageError(f"count must be 1 or more, got {self.count}")
        if not 0.0 <= self.earliest_s < np.inf:
            raise UsageError(f"earliest_s must be 0 or more, got {self.earliest_s}")
        if self.latest_s is not None and not self.earliest_s < self.latest_s < np.inf:
            raise UsageError(
                f"latest_s must be above earliest_s = {self.earliest_s}, got {self.latest_s}"
            )
