"""What any classifier must beat: nearest neighbours, the most frequent classes, and chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynresp.learning.choice_metrics import Choices
from dynresp.learning.labelled_samples import Labelled
from dynresp.support.extras import require

NEIGHBOURS = 7
"""How many vote."""


def nearest_neighbours(
    learning: Labelled, features: npt.NDArray[np.float32], classes: int
) -> Choices:
    """The two classes that the most of the nearest samples have.

    Distances are those of the standardised features. Of equal votes the class of the nearer
    neighbour comes first; where all neighbours agree, the second class is the most frequent of the
    others.

    Args:
        learning: The samples to look among.
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
    for place in range(neighbours):
        # Half as much for each place: together less than a vote.
        votes[rows, learning.labels[found[:, place]]] += 1.0 + 0.5 ** (place + 2)
    frequency = np.bincount(learning.labels, minlength=classes) / len(learning)
    return _two_best(votes + 1e-3 * frequency)


def most_frequent(counts: Sequence[int], samples: int) -> Choices:
    """The two classes that most samples were labelled with, whatever the features.

    Args:
        counts: Of the training samples of each class.
        samples: How many to predict.

    Returns:
        (samples, 2) classes.
    """
    return np.repeat(_two_best(np.asarray(counts, dtype=np.float64)[None]), samples, axis=0)


def at_random(classes: Sequence[int], samples: int, rng: np.random.Generator) -> Choices:
    """Two different classes by chance.

    Args:
        classes: Those to choose from, at least two.
        samples: How many to predict.
        rng: The source of chance.

    Returns:
        (samples, 2) classes.
    """
    first = rng.integers(len(classes), size=samples)
    second = (first + rng.integers(1, len(classes), size=samples)) % len(classes)
    return np.asarray(classes, dtype=np.intp)[np.stack([first, second], axis=1)]


def _two_best(scores: npt.NDArray[np.float64]) -> Choices:
    return np.argsort(-scores, axis=1, kind="stable")[:, :2]
