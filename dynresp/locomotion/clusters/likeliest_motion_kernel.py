"""The compiled search for the most probable motion along a cluster path.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used. What is computed, and why so, is told in `forest`.
"""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np
from numba import njit, types

from dynresp.support.compiling import compiled
from dynresp.support.growing_kernel import doubled

_PLAIN: dict[str, Any] = {"error_model": "numpy"}

_OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
_INTS = types.Array(types.int32, 1, "C", readonly=True)
_REALS = types.Array(types.float64, 1, "C", readonly=True)
_TABLE = types.Array(types.float64, 2, "C", readonly=True)
_INT = types.int64
# fmt: off
_PROBABLE = types.Tuple((types.int32[::1], types.float64))(
    _OFFSETS, _INTS, _REALS, _OFFSETS, _INTS, _REALS, _INTS, _INTS, _INTS, _INTS, _TABLE, _INTS,
    _INTS, types.float64, _INT)
# fmt: on


@njit(**_PLAIN)
def _states(path, sizes):
    """(p + 1,) where the states of each place of a path begin: one a frame of its cluster."""
    begins = np.zeros(len(path) + 1, np.int64)
    for k in range(len(path)):
        begins[k + 1] = begins[k] + sizes[path[k]]
    return begins


@njit(**_PLAIN)
def _steps_left(back_offsets, back_sources, labels, ranks, sizes, members, path, begins, depth):
    """Fewest steps from each state of a path to its last cluster; more than the depth for never.

    It goes back from there, breadth first.
    """
    last = len(path) - 1
    left = np.full(begins[last + 1], np.int32(depth + 1))
    frames, places = np.empty(len(left), np.int32), np.empty(len(left), np.int32)
    first, count = 0, sizes[path[last]]
    for cluster in range(path[last]):
        first += sizes[cluster]
    frames[:count], places[:count] = members[first : first + count], last
    left[begins[last] :] = 0
    own = 0
    while own < count:
        target, place = frames[own], places[own]
        own += 1
        steps = left[begins[place] + ranks[target]] + 1
        for way in range(back_offsets[target], back_offsets[target + 1]):
            source, before = back_sources[way], place
            # What stays in the last cluster has arrived.
            if place == last or labels[source] != path[place]:
                before -= 1
                if before < 0 or labels[source] != path[before]:
                    continue
            state = begins[before] + ranks[source]
            # It takes a step at least to every place.
            if steps + before <= depth and steps < left[state]:
                left[state] = steps
                frames[count], places[count] = source, before
                count += 1
    return left


