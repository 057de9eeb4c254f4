"""Compiled loop of the third pruning rule: local maxima of the transition matrix.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

from numba import types

from dynresp.support.compiling import compiled

_SIGNATURE = types.void(
    types.int64,
    types.Array(types.int64, 1, "C", readonly=True),
    types.Array(types.int32, 1, "C", readonly=True),
    types.Array(types.float32, 1, "C", readonly=True),
    types.Array(types.int32, 1, "C", readonly=True),
    types.boolean[::1],
)


@compiled(_SIGNATURE)
def keep_best_of_neighbours(first, offsets, columns, distances, clip_of, keep):
    """Mark the pairs that have no better neighbour in the matrix.

    Neighbours of (i, j) are the up to eight given pairs (i', j') with |i' - i| <= 1 and
    |j' - j| <= 1 in the same clips. A neighbour is better if its distance is smaller, or equal and
    (i', j') < (i, j).

    Args:
        first: Frame i of the first row.
        offsets: (rows + 1,) where each row's pairs begin.
        columns: (pairs,) frames j, ascending in a row.
        distances: (pairs,) distance of each pair.
        clip_of: (n,) clip of each frame.
        keep: Out, (pairs,) whether each pair has no better neighbour.
    """
    rows = len(offsets) - 1
    keep[:] = True
    for r in range(rows):
        i = first + r
        for other in range(max(r - 1, 0), min(r + 2, rows)):
            if clip_of[first + other] != clip_of[i]:
                continue
            at, stop = offsets[other], offsets[other + 1]
            for pair in range(offsets[r], offsets[r + 1]):
                j = columns[pair]
                while at < stop and columns[at] < j - 1:
                    at += 1
                near = at
                while near < stop and columns[near] <= j + 1:
                    is_earlier = other < r or (other == r and columns[near] < j)
                    closer = distances[near] < distances[pair]
                    level = distances[near] == distances[pair]
                    if clip_of[columns[near]] == clip_of[j] and (closer or (level and is_earlier)):
                        keep[pair] = False
                    near += 1
