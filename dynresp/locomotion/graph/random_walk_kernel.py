"""Compiled loop of random walks.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

from numba import types

from dynresp.support.compiling import compiled

_OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
_TARGETS = types.Array(types.int32, 1, "C", readonly=True)
_FLOATS = types.Array(types.float64, 1, "C", readonly=True)
_SIGNATURE = types.void(_OFFSETS, _TARGETS, _FLOATS, _FLOATS, types.int32[::1])


@compiled(_SIGNATURE)
def walk_kernel(offsets, targets, cumulative, chances, path):
    """Write a random walk.

    Args:
        offsets: (n + 1,) where the transitions of each frame begin.
        targets: (m,) the frame to which each transition leads.
        cumulative: (m,) cumulative probabilities of each frame's transitions; the last is 1.
        chances: (k,) random numbers in [0, 1).
        path: In and out, (k + 1,). Its first frame is given; the others are written.
    """
    for k in range(len(chances)):
        low, high = offsets[path[k]], offsets[path[k] + 1] - 1
        # The first transition whose cumulative probability is above the number.
        while low < high:
            middle = (low + high) // 2
            if chances[k] < cumulative[middle]:
                high = middle
            else:
                low = middle + 1
        path[k + 1] = targets[low]
