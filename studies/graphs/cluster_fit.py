"""Clusters without seeds picked by hand, beside the best of random starts."""

from __future__ import annotations

import time

import numpy as np

from dynresp.locomotion.clusters.cluster_observations import observations
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import fit_from_means
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from studies.graphs.graph_study import WORLDS, of_graphs
from studies.study import Study, Target, Value


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Cluster the frames of a graph, and fit mixtures of as many clusters from random frames.

    Args:
        graph: The graph.
        character: The character.
        count: Number of random starts.
        seed: Of the random starts.
    """
    from threadpoolctl import threadpool_limits

    start = time.perf_counter()
    clusters = Clusters.of(graph, character=character)
    seconds = time.perf_counter() - start
    x = observations(graph.database, graph.config.coordinates, character)
    x = x[graph.frames[clusters.spacing // 2 :: clusters.spacing]]
    rng = np.random.default_rng(seed)
    start = time.perf_counter()
    with threadpool_limits(limits=1):
        tried = [
            fit_from_means(x, x[rng.choice(len(x), len(clusters), replace=False)])
            for _ in range(count)
        ]
    trying_s = time.perf_counter() - start
    likelihoods = [mixture.log_likelihood(x) for mixture in tried]
    own = clusters.mixture.log_likelihood(x)
    return {
        "frames": len(graph.frames),
        "observations": len(x),
        "clusters": len(clusters),
        "clustering_s": seconds,
        "log_likelihood": own,
        "bic": clusters.mixture.bic(x),
        "random_starts": count,
        "random_starts_s": trying_s,
        "random_best_log_likelihood": max(likelihoods),
        "random_best_bic": max(mixture.bic(x) for mixture in tried),
        "random_median_log_likelihood": float(np.median(likelihoods)),
        "log_likelihood_gained": own - max(likelihoods),
    }


STUDY = Study(
    "clusters",
    "clusters found without seeds picked by hand, beside the best of 20 random starts",
    "2 min",
    of_graphs(measure, WORLDS, 20, 2),
    (
        Target("log_likelihood_gained", "at least 0", at_least=0.0),
        Target("clustering_s", "seconds", at_most=10.0),
    ),
    notes=(
        "Random starts get the number of clusters that growing has found, begin at frames drawn "
        "at random, and run as long.",
    ),
)
