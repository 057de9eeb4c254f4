"""The compiled loop of `dynresp.locomotion.vision.time_warping`.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from dynresp.support.compiling import compiled

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_ENDS = types.Array(types.int64, 1, "C", readonly=True)
_SIGNATURE = types.void(
    _ROWS, _ROWS, _ENDS, types.boolean, types.float64[::1], types.int64[::1]
)  # fmt: skip


@compiled(_SIGNATURE)
def warp_kernel(first, rows, offsets, open_end, costs, stops):
    """Warp one sequence onto each of many; see `time_warping.warp_onto`.

    Args:
        first: (m, d), m at least 1.
        rows: (total, d) the candidates, one after the other.
        offsets: (k + 1,) where each candidate begins, and the last ends; none is empty.
        open_end: Whether rows at the end of the candidates may stay unmatched.
        costs: Out, (k,) sums of distances over the matched pairs of rows.
        stops: Out, (k,) how many rows of each candidate are matched.
    """
    longest = 0
    for k in range(len(costs)):
        longest = max(longest, offsets[k + 1] - offsets[k])
    # reached[j]: least cost of matching `first` so far with the candidate's first j + 1 rows.
    reached = np.empty(longest)
    for k in range(len(costs)):
        start, size = offsets[k], offsets[k + 1] - offsets[k]
        for i in range(len(first)):
            corner = math.inf
            if i == 0:
                corner = 0.0
            left = math.inf
            for j in range(size):
                squared = 0.0
                for c in range(first.shape[1]):
                    difference = first[i, c] - rows[start + j, c]
                    squared += difference * difference
                above = math.inf
                if i > 0:
                    above = reached[j]
                left = math.sqrt(squared) + min(corner, min(above, left))
                reached[j] = left
                corner = above
        stop = size - 1
        if open_end:
            for j in range(size - 1, -1, -1):
                if reached[j] <= reached[stop]:
                    stop = j
        costs[k] = reached[stop]
        stops[k] = stop + 1
