"""Paths over the ground: checked, resampled, and how far points are from them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

LONGEST_M = 1_000.0
"""How long a path may be [m]: to walk a kilometre takes a quarter of an hour, and to fit it between
obstacles about 1 GB."""

# How far ahead on a path the nearest point is looked for from one frame to the next: at least so
# far [m], so that a bend may be cut, and so fast [m/s]. Who turns back may do so no earlier than
# half of it before the end of a spike.
_LEAST_WINDOW_M, _FASTEST = 0.4, 6.0


def window_m(fps: float) -> float:
    """How far an avatar may come along a path from one frame to the next [m].

    Args:
        fps: Frame rate [1/s].
    """
    return max(_LEAST_WINDOW_M, _FASTEST / fps)


def as_path(path: npt.ArrayLike, what: str = "a path") -> FloatArray:
    """The corners (k, 2) of a path [m].

    Args:
        path: What was given.
        what: What it is called in messages.

    Raises:
        UsageError: It is no such array, has no corner, or numbers that are not finite.
    """
    points = _floats(path, f"{what} must be points (k, 2)")
    if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0:
        raise UsageError(f"{what} must be points (k, 2), got {points.shape}")
    if not np.isfinite(points).all():
        raise UsageError(f"{what} must have finite points")
    return points


def as_place(place: npt.ArrayLike, what: str) -> FloatArray:
    """A place on the ground (2,) [m].

    Args:
        place: What was given.
        what: What it is called in messages.

    Raises:
        UsageError: It is not two finite numbers.
    """
    expected = f"{what} must be two finite numbers, x and y [m]"
    point = _floats(place, expected)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise UsageError(f"{expected}, got {np.array2string(point, threshold=8)}")
    return point


def check_length(path: FloatArray, what: str) -> None:
    """Refuse a path (k, 2) that is longer than `LONGEST_M`.

    Args:
        path: Its corners [m].
        what: What it is called in the message.

    Raises:
        UsageError: It is too long.
    """
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    if length > LONGEST_M:
        raise UsageError(
            f"{what} is {length:g} m long; at most {LONGEST_M:g} m are allowed, so cut it into "
            "pieces or choose a nearer place"
        )


def resampled(path: npt.ArrayLike, spacing: float) -> FloatArray:
    """Points along a path at equal distances.

    Args:
        path: (k, 2) corners of the path [m].
        spacing: About how far the points are to be from each other, measured along it [m].

    Returns:
        (n, 2), the first and the last point kept; one point where the path has no length.

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
    """Distance of points (n, 2) to the nearest place on a path (p, 2), p at least 2 [m]."""
    along = np.diff(path, axis=0)
    square = np.maximum(np.sum(along**2, axis=1), 1e-18)
    nearest = np.full(len(points), np.inf)
    for corner, way, length in zip(path, along, square, strict=False):
        away = points - corner
        share = np.clip(away @ way / length, 0.0, 1.0)
        np.minimum(nearest, np.hypot(*(away - share[:, None] * way).T), out=nearest)
    return nearest


def _floats(given: npt.ArrayLike, expected: str) -> FloatArray:
    """What was given, as numbers."""
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise UsageError(f"{expected}, got {str(given)[:60]!r}") from None
