"""Cluster trees and most probable motions, slow and readable: every way is walked."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.motion_graph import MotionGraph

ALIKE = 3


def ways_from(graph: MotionGraph, clusters: Clusters, frame: int) -> dict[int, float]:
    """Targets and probabilities of the ways that trees follow from a frame.

    They are the recorded way, and of the ways into each cluster the three most probable.
    """
    row = range(int(graph.offsets[frame]), int(graph.offsets[frame + 1]))
    followed = {}
    for way in row:
        target, own = int(graph.targets[way]), float(graph.probabilities[way])
        better = [
            k
            for k in row
            if clusters.labels[graph.targets[k]] == clusters.labels[target]
            and graph.probabilities[k] > own
        ]
        if len(better) < ALIKE or graph.database.successors[frame] == target:
            followed[target] = own
    return followed


def walks(
    graph: MotionGraph, clusters: Clusters, root: int, steps: int
) -> Iterator[tuple[int, ...]]:
    """All walks of at most so many steps."""
    pending = [(root,)]
    while pending:
        walk = pending.pop()
        yield walk
        if len(walk) <= steps:
            pending += [(*walk, target) for target in ways_from(graph, clusters, walk[-1])]


def path_of(walk: tuple[int, ...], clusters: Clusters) -> tuple[int, ...]:
    """The cluster path of a walk: its clusters, each stay once."""
    labels = [int(clusters.labels[frame]) for frame in walk]
    return tuple(c for k, c in enumerate(labels) if k == 0 or c != labels[k - 1])


def probability(graph: MotionGraph, clusters: Clusters, walk: tuple[int, ...]) -> float:
    """Of the ways alone."""
    return math.prod(ways_from(graph, clusters, a)[b] for a, b in itertools.pairwise(walk))


def tree(
    graph: MotionGraph, clusters: Clusters, root: int, steps: int
) -> dict[int, tuple[int, ...]]:
    """The walk to each frame that a tree visits: the shortest; of those, step by step, the best.

    A frame that can be reached in as many steps from several frames of the tree is reached from
    that whose walk, with the way on, is the most probable.
    """
    found = {root: (root,)}
    newest = [(root,)]
    for _ in range(steps):
        reached: dict[int, tuple[int, ...]] = {}
        for walk in newest:
            for target in ways_from(graph, clusters, walk[-1]):
                other = (*walk, target)
                if target in found:
                    continue
                if target not in reached or probability(graph, clusters, other) > probability(
                    graph, clusters, reached[target]
                ):
                    reached[target] = other
        found.update(reached)
        newest = list(reached.values())
    return found


def likeliest_motion(
    graph: MotionGraph, clusters: Clusters, path: tuple[int, ...], root: int, steps: int
) -> tuple[tuple[int, ...], float]:
    """Eq. 7 by trying all walks: the best one that ends where it enters the path's last cluster."""
    best: tuple[tuple[int, ...], float] = ((), -np.inf)
    for walk in walks(graph, clusters, root, steps):
        entering = len(walk) == 1 or path_of(walk[:-1], clusters) == path[:-1]
        if path_of(walk, clusters) != path or not entering:
            continue
        own = [float(clusters.log_probabilities[f, clusters.labels[f]]) for f in walk[1:]]
        value = math.log(probability(graph, clusters, walk)) + sum(own)
        if value > best[1]:
            best = (walk, value)
    return best
