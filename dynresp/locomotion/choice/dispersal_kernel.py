"""Compiled step of `dynresp.locomotion.choice.actions`: the candidate least like all offers so far.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import types

from dynresp.support.compiling import compiled

_INTS = types.Array(types.int32, 1, "C", readonly=True)
_TABLE = types.Array(types.float64, 2, "C", readonly=True)


class Candidates(NamedTuple):
    """Where the actions end that may be offered. Read-only.

    Attributes:
        states: (k, 4) planar states of the root at their ends [m, rad].
        clusters: (k,) int32, their clusters.
        squared_distances: (K, K) of the clusters' means.
    """

    states: Any
    clusters: Any
    squared_distances: Any


_CANDIDATES = types.NamedTuple((_TABLE, _INTS, _TABLE), Candidates)


@compiled(
    types.int64(_CANDIDATES, types.float64[::1], types.int64, types.float64, types.float64[::1]),
    error_model="numpy",
)
def least_alike_kernel(candidates, end, cluster, turn_m, nearest):
    """Update the distances to the nearest offered action with one more action.

    Args:
        candidates: The actions that may be offered.
        end: (4,) planar state where the additional action ends.
        cluster: Its cluster.
        turn_m: Distance that facing the opposite way counts as [m].
        nearest: In and out, (k,) distance of each candidate to the nearest offered action.

    Returns:
        The first of the candidates whose distance is the greatest.
    """
    best = 0
    states, clusters = candidates.states, candidates.clusters
    for k in range(len(clusters)):
        x, y = states[k, 0] - end[0], states[k, 1] - end[1]
        # Half of the circle's chord from one heading to the other.
        chord = turn_m * math.sin(0.5 * (states[k, 3] - end[3]))
        squared = x * x + y * y + chord * chord
        squared += candidates.squared_distances[clusters[k], cluster]
        nearest[k] = min(nearest[k], math.sqrt(squared))
        if nearest[k] > nearest[best]:
            best = k
    return best
