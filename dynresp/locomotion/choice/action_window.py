"""Limits on the actions that a user is offered: how many, when and where (Lee et al. 2002, fig. 6).

A window in time and an area of the ground select the actions of control by choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.checks import check_number


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
        check_number("count", self.count, 1, whole=True)
        check_number("earliest_s", self.earliest_s, 0.0, unit="s")
        if self.latest_s is not None:
            check_number("latest_s", self.latest_s, self.earliest_s, unit="s", above_low=True)
