"""Small graphs of random frames, ways and clusters, for tests of the cluster forest."""

import numpy as np

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import Mixture
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph, PruningCounts
from tests.locomotion.graph.graph_samples import made_database


def random_forest(
    rng: np.random.Generator,
    lengths: tuple[int, ...] = (7, 6),
    jumps: int = 6,
    clusters: int = 3,
    **settings: object,
) -> ClusterForest:
    """Clips with random jumps between them, and clusters that last a few frames.

    Args:
        rng: Where chance comes from.
        lengths: Frames of each clip.
        jumps: How many there are, beside one from the end of every clip.
        clusters: How many there are.
        settings: Of the graph.
    """
    database = made_database(rng, lengths)
    n = len(database)
    ends = [clip.stop - 1 for clip in database.clips]
    inner = np.setdiff1d(np.arange(n), [clip.start for clip in database.clips])
    ways = {(i, int(j)) for i, j in enumerate(database.successors) if j >= 0}
    for source in [*ends, *rng.choice(n, jumps)]:
        ways.add((int(source), int(rng.choice(inner))))
    recorded = np.array([database.successors[i] == j for i, j in sorted(ways)])
    order = np.lexsort((~recorded, np.array([i for i, _ in sorted(ways)])))
    sources, targets = np.array(sorted(ways))[order].T
    distances = np.where(recorded[order], 0.0, rng.uniform(0.01, 0.2, len(ways)))
    offsets = np.concatenate([[0], np.cumsum(np.bincount(sources, minlength=n))])
    graph = MotionGraph(
        database,
        GraphConfig(**settings),  # type: ignore[arg-type]
        PruningCounts(n, n * n, 0, 0, None, 0, 0, n),
        offsets.astype(np.int64),
        targets.astype(np.int32),
        distances.astype(np.float32),
    )
    labels = np.repeat(rng.integers(0, clusters, n), rng.integers(1, 4, n))[:n].astype(np.int32)
    logs = np.log(rng.dirichlet(np.ones(clusters), n))
    # The cluster of a frame is its most probable one.
    best, rows = logs.argmax(axis=1), np.arange(n)
    logs[rows, best], logs[rows, labels] = logs[rows, labels].copy(), logs[rows, best].copy()
    mixture = Mixture(
        np.full(clusters, 1.0 / clusters), rng.normal(0.0, 1.0, (clusters, 36)), np.ones(clusters)
    )
    examples = rng.integers(0, n, clusters).astype(np.int32)
    return ClusterForest(
        graph, Clusters(mixture, labels, logs.astype(np.float32), examples, 1, (), False)
    )
