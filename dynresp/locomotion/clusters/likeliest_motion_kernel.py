"""Compiled search for the most probable motion along a cluster path (Lee et al. 2002, eq. 7).

Importing this module imports numba; so import it where it is used.
`dynresp.locomotion.clusters.cluster_forest` describes what is computed, and why.
"""

from __future__ import annotations

import heapq
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.locomotion.clusters.cluster_forest_kernel import EDGES, INTS, OFFSETS, REALS, TABLE
from dynresp.support.array_growth_kernel import doubled
from dynresp.support.compiling import compiled, helper

_PLAIN: dict[str, Any] = {"error_model": "numpy"}


class IncomingEdges(NamedTuple):
    """The same edges as in `Edges`, in one row for each target. Read-only.

    Attributes:
        offsets: (n + 1,) int64, where the row of each target begins.
        sources: (m,) int32, the frame from which each edge leads.
    """

    offsets: Any
    sources: Any


class ClusterArrays(NamedTuple):
    """The clusters of all frames. Read-only.

    Attributes:
        labels: (n,) int32, cluster of each frame.
        log_memberships: (n,) log P(cluster of the frame | frame).
        ranks: (n,) int32, index of each frame among those of its cluster.
        sizes: (K,) int32, frames of each cluster.
        members: (n,) int32, frames by cluster, in the order of their ranks.
        entry_costs: (K, K) least cost to enter the second cluster from the first, a negative
            logarithm of a probability.
    """

    labels: Any
    log_memberships: Any
    ranks: Any
    sizes: Any
    members: Any
    entry_costs: Any


class ClusterPath(NamedTuple):
    """A cluster path to search along. A state is a frame at one index of the path.

    Attributes:
        clusters: (p,) int32, neighbours differ; the first is the root's.
        costs_left: (p,) least cost to enter all clusters after each index.
        first_states: (p + 1,) int64, the first state of each index: one for each of its frames.
    """

    clusters: Any
    costs_left: Any
    first_states: Any


_INCOMING = types.NamedTuple((OFFSETS, INTS), IncomingEdges)
_CLUSTERS = types.NamedTuple((INTS, REALS, INTS, INTS, INTS, TABLE), ClusterArrays)
_INT, _REAL = types.int64, types.float64


@helper(**_PLAIN)
def _steps_left(incoming, clusters, path, depth):
    """Fewest steps from each state of a path to its last cluster; depth + 1 where there are none.

    Breadth first, backwards from the last cluster.
    """
    last, first_states = len(path.clusters) - 1, path.first_states
    left = np.full(first_states[last + 1], np.int32(depth + 1))
    frames, indices = np.empty(len(left), np.int32), np.empty(len(left), np.int32)
    first, count = 0, clusters.sizes[path.clusters[last]]
    for cluster in range(path.clusters[last]):
        first += clusters.sizes[cluster]
    frames[:count], indices[:count] = clusters.members[first : first + count], last
    left[first_states[last] :] = 0
    own = 0
    while own < count:
        target, index = frames[own], indices[own]
        own += 1
        steps = left[first_states[index] + clusters.ranks[target]] + 1
        for edge in range(incoming.offsets[target], incoming.offsets[target + 1]):
            source, before = incoming.sources[edge], index
            # A motion ends when it enters the last cluster.
            if index == last or clusters.labels[source] != path.clusters[index]:
                before -= 1
                if before < 0 or clusters.labels[source] != path.clusters[before]:
                    continue
            state = first_states[before] + clusters.ranks[source]
            # Each index takes at least one step.
            if steps + before <= depth and steps < left[state]:
                left[state] = steps
                frames[count], indices[count] = source, before
                count += 1
    return left


