"""The samples of a dataset that a classifier is trained on or measured with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning.choice_metrics import Choices
from dynresp.learning.class_groups import Groups, make_groups
from dynresp.motion.rotations import FloatArray
from dynresp.response.prediction.hit_features import FEATURE_NAMES
from dynresp.support.errors import UsageError


@dataclass(frozen=True, eq=False)
class Labelled:
    """Labelled samples, as arrays of length n.

    Attributes:
        index: (n,) numbers in their dataset.
        features: (n, F) the classifier's features, finite.
        labels: (n,) classes.
        errors: (n, classes) window errors [m].
        grazes: (n,) which hits were grazes.
        carry_on_limit: Largest window error with which the base motion goes on after a hit that
            is not a graze [m].
    """

    index: npt.NDArray[np.int64]
    features: npt.NDArray[np.float32]
    labels: Choices
    errors: FloatArray
    grazes: npt.NDArray[np.bool_]
    carry_on_limit: float

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.labels)

    def take(self, rows: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Labelled:
        """Some of them."""
        return Labelled(
            self.index[rows],
            self.features[rows],
            self.labels[rows],
            self.errors[rows],
            self.grazes[rows],
            self.carry_on_limit,
        )


def groups_of(dataset: Dataset, by: str) -> Groups:
    """The classes of a dataset's choices.

    Args:
        dataset: The dataset.
        by: "reactions" or "strategies".

    Raises:
        UnknownNameError: There is no such grouping.
        UsageError: The dataset has other features than this version of dynresp.
    """
    facts = dataset.facts
    if facts.feature_names != FEATURE_NAMES:
        raise UsageError(
            "the dataset has other features than this version of dynresp computes; generate it "
            "again into another folder"
        )
    return make_groups(facts.classes, facts.strategies, facts.mirrors, by)


def labelled(dataset: Dataset, groups: Groups, columns: npt.NDArray[np.intp]) -> Labelled:
    """The samples of a dataset that can be used.

    Misses, diverged simulations and samples with missing features are left out.

    Args:
        dataset: The dataset.
        groups: Its classes.
        columns: The features to take.
    """
    rows = np.flatnonzero(dataset.label >= 0)
    features = dataset.features[np.ix_(rows, columns)]
    whole = np.isfinite(features).all(axis=1)
    rows = rows[whole]
    return Labelled(
        index=dataset.index[rows],
        features=features[whole],
        labels=groups.labels(dataset.label[rows]),
        errors=groups.errors(dataset.errors[rows]),
        grazes=dataset.graze[rows],
        carry_on_limit=float(dataset.facts.settings["carry_on_max_error_m"]),
    )
