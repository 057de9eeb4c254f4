"""Actions offered at random moments: how many, and how long a choice takes."""

from __future__ import annotations

import time

import numpy as np

from dynresp.locomotion.choice.actions import OfferedAction, offer_actions
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.motion.character import Character
from studies.graphs.graph_study import of_graphs
from studies.study import Study, Target, Value

ENOUGH, WITHIN_MS = 3, 5.0
"""Actions that have to be offered, and the time limit."""
# Frames from one moment to the next.
_SPACING = 11


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Choose at moments of a random walk.

    Args:
        graph: The graph.
        character: The character.
        count: Moments.
        seed: Of the walk.
    """
    start = time.perf_counter()
    clusters = Clusters.of(graph, character=character)
    clustered = time.perf_counter()
    forest = ClusterForest(graph, clusters)
    grown = time.perf_counter()
    walk = random_walk(graph, _SPACING * count, np.random.default_rng(seed))
    offer_actions(forest, int(walk[0]))
    took, busy, found = np.empty(count), np.empty(count), np.empty(count, dtype=int)
    for k, frame in enumerate(walk[::_SPACING].tolist()):
        begun, used = time.perf_counter(), time.thread_time()
        offered = offer_actions(forest, frame)
        busy[k] = 1e3 * (time.thread_time() - used)
        took[k] = 1e3 * (time.perf_counter() - begun)
        found[k] = len({_end(choice) for choice in offered})
    return {
        "moments": count,
        "clusters": len(clusters),
        "clustering_s": clustered - start,
        "forest_s": grown - clustered,
        "options_fewest": int(found.min()),
        "options_mean": float(found.mean()),
        "moments_with_3_options": float(np.mean(found >= ENOUGH)),
        "time_median_ms": float(np.median(took)),
        "time_p99.9_ms": float(np.percentile(took, 99.9)),
        "time_largest_ms": float(took.max()),
        "moments_under_5_ms": float(np.mean(took < WITHIN_MS)),
        "processor_time_largest_ms": float(busy.max()),
        "moments_under_5_ms_of_processor_time": float(np.mean(busy < WITHIN_MS)),
    }


def _end(choice: OfferedAction) -> tuple[float, ...]:
    """Actions differ in where they end, in which direction and in which cluster."""
    x, y, _, yaw = choice.path[-1].tolist()
    return (x, y, yaw, choice.cluster)


STUDY = Study(
    "choices",
    "actions offered at random moments: how many, and how long a choice takes",
    "3 min",
    of_graphs(measure, ("walking", "builtin", "stool", "playground"), 10_000, 20),
    (
        Target("options_fewest", "at least 3", at_least=3),
        Target("moments_with_3_options", "all", at_least=1.0),
        Target("moments_under_5_ms", "all", at_least=1.0),
        Target("time_largest_ms", "under 5 ms", at_most=5.0),
    ),
    notes=(
        "The time of a moment includes growing its tree. Processor time leaves out what others "
        "on the machine take.",
    ),
)