@njit(**_PLAIN)
def _best_first(
    offsets, targets, logs, belongs, labels, ranks, ahead, root, path, begins, left, depth, bounded,
    most,
):  # fmt: skip
    """The most probable motion along a path; within the depth only where `bounded`.

    Only motions that are better than `most`, a negative logarithm, are looked for.

    Of all motions begun, the one that may become the most probable goes on: what it costs so far,
    and what the clusters ahead of it cost at least (the search A*, as entering the next cluster
    never costs less than that). One that comes to a place of the path and a frame where a better
    one has been ends there, unless the depth counts and it took fewer steps. The first one taken
    up in the last cluster is the best of all.
    """
    last = len(path) - 1
    # At each place and frame, the steps of the best motion begun and of the last one taken up:
    # motions of as many or more end there. Where the depth does not count, all do.
    best = np.full(begins[last + 1], np.inf)
    best_steps = np.zeros(begins[last + 1], np.int32)
    fewest = np.full(begins[last + 1], np.int32(2**31 - 1))
    room, count = 256, 1
    frames, places = np.empty(room, np.int32), np.empty(room, np.int32)
    parents, steps = np.empty(room, np.int32), np.empty(room, np.int32)
    frames[0], places[0], parents[0], steps[0] = root, 0, -1, 0
    heap = [(ahead[0], 0)]
    whole, whole_cost = -1, most
    while len(heap) > 0:
        cost, own = heapq.heappop(heap)
        frame, place = frames[own], places[own]
        if place == last:
            whole, whole_cost = own, cost
            break
        cost -= ahead[place]
        state = begins[place] + ranks[frame]
        if steps[own] >= fewest[state]:
            continue
        fewest[state] = steps[own] if bounded else 0
        for way in range(offsets[frame], offsets[frame + 1]):
            at, target, place, reached = own, targets[way], places[own], cost - logs[way]
            # Where there is only one way on, it is followed at once.
            while True:
                after = steps[at] + 1
                if labels[target] != path[place]:
                    place += 1
                    if labels[target] != path[place]:
                        break
                reached -= belongs[target]
                state = begins[place] + ranks[target]
                if after >= fewest[state] or reached + ahead[place] >= whole_cost:
                    break
                if bounded and after + left[state] > depth:
                    break
                if reached < best[state]:
                    best[state], best_steps[state] = reached, after if bounded else 0
                elif after >= best_steps[state]:
                    break
                if count == room:
                    room *= 2
                    frames, places = doubled(frames), doubled(places)
                    parents, steps = doubled(parents), doubled(steps)
                frames[count], places[count] = target, place
                parents[count], steps[count] = at, after
                at = count
                count += 1
                row = offsets[target]
                if place == last or offsets[target + 1] - row > 1:
                    heapq.heappush(heap, (reached + ahead[place], at))
                    if place == last:
                        whole_cost = reached
                    break
                target, reached = targets[row], reached - logs[row]
    length = 0 if whole < 0 else steps[whole] + 1
    motion = np.empty(length, np.int32)
    for k in range(length - 1, -1, -1):
        motion[k] = frames[whole]
        whole = parents[whole]
    return motion, -whole_cost


@compiled(_PROBABLE, **_PLAIN)
def probable_kernel(
    offsets, targets, logs, back_offsets, back_sources, belongs, labels, ranks, sizes, members,
    leaps, path, known, log_known, depth,
):  # fmt: skip
    """The most probable motion along a cluster path.

    Args:
        offsets: (n + 1,) rows of ways.
        targets: (m,) of the ways.
        logs: (m,) logarithms of their probabilities.
        back_offsets: (n + 1,) rows of the ways that lead to each frame.
        back_sources: (m,) of those ways.
        belongs: (n,) log P(cluster of the frame | frame).
        labels: (n,) cluster of each frame.
        ranks: (n,) which of its cluster's frames each is.
        sizes: (K,) frames of each cluster.
        members: (n,) frames, cluster by cluster, in the order of their ranks.
        leaps: (K, K) what it costs at least to enter one cluster from another, a negative
            logarithm.
        path: (p,) clusters, neighbours different; the first is the root's.
        known: A motion along the path, the root first, of no more steps than the depth.
        log_known: Logarithm of the probability of its ways.
        depth: Most steps.

    Returns:
        Frames of the motion, the root first, up to the first in the path's last cluster, and the
        logarithm of eq. 7.
    """
    root, last = known[0], len(path) - 1
    ahead = np.zeros(last + 1)
    for k in range(last - 1, -1, -1):
        ahead[k] = ahead[k + 1] + leaps[path[k], path[k + 1]]
    cost = -log_known
    for k in range(1, len(known)):
        cost -= belongs[known[k]]
    # A little more, so that the known motion itself is found where there is none better.
    most = cost + 1e-9
    begins = _states(path, sizes)
    # A motion that is the best of any length, and short enough, is found several times faster.
    left = np.empty(0, np.int32)
    motion, value = _best_first(
        offsets, targets, logs, belongs, labels, ranks, ahead, root, path, begins, left, depth,
        False, most,
    )  # fmt: skip
    if len(motion) > depth + 1:
        left = _steps_left(
            back_offsets, back_sources, labels, ranks, sizes, members, path, begins, depth
        )
        motion, value = _best_first(
            offsets, targets, logs, belongs, labels, ranks, ahead, root, path, begins, left, depth,
            True, most,
        )  # fmt: skip
    return motion, value
