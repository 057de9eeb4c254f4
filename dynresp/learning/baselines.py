"""Baselines that any classifier must beat: nearest neighbours, the most frequent class, chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynresp.learning.choice_metrics import Choices
from dynresp.learning.labelled_samples import Labelled
from dynresp.support.extras import require

NEIGHBOURS = 7
"""Number of neighbours that vote."""


def nearest_neighbours(
    learning: Labelled, features: npt.NDArray[np.float32], classes: int
) -> Choices:
    """The two most frequent classes among the nearest samples.

    Distances are of standardised features. With equal votes, the class of the nearer neighbour
    comes first; if all neighbours agree, the second class is the most frequent of the others.

    Args:
        learning: The training samples.
        features: (n, F) of the samples to predict.
        classes: How many classes there are.

    Returns:
        (n, 2) classes.
    """
    require("sklearn")
    from sklearn.neighbors import NearestNeighbors

    mean = learning.features.mean(axis=0, dtype=np.float64)
    spread = learning.features.std(axis=0, dtype=np.float64)
    spread[spread == 0.0] = 1.0
    neighbours = min(NEIGHBOURS, len(learning))
    search = NearestNeighbors(n_neighbors=neighbours, algorithm="brute")
    search.fit(((learning.features - mean) / spread).astype(np.float32))
    found = search.kneighbors(
        ((features - mean) / spread).astype(np.float32), return_distance=False
    )
    votes = np.zeros((len(features), classes))
    rows = np.arange(len(features))
    for rank in range(neighbours):
        # Nearer neighbours count a little more: together less than a vote.
        votes[rows, learning.labels[found[:, rank]]] += 1.0 + 0.5 ** (rank + 2)
    frequency = np.bincount(learning.labels, minlength=classes) / len(learning)
    return _two_best(votes + 1e-3 * frequency)


def most_frequent(counts: Sequence[int], samples: int) -> Choices:
    """The two most frequent classes of the training samples, for every sample.

    Args:
        counts: Of the training samples of each class.
        samples: Number of samples to predict.

    Returns:
        (samples, 2) classes.
    """
    return np.repeat(_two_best(np.asarray(counts, dtype=np.float64)[None]), samples, axis=0)


def at_random(classes: Sequence[int], samples: int, rng: np.random.Generator) -> Choices:
    """Two different random classes for each sample.

    Args:
        classes: Those to choose from, at least two.
        samples: Number of samples to predict.
        rng: Random numbers.

    Returns:
        (samples, 2) classes.
    """
    first = rng.integers(len(classes), size=samples)
    second = (first + rng.integers(1, len(classes), size=samples)) % len(classes)
    return np.asarray(classes, dtype=np.intp)[np.stack([first, second], axis=1)]


def _two_best(scores: npt.NDArray[np.float64]) -> Choices:
    return np.argsort(-scores, axis=1, kind="stable")[:, :2]
