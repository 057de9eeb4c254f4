"""The compiled part of the cluster forest: growing a tree, and the most probable motion.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used. What is computed, and why so, is told in `forest`.
"""

from __future__ import annotations

import heapq
import math
from typing import Any

import numpy as np
from numba import njit, types

from dynresp.compiling import compiled

_PLAIN: dict[str, Any] = {"error_model": "numpy"}

_OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
_INTS = types.Array(types.int32, 1, "C", readonly=True)
_REALS = types.Array(types.float64, 1, "C", readonly=True)
_INT = types.int64
_OUT = types.int32[::1]
_TABLE = types.Array(types.float64, 2, "C", readonly=True)
# fmt: off
_GROW = types.UniTuple(types.int64, 2)(
    _OFFSETS, _INTS, _REALS, _INTS, _INT, _INT, _OUT, _OUT, _OUT, _OUT, _OUT,
    types.float64[::1], _OUT, _OUT, _OUT)
_PLACE = types.void(_INTS, _INTS, _INTS, _TABLE, types.float64[:, ::1])
_PROBABLE = types.Tuple((types.int32[::1], types.float64))(
    _OFFSETS, _INTS, _REALS, _REALS, _INTS, _INTS, _INTS, _INTS, _INTS, _INT)
# fmt: on


@njit(inline="always")
def _longer(array, room):  # type: ignore[no-untyped-def]
    longer = np.empty(room, array.dtype)
    longer[: len(array)] = array
    return longer


@compiled(_GROW, **_PLAIN)
def grow_kernel(  # type: ignore[no-untyped-def]
    offsets, targets, logs, labels, root, depth, frames, parents, ways, steps, nodes,
    values, node_clusters, node_parents, node_visits,
):  # fmt: skip
    """Grow the cluster tree of a frame, step by step in time.

    Args:
        offsets: (n + 1,) rows of ways.
        targets: (m,) of the ways.
        logs: (m,) logarithms of their probabilities.
        labels: (n,) cluster of each frame.
        root: The frame.
        depth: Steps to look ahead.
        frames: Out, (n,) frames in the order in which they were visited.
        parents: Out, (n,) visit from which each was reached, -1 of the root.
        ways: Out, (n,) way by which each was reached, -1 of the root.
        steps: Out, (n,) steps from the root.
        nodes: Out, (n,) node to which each visit belongs.
        values: Out, (n,) logarithm of the probability of the way to each.
        node_clusters: Out, (n,).
        node_parents: Out, (n,) -1 of the root.
        node_visits: Out, (n,) the visit that came first.

    Returns:
        How many visits and nodes there are.
    """
    n = len(labels)
    seen = np.full(n, np.int32(-1))
    # The newest child of a node, and the next older child of its parent.
    child, older = np.full(n, np.int32(-1)), np.empty(n, np.int32)
    frames[0], parents[0], ways[0], steps[0], values[0], nodes[0] = root, -1, -1, 0, 0.0, 0
    node_clusters[0], node_parents[0], node_visits[0] = labels[root], -1, 0
    seen[root] = 0
    low, high, count, size = 0, 1, 1, 1
    for step in range(1, depth + 1):
        for visit in range(low, high):
            frame = frames[visit]
            for way in range(offsets[frame], offsets[frame + 1]):
                target, value = targets[way], values[visit] + logs[way]
                found = seen[target]
                if found < 0:
                    found = count
                    seen[target], frames[count], steps[count] = count, target, step
                    count += 1
                elif found < high or value <= values[found]:
                    continue
                parents[found], ways[found], values[found] = visit, way, value
        for visit in range(high, count):
            node, cluster = nodes[parents[visit]], labels[frames[visit]]
            if cluster != node_clusters[node]:
                own = child[node]
                while own >= 0 and node_clusters[own] != cluster:
                    own = older[own]
                if own < 0:
                    own = size
                    node_clusters[own], node_parents[own] = cluster, node
                    node_visits[own], older[own], child[node] = visit, child[node], own
                    size += 1
                node = own
            nodes[visit] = node
        if count in (high, n):
            break
        low, high = high, count
    return count, size


