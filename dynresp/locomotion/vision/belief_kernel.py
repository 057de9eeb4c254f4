"""The compiled step of the belief about what somebody before a camera does.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from dynresp.support.compiling import compiled

_TABLE = types.Array(types.float32, 3, "C", readonly=True)
_ROW = types.Array(types.float32, 1, "C", readonly=True)
_HEADINGS = types.Array(types.uint16, 2, "C", readonly=True)
_PAST = types.Array(types.uint8, 1, "C", readonly=True)
_FREE, _GRID = types.float32[::1], types.float32[:, ::1]
_PACE = types.UniTuple(types.float32, 3)
_SINGLE = types.float32
_SIGNATURE = types.void(
    _TABLE, _ROW, _HEADINGS, _PAST, _FREE, _PACE, _SINGLE, _SINGLE, _GRID, _GRID, _GRID
)  # fmt: skip

# Likelihoods beyond this many powers of e below the best are nothing.
_LEAST = np.float32(60.0)

# The sum of a distance may be spread over the lanes of a vector; there is no NaN in tables.
_FAST = {"contract", "nnan", "nsz", "reassoc"}


@compiled(_SIGNATURE, error_model="numpy", fastmath=_FAST)
def belief_step_kernel(
    table, row, headings, past, fresh, pace, drift, halved, distances, belief, after
):
    """Bring a belief one frame on, and weigh it with what is seen.

    Args:
        table: (n, views, d) what is seen of each frame from each viewpoint.
        row: (d,) what is seen now.
        headings: (n, views) how the person of a frame faces a viewpoint, one of as many directions.
        past: (n,) how many frames of its clip come before each, at most 2.
        fresh: (views,) chance that the person faces so and does something that does not follow
            from what was believed, for each frame.
        pace: Chances that a frame lasts, is followed by the next, or by the next but one.
        drift: Chance that a neighbouring viewpoint fits better than before.
        halved: Half the inverse of the squared distance that is usual between alike moments.
        distances: Scratch, (n, views).
        belief: (n, views) sums to 1.
        after: Out, (n, views).
    """
    n, views, width = table.shape
    nearest = np.float32(math.inf)
    for i in range(n):
        for v in range(views):
            total = np.float32(0.0)
            for k in range(width):
                apart = table[i, v, k] - row[k]
                total += apart * apart
            distances[i, v] = total * halved
            nearest = min(nearest, distances[i, v])
    total_belief = 0.0
    for i in range(n):
        for v in range(views):
            expected = pace[0] * belief[i, v]
            if past[i] >= 1:
                expected += pace[1] * belief[i - 1, v]
            if past[i] >= 2:
                expected += pace[2] * belief[i - 2, v]
            after[i, v] = expected
        first, left = after[i, 0], after[i, views - 1]
        half = np.float32(0.5) * drift
        for v in range(views):
            here = after[i, v]
            right = first
            if v + 1 < views:
                right = after[i, v + 1]
            expected = (np.float32(1.0) - drift) * here + half * (left + right)
            expected += fresh[headings[i, v]]
            left = here
            unlike = distances[i, v] - nearest
            likely = np.float32(0.0)
            if unlike < _LEAST:
                likely = np.float32(math.exp(-unlike))
            after[i, v] = expected * likely
            total_belief += after[i, v]
    scale = np.float32(1.0 / total_belief)
    for i in range(n):
        for v in range(views):
            after[i, v] *= scale
