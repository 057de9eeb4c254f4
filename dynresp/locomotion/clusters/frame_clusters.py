"""Assign every frame of a motion graph to a cluster (Lee et al. 2002, section 4.2.1).

Neighbouring frames are nearly equal, so they are not independent observations: if the mixture is
fitted to all of them, BIC rises far past any number of clusters that serves a user. So the mixture
is fitted to few frames, at most one a second, far enough from each other that they are nearly
independent, and the number of clusters has a limit; `Clusters.bounded` says whether that limit
decided. Then all frames are assigned.

`fit_clusters` clusters any observations. `Clusters.of` gives it those of
`dynresp.locomotion.clusters.cluster_observations`, and control by video those of
`dynresp.locomotion.vision.visible_clusters`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.cluster_observations import decorrelation, observations
from dynresp.locomotion.clusters.gaussian_mixture import (
    MAX_CLUSTERS,
    CurvePoint,
    Mixture,
    fit_mixture,
)
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError

# Longest time between the frames to which the mixture is fitted [s].
_MAX_SPACING_S = 1.0


@dataclass(frozen=True, eq=False)
class Clusters:
    """The cluster of every frame of a motion graph. The arrays are read-only.

    Attributes:
        mixture: The clusters; see `observations` for the numbers in their means.
        labels: (n,) the most probable cluster of each frame of the database.
        log_probabilities: (n, K) log P(cluster | frame).
        examples: (K,) the frame of each cluster, within the graph, that is nearest to its mean;
            its pose represents the cluster.
        spacing: Frames from one frame to which the mixture was fitted to the next.
        curve: How well each number of clusters fits; one point where seeds were given.
        bounded: Whether more clusters than allowed would have had a better BIC.
    """

    mixture: Mixture
    labels: IntArray
    log_probabilities: npt.NDArray[np.float32]
    examples: IntArray
    spacing: int
    curve: tuple[CurvePoint, ...]
    bounded: bool

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.labels, self.log_probabilities, self.examples):
            array.flags.writeable = False

    @classmethod
    def of(
        cls,
        graph: MotionGraph,
        max_clusters: int = MAX_CLUSTERS,
        seeds: Sequence[int] | None = None,
        character: Character | None = None,
    ) -> Clusters:
        """Cluster the frames of a graph by speed, height, leaning and joint angles.

        Args:
            graph: Its frames count. Frames of the database that cannot be reached are assigned,
                but the mixture is not fitted to them.
            max_clusters: Most clusters; seeds override it.
            seeds: Frames of the graph to start with, one for each cluster, as the paper's authors
                picked them. Without seeds the clusters are found automatically.
            character: Whose motions they are, by default the product's own.

        Raises:
            UsageError: The seeds are not different frames of the graph, or max_clusters is below 1.
        """
        database = graph.database
        x = observations(database, graph.config.coordinates, character or default_character())
        spacing = decorrelation(x, database, _MAX_SPACING_S)
        return fit_clusters(graph, x, spacing, max_clusters, seeds)

    def __len__(self) -> int:
        """Number of clusters."""
        return len(self.examples)

    @functools.cached_property
    def squared_distances(self) -> FloatArray:
        """(K, K) squared distances between the means of the clusters."""
        means = self.mixture.means
        squared: FloatArray = np.sum((means[:, None] - means) ** 2, axis=2)
        squared.flags.writeable = False
        return squared


def fit_clusters(
    graph: MotionGraph,
    x: FloatArray,
    spacing: int,
    max_clusters: int,
    seeds: Sequence[int] | None = None,
) -> Clusters:
    """Fit a mixture to some frames of a graph, and assign all frames to its clusters.

    Clusters to which no frame of the graph is assigned are dropped.

    Args:
        graph: Its frames count.
        x: (n, d) one observation for each frame of the database, in comparable units.
        spacing: Frames from one frame to which the mixture is fitted to the next.
        max_clusters: Most clusters; seeds override it.
        seeds: See `Clusters.of`.

    Raises:
        UsageError: The seeds are not different frames of the graph, or max_clusters is below 1.
    """
    fitted = graph.frames[spacing // 2 :: spacing]
    fitted = graph.frames if len(fitted) == 0 else fitted
    rows = None
    if seeds is not None:
        unknown = sorted(set(seeds) - set(graph.frames.tolist()))
        if unknown:
            raise UsageError(
                f"seeds {unknown} are no frames of the graph; choose from MotionGraph.frames"
            )
        fitted = np.union1d(fitted, np.asarray(seeds, dtype=np.int32))
        rows = [int(row) for row in np.searchsorted(fitted, seeds)]
    fit = fit_mixture(x[fitted], max_clusters, rows)
    logs = fit.mixture.log_posteriors(x)
    labels = np.argmax(logs, axis=1).astype(np.int32)
    mixture, labels, logs = _without_empty(fit.mixture, labels, logs, graph.frames)
    own = x[graph.frames]
    examples = np.empty(len(mixture), dtype=np.int32)
    for k, mean in enumerate(mixture.means):
        distances = np.sum((own - mean) ** 2, axis=1)
        distances[labels[graph.frames] != k] = np.inf
        examples[k] = graph.frames[np.argmin(distances)]
    return Clusters(
        mixture, labels, logs.astype(np.float32), examples, spacing, fit.curve, fit.bounded
    )


def _without_empty(
    mixture: Mixture, labels: IntArray, logs: npt.NDArray[np.float64], frames: IntArray
) -> tuple[Mixture, IntArray, npt.NDArray[np.float64]]:
    """Drop empty clusters; the probabilities of the others then add up to 1 again."""
    used = np.unique(labels[frames])
    if len(used) == len(mixture):
        return mixture, labels, logs
    weights = mixture.weights[used]
    left = Mixture(weights / weights.sum(), mixture.means[used], mixture.variances[used])
    logs = logs[:, used]
    logs = logs - np.logaddexp.reduce(logs, axis=1)[:, None]
    return left, np.argmax(logs, axis=1).astype(np.int32), logs
