"""The compiled part of the cluster forest: growing a tree, and following its ways.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used. What is computed, and why so, is told in `forest`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from dynresp.support.compiling import compiled

_PLAIN: dict[str, Any] = {"error_model": "numpy"}

_OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
_INTS = types.Array(types.int32, 1, "C", readonly=True)
_REALS = types.Array(types.float64, 1, "C", readonly=True)
_TABLE = types.Array(types.float64, 2, "C", readonly=True)
_INT = types.int64
_OUT = types.int32[::1]
# fmt: off
_GROW = types.UniTuple(types.int64, 2)(
    _OFFSETS, _INTS, _REALS, _INTS, _INT, _INT, _OUT, _OUT, _OUT, _OUT, _OUT,
    types.float64[::1], _OUT, _OUT, _OUT)
_PLACE = types.float64[:, ::1](_INTS, _INTS, _INTS, _INTS, _INTS, _TABLE, _TABLE, _REALS)
_ALONG = types.int64(_OFFSETS, _INTS, _TABLE, _TABLE, _INTS, _REALS, types.float64[:, ::1])
_BACK = types.int32[::1](_INTS, _INTS, _INT)
_STAY = types.int32[::1](_INTS, _INTS, _INTS, _INT)
# fmt: on


@njit(inline="always")
def _put(outer, inner, out):
    """The placement `inner` followed by `outer`, (4,) each, as `placement.compose`."""
    cosine, sine = math.cos(outer[3]), math.sin(outer[3])
    out[0] = outer[0] + cosine * inner[0] - sine * inner[1]
    out[1] = outer[1] + sine * inner[0] + cosine * inner[1]
    out[2] = outer[2] + inner[2]
    out[3] = math.pi - (math.pi - (outer[3] + inner[3])) % (2.0 * math.pi)


@compiled(_GROW, **_PLAIN)
def grow_kernel(
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
def place_kernel(frames, parents, ways, visits, successors, placements, planar, place):
    """Where the root is at visited frames.

    Args:
        frames: (v,) frame of each visit.
        parents: (v,) visit before each; -1 of the first.
        ways: (v,) by which each was reached.
        visits: (k,) those that are asked for.
        successors: (n,) the recorded next frame of each, which is in the same clip.
        placements: (m, 4) of the ways.
        planar: (n, 4) states of the root at all frames, in the world of their clips.
        place: (4,) where the clip of the first visit is put.

    Returns:
        (k, 4) planar states.
    """
    # Of few visits the clip is needed: of those asked for, and of those on the way to them.
    slots = np.full(len(parents), np.int32(-1))
    clips = np.empty((len(parents), 4))
    clips[0] = place
    slots[0] = 0
    waiting = np.empty(len(parents), np.int32)
    count = 1
    out = np.empty((len(visits), 4))
    for k in range(len(visits)):
        visit, depth = visits[k], 0
        while slots[visit] < 0:
            waiting[depth] = visit
            depth += 1
            visit = parents[visit]
        while depth > 0:
            depth -= 1
            after = waiting[depth]
            slots[after] = slots[visit]
            if successors[frames[visit]] != frames[after]:
                _put(clips[slots[visit]], placements[ways[after]], clips[count])
                slots[after] = count
                count += 1
            visit = after
        _put(clips[slots[visit]], planar[frames[visit]], out[k])
    return out


@compiled(_ALONG, **_PLAIN)
def along_kernel(offsets, targets, placements, planar, frames, place, out):
    """Where the root is along ways of the graph.

    Args:
        offsets: (n + 1,) rows of ways.
        targets: (m,) of the ways.
        placements: (m, 4) of the ways.
        planar: (n, 4) states of the root at all frames, in the world of their clips.
        frames: (s,) each follows the one before.
        place: (4,) where the clip of the first is put.
        out: Out, (s, 4) planar states.

    Returns:
        How many frames were placed; fewer than all where no way leads to the next one.
    """
    clip, moved = place.copy(), np.empty(4)
    for k in range(len(frames)):
        if k > 0:
            way, end = offsets[frames[k - 1]], offsets[frames[k - 1] + 1]
            while way < end and targets[way] != frames[k]:
                way += 1
            if way == end:
                return k
            _put(clip, placements[way], moved)
            clip[:] = moved
        _put(clip, planar[frames[k]], out[k])
    return len(frames)


@compiled(_BACK, **_PLAIN)
def back_kernel(values, parents, last):
    """Values (s,) from a root to one of its descendants.

    Args:
        values: (v,) of each element.
        parents: (v,) of each element; -1 of the root.
        last: The element.
    """
    count, own = 0, last
    while own >= 0:
        count += 1
        own = parents[own]
    out, own = np.empty(count, np.int32), last
    for k in range(count - 1, -1, -1):
        out[k] = values[own]
        own = parents[own]
    return out


@compiled(_STAY, **_PLAIN)
def stay_kernel(likeliest, labels, frames, most):
    """Frames (s,), and those by which it goes on while the cluster remains.

    Args:
        likeliest: (n,) the most probable next frame of each.
        labels: (n,) cluster of each frame.
        frames: (s,) at least one.
        most: Most steps from the first frame to the last.
    """
    count = len(frames)
    out = np.empty(max(most + 1, count), np.int32)
    out[:count] = frames
    cluster = labels[out[count - 1]]
    while count <= most and labels[likeliest[out[count - 1]]] == cluster:
        out[count] = likeliest[out[count - 1]]
        count += 1
    return out[:count]
