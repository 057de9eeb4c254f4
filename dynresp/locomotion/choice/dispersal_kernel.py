"""The compiled step of dispersing: how near candidates are to what is offered, and the farthest.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used.
"""

from __future__ import annotations

import math

from numba import types

from dynresp.support.compiling import compiled

_INTS = types.Array(types.int32, 1, "C", readonly=True)
_TABLE = types.Array(types.float64, 2, "C", readonly=True)
_SIGNATURE = types.int64(
    _TABLE, _INTS, _TABLE, types.float64[::1], types.int64, types.float64, types.float64[::1]
)


@compiled(_SIGNATURE, error_model="numpy")
def farthest_kernel(places, clusters, apart, end, cluster, turned, nearest):
    """Bring distances to the nearest action up to date with one more.

    Args:
        places: (k, 4) planar states where candidates end [m, rad].
        clusters: (k,) of the candidates.
        apart: (K, K) squared distances of clusters.
        end: (4,) planar state where the further action ends.
        cluster: Its cluster.
        turned: What facing the other way counts for [m].
        nearest: In and out, (k,) distance to the nearest action.

    Returns:
        The first of the candidates whose distance is the greatest.
    """
    best = 0
    for k in range(len(clusters)):
        x, y = places[k, 0] - end[0], places[k, 1] - end[1]
        # Half a circle's chord, from one heading to the other.
        chord = turned * math.sin(0.5 * (places[k, 3] - end[3]))
        squared = x * x + y * y + chord * chord + apart[clusters[k], cluster]
        nearest[k] = min(nearest[k], math.sqrt(squared))
        if nearest[k] > nearest[best]:
            best = k
    return best
