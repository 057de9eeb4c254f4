"""Smoothing curves over time: averages, and smooth curves that stay above the values."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def average(values: npt.NDArray[np.float64], half: int) -> npt.NDArray[np.float64]:
    """Values (n,) or (n, columns) averaged over `half` frames to each side, with a Hann window.

    The first and last value go on beyond the ends.
    """
    if values.ndim == 2:
        return np.stack([average(column, half) for column in values.T], axis=1)
    return np.convolve(np.pad(values, half, mode="edge"), _window(half), mode="valid")


def cover(values: npt.NDArray[np.float64], half: int) -> npt.NDArray[np.float64]:
    """A smooth curve on or above the values (n,).

    The highest value within `half` frames, then averaged over them with a Hann window. The first
    and last value go on beyond the ends.
    """
    padded = np.pad(values, 2 * half, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).max(axis=1)
    return np.convolve(highest, _window(half), mode="valid")


def _window(half: int) -> npt.NDArray[np.float64]:
    """Hann weights (2 half + 1,) that sum to one."""
    window = np.hanning(2 * half + 3)[1:-1]
    return window / window.sum()
