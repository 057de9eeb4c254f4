"""The compiled part of dynamic time warping.

Importing this module compiles it (about a second) or loads it from numba's cache; import it where
it is used.
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
    """Warp one sequence onto each of many; see `warping.warp_onto`.

    Args:
        first: (m, d), m at least 1.
        rows: (total, d) the others, end to end.
        offsets: (k + 1,) where each begins; none is empty.
        open_end: Whether rows at the end of the others may stay unmatched.
        costs: Out, (k,).
        stops: Out, (k,) how many rows of each are matched.
    """
    longest = 0
    for k in range(len(costs)):
        longest = max(longest, offsets[k + 1] - offsets[k])
    # reached[j]: least cost of matching the rows of `first` so far with the first j + 1 others.
    reached = np.empty(longest)
    for k in range(len(costs)):
        start, size = offsets[k], offsets[k + 1] - offsets[k]
        for i in range(len(first)):
            corner = math.inf
            if i == 0:
                corner = 0.0
            left = math.inf
            for j in range(size):
                apart = 0.0
                for c in range(first.shape[1]):
                    difference = first[i, c] - rows[start + j, c]
                    apart += difference * difference
                above = math.inf
                if i > 0:
                    above = reached[j]
                left = math.sqrt(apart) + min(corner, min(above, left))
                reached[j] = left
                corner = above
        stop = size - 1
        if open_end:
            for j in range(size - 1, -1, -1):
                if reached[j] <= reached[stop]:
                    stop = j
        costs[k] = reached[stop]
        stops[k] = stop + 1
