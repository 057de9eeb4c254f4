"""`Classifier`: predicts from a look-ahead which reaction the full search (oracle) would choose."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import FEATURE_NAMES
from dynresp.support.errors import UsageError

Grouping: TypeAlias = Literal["reactions", "strategies"]
GROUPINGS: tuple[str, ...] = get_args(Grouping)
"""What a class stands for: one reaction, or all reactions of a strategy."""

_HOW_TO_TRAIN = "train one for them with `dynresp generate` and `dynresp train`"


class ClassifierError(UsageError):
    """A classifier cannot be used: its file is damaged, or it was trained for something else."""


@dataclass(frozen=True)
class TrainedFor:
    """The library and character that a classifier was trained for.

    Attributes:
        library_name: Name of the reaction library.
        library: The library's identity.
        character: The character's identity.
    """

    library_name: str
    library: str
    character: str

    @classmethod
    def of(cls, library: ReactionLibrary, character: Character) -> TrainedFor:
        """What a classifier for a library and a character is trained for."""
        return cls(library.name, library.identity, character.identity)


@dataclass(frozen=True)
class TrainedOn:
    """The samples that a classifier was trained on (see `dynresp.learning.holdout`).

    Attributes:
        dataset: Origin of the dataset (`datasets.facts.Facts.origin`); it does not depend on the
            number of samples.
        count: Number of samples in the dataset, misses included.
        samples: Number of samples used in training.
        limit: Largest number of samples to use; None for all that were not held out.
        seed: Seed of the random choice of samples that were held out.
        held_out: Share of samples that were held out.
    """

    dataset: str
    count: int
    samples: int
    limit: int | None
    seed: int
    held_out: float


@dataclass(frozen=True, eq=False)
class Classifier:
    """A trained model and what is known of it.

    Attributes:
        grouping: What a class stands for, one of `GROUPINGS`.
        classes: Names of the classes that it can predict: reactions or strategies, and `carry_on`
            for no reaction.
        members: For each class its choices: names of reactions, or `carry_on`.
        absent: Choices of the library that no training sample had, so that they have no class.
        feature_names: The features that it takes, some of `hit_features.FEATURE_NAMES`.
        trained_for: Library and character.
        trained_on: Samples.
        settings: The settings on which the training labels depend, by name.
        exact: Predicts as the support vector machine does.
        reduced: Predicts from fewer principal components; faster.
        facts: What was measured in training, as JSON values.

    Raises:
        ClassifierError: The parts do not fit together; the message says which.
    """

    grouping: str
    classes: tuple[str, ...]
    members: tuple[tuple[str, ...], ...]
    absent: tuple[str, ...]
    feature_names: tuple[str, ...]
    trained_for: TrainedFor
    trained_on: TrainedOn
    settings: Mapping[str, Any]
    exact: PairwiseQuadratic
    reduced: PairwiseQuadratic
    facts: Mapping[str, Any]
    _columns: npt.NDArray[np.intp] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Find the features' columns, and check that all parts fit together."""
        positions = {name: column for column, name in enumerate(FEATURE_NAMES)}
        unknown = [name for name in self.feature_names if name not in positions]
        if unknown or not self.feature_names:
            raise ClassifierError(
                f"the classifier takes {unknown[0] if unknown else 'no feature'!r}, which is not a "
                f"feature of this version of dynresp; {_HOW_TO_TRAIN}"
            )
        columns = np.array([positions[name] for name in self.feature_names], dtype=np.intp)
        columns.flags.writeable = False
        object.__setattr__(self, "_columns", columns)
        names = [name for choices in self.members for name in choices]
        predictors = (self.exact, self.reduced)
        widths = [predictor.projection.shape[1] for predictor in predictors]
        problems = {
            f"an unknown grouping, {self.grouping!r}": self.grouping not in GROUPINGS,
            "members of other classes": len(self.members) != len(self.classes),
            "a class without members": not all(self.members),
            "a class twice": len(set(self.classes)) < len(self.classes),
            "a choice in two classes": len(set(names)) < len(names),
            "a choice both present and absent": not set(names).isdisjoint(self.absent),
            "a predictor of other classes": any(p.classes != len(self.classes) for p in predictors),
            "a predictor of other features": widths != [len(columns)] * 2,
        }
        for problem, found in problems.items():
            if found:
                raise ClassifierError(
                    f"the classifier has {problem}; train it again with `dynresp train`"
                )

    @property
    def columns(self) -> npt.NDArray[np.intp]:
        """Columns of its features in `hit_features.FEATURE_NAMES`; read-only."""
        return self._columns

    def rank(
        self, features: npt.ArrayLike, best: int = 1, *, reduced: bool = False
    ) -> npt.NDArray[np.int64]:
        """Predict the best classes.

        Args:
            features: (n, all features) or (all features,), in the order of
                `hit_features.FEATURE_NAMES`; those that the classifier does not take may be NaN.
            best: How many classes.
            reduced: Whether to use the reduced model.

        Returns:
            (n, best) indices into `classes`, the best first.

        Raises:
            UsageError: The features have another shape, or one that is used is not finite; or
                `best` is not between one and the number of classes.
        """
        rows = np.asarray(features)
        if rows.ndim not in (1, 2) or rows.shape[-1] != len(FEATURE_NAMES):
            raise UsageError(
                f"features have the shape {rows.shape}; expected (n, {len(FEATURE_NAMES)}) or "
                f"({len(FEATURE_NAMES)},)"
            )
        predictor = self.reduced if reduced else self.exact
        return predictor.rank(rows.take(self._columns, axis=-1), best)

    def check(self, given: TrainedFor) -> None:
        """Refuse a library or character that it was not trained for.

        Args:
            given: The library and character to use it with.

        Raises:
            ClassifierError: It was trained for something else; the message says what.
        """
        own = self.trained_for
        if own.character != given.character:
            raise ClassifierError(
                f"the classifier was trained for another character ({own.character}) than this one "
                f"({given.character}); {_HOW_TO_TRAIN}"
            )
        if own.library != given.library:
            raise ClassifierError(
                f"the classifier was trained for the library {own.library_name!r} "
                f"({own.library}), not for {given.library_name!r} as it is on this machine "
                f"({given.library}); {_HOW_TO_TRAIN}"
            )

    def differing_settings(self, given: Mapping[str, Any]) -> list[str]:
        """Names of settings that differ from training, so that the labels would differ.

        Args:
            given: The settings in use, by name; it may hold others, too.
        """
        return [
            name
            for name, value in self.settings.items()
            # JSON has no tuples.
            if json.dumps(given.get(name)) != json.dumps(value)
        ]
