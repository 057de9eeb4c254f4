"""Dynamic time warping as its definition has it: every way of matching is tried, slowly."""

import functools

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def warp(first: FloatArray, second: FloatArray, open_end: bool) -> tuple[float, int]:
    """Least sum of distances, and how many rows of the second are matched (the fewest)."""

    @functools.cache
    def upto(i: int, j: int) -> float:
        here = float(np.sqrt(np.sum((first[i] - second[j]) ** 2)))
        before = [(i - 1, j), (i, j - 1), (i - 1, j - 1)]
        ways = [upto(*pair) for pair in before if min(pair) >= 0]
        return here + min(ways, default=0.0)

    ends = range(len(second)) if open_end else [len(second) - 1]
    costs = [upto(len(first) - 1, j) for j in ends]
    best = int(np.argmin(costs))
    return costs[best], ends[best] + 1