@helper(**_PLAIN)
def _best_first(edges, clusters, path, root, steps_left, depth, bounded, max_cost):
    """The most probable motion along a path; within the depth only where `bounded`.

    Motions that cost `max_cost` (a negative logarithm) or more are not considered.

    The partial motion that may become the most probable one continues first, judged by its cost so
    far plus the least cost of the clusters that are still to be entered (A*: entering them never
    costs less). A partial motion ends where a better one has reached the same state before, unless
    the depth counts and it took fewer steps. The first one taken up in the last cluster is the
    best of all.
    """
    last = len(path.clusters) - 1
    # For each state, the steps of the best motion that reached it and of the last one taken up:
    # motions of as many or more end there. Where the depth does not count, all do.
    best = np.full(path.first_states[last + 1], np.inf)
    best_steps = np.zeros(path.first_states[last + 1], np.int32)
    fewest = np.full(path.first_states[last + 1], np.int32(2**31 - 1))
    room, count = 256, 1
    frames, indices = np.empty(room, np.int32), np.empty(room, np.int32)
    parents, steps = np.empty(room, np.int32), np.empty(room, np.int32)
    frames[0], indices[0], parents[0], steps[0] = root, 0, -1, 0
    heap = [(path.costs_left[0], 0)]
    whole, whole_cost = -1, max_cost
    while len(heap) > 0:
        cost, own = heapq.heappop(heap)
        frame, index = frames[own], indices[own]
        if index == last:
            whole, whole_cost = own, cost
            break
        cost -= path.costs_left[index]
        state = path.first_states[index] + clusters.ranks[frame]
        if steps[own] >= fewest[state]:
            continue
        fewest[state] = steps[own] if bounded else 0
        for edge in range(edges.offsets[frame], edges.offsets[frame + 1]):
            at, target, index = own, edges.targets[edge], indices[own]
            reached = cost - edges.log_probabilities[edge]
            # A single edge is followed at once.
            while True:
                after = steps[at] + 1
                if clusters.labels[target] != path.clusters[index]:
                    index += 1
                    if clusters.labels[target] != path.clusters[index]:
                        break
                reached -= clusters.log_memberships[target]
                state = path.first_states[index] + clusters.ranks[target]
                if after >= fewest[state] or reached + path.costs_left[index] >= whole_cost:
                    break
                if bounded and after + steps_left[state] > depth:
                    break
                if reached < best[state]:
                    best[state], best_steps[state] = reached, after if bounded else 0
                elif after >= best_steps[state]:
                    break
                if count == room:
                    room *= 2
                    frames, indices = doubled(frames), doubled(indices)
                    parents, steps = doubled(parents), doubled(steps)
                frames[count], indices[count] = target, index
                parents[count], steps[count] = at, after
                at = count
                count += 1
                row = edges.offsets[target]
                if index == last or edges.offsets[target + 1] - row > 1:
                    heapq.heappush(heap, (reached + path.costs_left[index], at))
                    if index == last:
                        whole_cost = reached
                    break
                target, reached = edges.targets[row], reached - edges.log_probabilities[row]
    length = 0 if whole < 0 else steps[whole] + 1
    motion = np.empty(length, np.int32)
    for k in range(length - 1, -1, -1):
        motion[k] = frames[whole]
        whole = parents[whole]
    return motion, -whole_cost


@compiled(
    types.Tuple((types.int32[::1], _REAL))(EDGES, _INCOMING, _CLUSTERS, INTS, INTS, _REAL, _INT),
    **_PLAIN,
)
def likeliest_motion_kernel(edges, incoming, clusters, cluster_path, known, log_known, depth):
    """The most probable motion along a cluster path.

    Args:
        edges: Those that motions may take.
        incoming: The same, by target.
        clusters: Of all frames.
        cluster_path: (p,) clusters, neighbours differ; the first is the root's.
        known: Frames of a motion along the path, the root first, of at most `depth` steps.
        log_known: Logarithm of the probability of its edges.
        depth: Most steps.

    Returns:
        Frames of the motion, the root first, up to the first in the path's last cluster, and the
        logarithm of eq. 7.
    """
    root, last = known[0], len(cluster_path) - 1
    costs_left = np.zeros(last + 1)
    for k in range(last - 1, -1, -1):
        costs_left[k] = (
            costs_left[k + 1] + clusters.entry_costs[cluster_path[k], cluster_path[k + 1]]
        )
    cost = -log_known
    for k in range(1, len(known)):
        cost -= clusters.log_memberships[known[k]]
    # A little more, so that the known motion itself is found where no other is better.
    max_cost = cost + 1e-9
    first_states = np.zeros(last + 2, np.int64)
    for k in range(last + 1):
        first_states[k + 1] = first_states[k] + clusters.sizes[cluster_path[k]]
    path = ClusterPath(cluster_path, costs_left, first_states)
    # Where the best motion of any length is short enough, it is found several times faster.
    left = np.empty(0, np.int32)
    motion, value = _best_first(edges, clusters, path, root, left, depth, False, max_cost)
    if len(motion) > depth + 1:
        left = _steps_left(incoming, clusters, path, depth)
        motion, value = _best_first(edges, clusters, path, root, left, depth, True, max_cost)
    return motion, value