@compiled(_PLACE, **_PLAIN)
def place_kernel(parents, ways, visits, placements, clips):  # type: ignore[no-untyped-def]
    """Where the clips of visited frames are put, seen from the clip of the root.

    Args:
        parents: (v,) visit before each; -1 of the first.
        ways: (v,) by which each was reached.
        visits: (k,) those that are asked for.
        placements: (m, 4) of the ways.
        clips: Out, (v, 4); the visits that are asked for and those on the way to them are written.
    """
    needed = np.zeros(len(parents), np.bool_)
    for visit in visits:
        while visit >= 0 and not needed[visit]:
            needed[visit] = True
            visit = parents[visit]
    clips[0] = 0.0
    for visit in range(1, len(parents)):
        if not needed[visit]:
            continue
        before, way = clips[parents[visit]], ways[visit]
        cosine, sine = math.cos(before[3]), math.sin(before[3])
        x, y = placements[way, 0], placements[way, 1]
        clips[visit, 0] = before[0] + cosine * x - sine * y
        clips[visit, 1] = before[1] + sine * x + cosine * y
        clips[visit, 2] = before[2] + placements[way, 2]
        clips[visit, 3] = before[3] + placements[way, 3]


@njit(**_PLAIN)
def _best_first(  # type: ignore[no-untyped-def]
    offsets, targets, logs, belongs, labels, ranks, sizes, root, path, depth, bounded, most
):
    """The most probable motion along a path; within the depth only where `bounded`.

    Only motions that are better than `most`, a negative logarithm, are looked for.

    Of all motions begun, the most probable goes on. One that comes to a place of the path and a
    frame where a better one has been ends there, unless the depth counts and it took fewer steps.
    The first one taken up in the last cluster is the best of all.
    """
    last = len(path) - 1
    begins = np.zeros(last + 2, np.int64)
    for k in range(last + 1):
        begins[k + 1] = begins[k] + sizes[path[k]]
    # At each place and frame, the steps of the best motion begun and of the last one taken up:
    # motions of as many or more end there. Where the depth does not count, all do.
    best = np.full(begins[last + 1], np.inf)
    best_steps = np.zeros(begins[last + 1], np.int32)
    fewest = np.full(begins[last + 1], np.int32(2**31 - 1))
    room, count = 256, 1
    frames, places = np.empty(room, np.int32), np.empty(room, np.int32)
    parents, steps = np.empty(room, np.int32), np.empty(room, np.int32)
    frames[0], places[0], parents[0], steps[0] = root, 0, -1, 0
    heap = [(0.0, 0)]
    whole, whole_cost = -1, most
    while len(heap) > 0:
        cost, own = heapq.heappop(heap)
        frame, place = frames[own], places[own]
        if place == last:
            whole, whole_cost = own, cost
            break
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
                if after >= fewest[state] or reached >= whole_cost or (bounded and after > depth):
                    break
                if reached < best[state]:
                    best[state], best_steps[state] = reached, after if bounded else 0
                elif after >= best_steps[state]:
                    break
                if count == room:
                    room *= 2
                    frames, places = _longer(frames, room), _longer(places, room)
                    parents, steps = _longer(parents, room), _longer(steps, room)
                frames[count], places[count] = target, place
                parents[count], steps[count] = at, after
                at = count
                count += 1
                row = offsets[target]
                if place == last or offsets[target + 1] - row > 1:
                    heapq.heappush(heap, (reached, at))
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
def probable_kernel(  # type: ignore[no-untyped-def]
    offsets, targets, logs, belongs, labels, ranks, sizes, path, known, depth
):
    """The most probable motion along a cluster path.

    Args:
        offsets: (n + 1,) rows of ways.
        targets: (m,) of the ways.
        logs: (m,) logarithms of their probabilities.
        belongs: (n,) log P(cluster of the frame | frame).
        labels: (n,) cluster of each frame.
        ranks: (n,) which of its cluster's frames each is.
        sizes: (K,) frames of each cluster.
        path: (p,) clusters, neighbours different; the first is the root's.
        known: A motion along the path, the root first, of no more steps than the depth.
        depth: Most steps.

    Returns:
        Frames of the motion, the root first, up to the first in the path's last cluster, and the
        logarithm of eq. 7.
    """
    root = known[0]
    # A motion that is the best of any length, and short enough, is found several times faster.
    motion, value = _best_first(
        offsets, targets, logs, belongs, labels, ranks, sizes, root, path, depth, False, np.inf
    )
    if len(motion) > depth + 1:
        cost = 0.0
        for k in range(1, len(known)):
            way = offsets[known[k - 1]]
            while targets[way] != known[k]:
                way += 1
            cost -= logs[way] + belongs[known[k]]
        # A little more, so that the known motion itself is found where there is none better.
        most = cost + 1e-9
        motion, value = _best_first(
            offsets, targets, logs, belongs, labels, ranks, sizes, root, path, depth, True, most
        )
    return motion, value
