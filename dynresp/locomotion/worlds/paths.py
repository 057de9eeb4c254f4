"""Paths over the ground: check and resample them, and measure distances to them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

MAX_LENGTH_M = 1_000.0
"""Largest length of a path [m]: walking a kilometre takes a quarter of an hour, and fitting it
between obstacles takes about 1 GB."""

# The nearest point of a path is searched this far ahead of that of the last frame: at least the
# first number [m], so that a bend may be cut, else as far as this speed leads [m/s]. At the end of
# a spike an avatar can turn back at most half of this distance early.
_MIN_WINDOW_M, _MAX_SPEED = 0.4, 6.0


def window_m(fps: float) -> float:
    """Largest distance along a path from one frame to the next [m].

    Args:
        fps: Frame rate [1/s].
    """
    return max(_MIN_WINDOW_M, _MAX_SPEED / fps)


def as_path(path: npt.ArrayLike, what: str = "a path") -> FloatArray:
    """The corners (k, 2) of a path [m].

    Args:
        path: What the user gave.
        what: Its name in messages.

    Raises:
        UsageError: It has another shape, no corner, or a number that is not finite.
    """
    points = _floats(path, f"{what} must be points (k, 2)")
    if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0:
        raise UsageError(f"{what} must be points (k, 2), got {points.shape}")
    if not np.isfinite(points).all():
        raise UsageError(f"{what} must have finite points")
    return points


def as_point(point: npt.ArrayLike, what: str) -> FloatArray:
    """A point on the ground (2,) [m].

    Args:
        point: What the user gave.
        what: Its name in messages.

    Raises:
        UsageError: It is not two finite numbers.
    """
    expected = f"{what} must be two finite numbers, x and y [m]"
    numbers = _floats(point, expected)
    if numbers.shape != (2,) or not np.isfinite(numbers).all():
        raise UsageError(f"{expected}, got {np.array2string(numbers, threshold=8)}")
    return numbers


def check_length(path: FloatArray, what: str) -> None:
    """Refuse a path (k, 2) that is longer than `MAX_LENGTH_M`.

    Args:
        path: Its corners [m].
        what: Its name in the message.

    Raises:
        UsageError: It is too long.
    """
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    if length > MAX_LENGTH_M:
        raise UsageError(
            f"{what} is {length:g} m long; at most {MAX_LENGTH_M:g} m are allowed, so cut it into "
            "pieces or choose a nearer goal"
        )


def resampled(path: npt.ArrayLike, spacing: float) -> FloatArray:
    """Points along a path at equal distances.

    Args:
        path: (k, 2) corners of the path [m].
        spacing: Distance between the points, measured along the path, about [m].

    Returns:
        (n, 2), with the first and the last point; one point if the path has no length.

    Raises:
        UsageError: The path has another shape, no point, or numbers that are not finite.
    """
    points = as_path(path)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    if along[-1] == 0.0:
        return points[:1].copy()
    at = np.linspace(0.0, along[-1], max(2, round(along[-1] / spacing) + 1))
    return np.stack([np.interp(at, along, points[:, axis]) for axis in range(2)], axis=1)


def distances_to(path: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of points (n, 2) to the nearest point of a path (p, 2), p at least 2 [m]."""
    along = np.diff(path, axis=0)
    square = np.maximum(np.sum(along**2, axis=1), 1e-18)
    nearest = np.full(len(points), np.inf)
    for corner, edge, length in zip(path, along, square, strict=False):
        away = points - corner
        share = np.clip(away @ edge / length, 0.0, 1.0)
        np.minimum(nearest, np.hypot(*(away - share[:, None] * edge).T), out=nearest)
    return nearest


def _floats(given: npt.ArrayLike, expected: str) -> FloatArray:
    """What the user gave, as numbers."""
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise UsageError(f"{expected}, got {str(given)[:60]!r}") from None
