"""Averages and covers of curves, computed frame by frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence


def _hann(half: int) -> list[float]:
    weights = [0.5 + 0.5 * math.cos(math.pi * k / (half + 1)) for k in range(-half, half + 1)]
    return [weight / sum(weights) for weight in weights]


def _averaged(value: Callable[[int], float], n: int, half: int) -> list[float]:
    weights = _hann(half)
    return [sum(weights[k + half] * value(i + k) for k in range(-half, half + 1)) for i in range(n)]


def average(values: Sequence[float], half: int) -> list[float]:
    """Each value averaged with its neighbours; the ends go on as they are."""
    last = len(values) - 1
    return _averaged(lambda i: values[min(max(i, 0), last)], len(values), half)


def cover(values: Sequence[float], half: int) -> list[float]:
    """The highest value nearby, averaged; the ends go on as they are."""
    last = len(values) - 1
    return _averaged(
        lambda i: max(values[min(max(i + k, 0), last)] for k in range(-half, half + 1)),
        len(values),
        half,
    )
