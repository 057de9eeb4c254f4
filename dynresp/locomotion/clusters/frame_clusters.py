"""Clusters of frames: the states of the higher layer (Lee et al. 2002, section 4.2.1).

Neighbouring frames are nearly the same, so they are no independent observations: given all of
them, BIC goes on rising far past any number of clusters that serves a user. Frames are therefore
thinned to where they decorrelate, at most to one a second, and the number of clusters is bounded
as well; `Clusters.bounded` says whether the bound decided. All frames are then assigned.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.cluster_observations import decorrelation, observations
from dynresp.locomotion.clusters.gaussian_mixture import (
    CurvePoint,
    Mixture,
    MixtureConfig,
    fit_mixture,
)
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class ClusterConfig:
    """How frames are clustered.

    Attributes:
        mixture: How the mixture is fitted; its `most` bounds the number of clusters.
        spacing_s: Time between the frames it is fitted to [s]; None for where observations
            decorrelate, at most 1 s.
    """

    mixture: MixtureConfig = field(default_factory=MixtureConfig)
    spacing_s: float | None = None

    def __post_init__(self) -> None:
        """Check the spacing.

        Raises:
            UsageError: It is not above 0.
        """
        if self.spacing_s is not None and not 0.0 < self.spacing_s < np.inf:
            raise UsageError(f"spacing_s must be above 0, got {self.spacing_s}")


@dataclass(frozen=True, eq=False)
class Clusters:
    """The cluster of every frame of a motion graph. Arrays are read-only.

    Attributes:
        mixture: The clusters; see `observations` for what their means are made of.
        labels: (n,) the most probable cluster of each frame of the database.
        log_probabilities: (n, K) log P(cluster | frame).
        examples: (K,) the frame of the graph that is closest to each cluster's mean, among those
            of the cluster; the pose that stands for it.
        spacing: Frames from one frame that the mixture was fitted to, to the next.
        curve: What growing reached at every number of clusters; one point with given seeds.
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
        config: ClusterConfig | None = None,
        seeds: Sequence[int] | None = None,
        character: Character | None = None,
    ) -> Clusters:
        """Cluster the frames of a graph.

        Args:
            graph: Its frames count; those of the database that cannot be reached are assigned,
                but nothing is fitted to them.
            config: Settings.
            seeds: Frames of the graph to begin with, one for each cluster, as the paper's authors
                picked them; found automatically where none are given.
            character: Whose motions they are, by default the product's own.

        Raises:
            UsageError: Seeds that are no frames of the graph, or not different.
        """
        config = config or ClusterConfig()
        database = graph.database
        x = observations(database, graph.config.coordinates, character or default_character())
        if config.spacing_s is None:
            spacing = decorrelation(x, database, longest_s=1.0)
        else:
            spacing = max(round(config.spacing_s * database.fps), 1)
        kept = graph.frames[spacing // 2 :: spacing]
        kept = graph.frames if len(kept) == 0 else kept
        rows = None
        if seeds is not None:
            strangers = sorted(set(seeds) - set(graph.frames.tolist()))
            if strangers:
                raise UsageError(
                    f"seeds {strangers} are no frames of the graph; see MotionGraph.frames"
                )
            kept = np.union1d(kept, np.asarray(seeds, dtype=np.int32))
            rows = [int(row) for row in np.searchsorted(kept, seeds)]
        fit = fit_mixture(x[kept], config.mixture, rows)
        logs = fit.mixture.log_posteriors(x)
        labels = np.argmax(logs, axis=1).astype(np.int32)
        mixture, labels, logs = _with_frames(fit.mixture, labels, logs, graph.frames)
        own = x[graph.frames]
        examples = np.empty(len(mixture), dtype=np.int32)
        for k, mean in enumerate(mixture.means):
            distances = np.sum((own - mean) ** 2, axis=1)
            distances[labels[graph.frames] != k] = np.inf
            examples[k] = graph.frames[np.argmin(distances)]
        return cls(
            mixture, labels, logs.astype(np.float32), examples, spacing, fit.curve, fit.bounded
        )

    def __len__(self) -> int:
        """Number of clusters."""
        return len(self.examples)

    @functools.cached_property
    def apart(self) -> FloatArray:
        """(K, K) squared distances of the clusters' means."""
        means = self.mixture.means
        squared: FloatArray = np.sum((means[:, None] - means) ** 2, axis=2)
        squared.flags.writeable = False
        return squared


def _with_frames(
    mixture: Mixture, labels: IntArray, logs: npt.NDArray[np.float64], frames: IntArray
) -> tuple[Mixture, IntArray, npt.NDArray[np.float64]]:
    """Without clusters that are no frame's most probable one; what is left adds up to 1 again."""
    used = np.unique(labels[frames])
    if len(used) == len(mixture):
        return mixture, labels, logs
    weights = mixture.weights[used]
    left = Mixture(weights / weights.sum(), mixture.means[used], mixture.variances[used])
    logs = logs[:, used]
    logs = logs - np.logaddexp.reduce(logs, axis=1)[:, None]
    return left, np.argmax(logs, axis=1).astype(np.int32), logs
