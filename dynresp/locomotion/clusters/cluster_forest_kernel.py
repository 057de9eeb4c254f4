"""Compiled loops of the cluster forest: grow a tree, and follow its edges.

Importing this module imports numba; so import it where it is used.
`dynresp.locomotion.clusters.cluster_forest` describes what is computed, and why.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

_PLAIN: dict[str, Any] = {"error_model": "numpy"}

OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
INTS = types.Array(types.int32, 1, "C", readonly=True)
REALS = types.Array(types.float64, 1, "C", readonly=True)
TABLE = types.Array(types.float64, 2, "C", readonly=True)
_INT, _OUT = types.int64, types.int32[::1]


class Edges(NamedTuple):
    """The edges of a motion graph that trees follow, in one row for each frame. Read-only.

    Attributes:
        offsets: (n + 1,) int64, where the row of each frame begins.
        targets: (m,) int32, the frame to which each edge leads.
        log_probabilities: (m,) logarithm of the probability of each.
    """

    offsets: Any
    targets: Any
    log_probabilities: Any


class GraphArrays(NamedTuple):
    """All edges of a motion graph, and where its roots are. Read-only.

    Attributes:
        offsets: (n + 1,) int64, where the row of edges of each frame begins.
        targets: (m,) int32, the frame to which each edge leads.
        placements: (m, 4) of the clip after each edge, in the clip before it.
        successors: (n,) int32, the recorded next frame of each, in the same clip.
        planar: (n, 4) states of the root at all frames, in the world of their clips.
    """

    offsets: Any
    targets: Any
    placements: Any
    successors: Any
    planar: Any


class TreeArrays(NamedTuple):
    """Room for a cluster tree; see `ClusterTree` for the contents.

    Attributes:
        frames: (n,) int32.
        parents: (n,) int32.
        edges: (n,) int32.
        steps: (n,) int32.
        nodes: (n,) int32.
        log_probabilities: (n,).
        node_clusters: (n,) int32.
        node_parents: (n,) int32.
        node_visits: (n,) int32.
    """

    frames: Any
    parents: Any
    edges: Any
    steps: Any
    nodes: Any
    log_probabilities: Any
    node_clusters: Any
    node_parents: Any
    node_visits: Any


EDGES = types.NamedTuple((OFFSETS, INTS, REALS), Edges)
_GRAPH = types.NamedTuple((OFFSETS, INTS, TABLE, INTS, TABLE), GraphArrays)
_TREE = types.NamedTuple(
    (_OUT, _OUT, _OUT, _OUT, _OUT, types.float64[::1], _OUT, _OUT, _OUT), TreeArrays
)


@helper(inline="always")
def _put(outer, inner, out):
    """The placement `inner` followed by `outer`, (4,) each, as `placement.compose`."""
    cosine, sine = math.cos(outer[3]), math.sin(outer[3])
    out[0] = outer[0] + cosine * inner[0] - sine * inner[1]
    out[1] = outer[1] + sine * inner[0] + cosine * inner[1]
    out[2] = outer[2] + inner[2]
    out[3] = math.pi - (math.pi - (outer[3] + inner[3])) % (2.0 * math.pi)


@compiled(types.UniTuple(_INT, 2)(EDGES, INTS, _INT, _INT, _TREE), **_PLAIN)
def grow_kernel(edges, labels, root, depth, tree):
    """Grow the cluster tree of a frame, step by step in time.

    Args:
        edges: Those that the tree follows.
        labels: (n,) cluster of each frame.
        root: The frame.
        depth: Steps to look ahead.
        tree: Out. Its edges are indices into `edges`.

    Returns:
        The number of visits and of nodes.
    """
    n = len(labels)
    seen = np.full(n, np.int32(-1))
    # The newest child of a node, and the next older child of its parent.
    child, older = np.full(n, np.int32(-1)), np.empty(n, np.int32)
    tree.frames[0], tree.parents[0], tree.edges[0], tree.steps[0] = root, -1, -1, 0
    tree.log_probabilities[0], tree.nodes[0] = 0.0, 0
    tree.node_clusters[0], tree.node_parents[0], tree.node_visits[0] = labels[root], -1, 0
    seen[root] = 0
    low, high, count, size = 0, 1, 1, 1
    for step in range(1, depth + 1):
        for visit in range(low, high):
            frame = tree.frames[visit]
            for edge in range(edges.offsets[frame], edges.offsets[frame + 1]):
                target = edges.targets[edge]
                value = tree.log_probabilities[visit] + edges.log_probabilities[edge]
                found = seen[target]
                if found < 0:
                    found = count
                    seen[target], tree.frames[count], tree.steps[count] = count, target, step
                    count += 1
                elif found < high or value <= tree.log_probabilities[found]:
                    continue
                tree.parents[found], tree.edges[found] = visit, edge
                tree.log_probabilities[found] = value
        for visit in range(high, count):
            node, cluster = tree.nodes[tree.parents[visit]], labels[tree.frames[visit]]
            if cluster != tree.node_clusters[node]:
                own = child[node]
                while own >= 0 and tree.node_clusters[own] != cluster:
                    own = older[own]
                if own < 0:
                    own = size
                    tree.node_clusters[own], tree.node_parents[own] = cluster, node
                    tree.node_visits[own], older[own], child[node] = visit, child[node], own
                    size += 1
                node = own
            tree.nodes[visit] = node
        if count in (high, n):
            break
        low, high = high, count
    return count, size


@compiled(types.float64[:, ::1](_GRAPH, INTS, INTS, INTS, INTS, REALS), **_PLAIN)
def root_states_kernel(graph, frames, parents, edges, visits, placement):
    """Where the root is at visits of a tree.

    Args:
        graph: The graph.
        frames: (v,) frame of each visit.
        parents: (v,) the visit before each; -1 of the first.
        edges: (v,) edge of the graph that leads to each.
        visits: (k,) those that are needed.
        placement: (4,) of the clip of the first visit.

    Returns:
        (k, 4) planar states.
    """
    # Few visits need the placement of their clip: the given ones, and those on the way to them.
    slots = np.full(len(parents), np.int32(-1))
    clips = np.empty((len(parents), 4))
    clips[0] = placement
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
            if graph.successors[frames[visit]] != frames[after]:
                _put(clips[slots[visit]], graph.placements[edges[after]], clips[count])
                slots[after] = count
                count += 1
            visit = after
        _put(clips[slots[visit]], graph.planar[frames[visit]], out[k])
    return out


@compiled(_INT(_GRAPH, INTS, REALS, types.float64[:, ::1]), **_PLAIN)
def root_states_along_kernel(graph, frames, placement, out):
    """Where the root is along frames of the graph.

    Args:
        graph: The graph.
        frames: (s,) each follows the one before.
        placement: (4,) of the clip of the first.
        out: Out, (s, 4) planar states.

    Returns:
        How many frames were placed; fewer than all where no edge leads to the next one.
    """
    clip, moved = placement.copy(), np.empty(4)
    for k in range(len(frames)):
        if k > 0:
            edge, end = graph.offsets[frames[k - 1]], graph.offsets[frames[k - 1] + 1]
            while edge < end and graph.targets[edge] != frames[k]:
                edge += 1
            if edge == end:
                return k
            _put(clip, graph.placements[edge], moved)
            clip[:] = moved
        _put(clip, graph.planar[frames[k]], out[k])
    return len(frames)


@compiled(_OUT(INTS, INTS, _INT), **_PLAIN)
def values_from_root_kernel(values, parents, last):
    """Values (s,) from the root to one of its descendants.

    Args:
        values: (v,) of each element.
        parents: (v,) of each element; -1 of the root.
        last: The descendant.
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


@compiled(_OUT(INTS, INTS, INTS, _INT), **_PLAIN)
def stay_kernel(likeliest, labels, frames, max_steps):
    """Frames (s,), and the most probable ones after them while the cluster stays the same.

    Args:
        likeliest: (n,) the most probable next frame of each.
        labels: (n,) cluster of each frame.
        frames: (s,) at least one.
        max_steps: Most steps from the first frame to the last.
    """
    count = len(frames)
    out = np.empty(max(max_steps + 1, count), np.int32)
    out[:count] = frames
    cluster = labels[out[count - 1]]
    while count <= max_steps and labels[likeliest[out[count - 1]]] == cluster:
        out[count] = likeliest[out[count - 1]]
        count += 1
    return out[:count]
