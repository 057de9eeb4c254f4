"""A trained classifier: which reaction the oracle would choose, told from how a hit begins."""

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

_AGAIN = "train one for them with `dynresp generate` and `dynresp train`"


class ClassifierError(UsageError):
    """A classifier that cannot be used: a damaged file, or one trained for something else."""


@dataclass(frozen=True)
class TrainedFor:
    """What a classifier belongs to.

    Attributes:
        library_name: Name of the reaction library.
        library: Its identity.
        character: The character's identity.
    """

    library_name: str
    library: str
    character: str

    @classmethod
    def of(cls, library: ReactionLibrary, character: Character) -> TrainedFor:
        """What a classifier for these would belong to."""
        return cls(library.name, library.identity, character.identity)


@dataclass(frozen=True)
class TrainedOn:
    """Which samples a classifier was trained on (`dynresp.learning.holdout`).

    Attributes:
        dataset: Origin of the dataset (`datasets.facts.Facts.origin`), the same however many
            samples it has.
        count: How many samples the dataset had, misses and all.
        samples: How many of them were trained on.
        limit: How many were asked for; None for all that were not held out.
        seed: Of the chance by which samples were held out.
        held_out: Share that was held out.
    """

    dataset: str
    count: int
    samples: int
    limit: int | None
    seed: int
    held_out: float


@dataclass(frozen=True, eq=False)
class Classifier:
    """What a trained model is and what it predicts.

    Attributes:
        grouping: What a class stands for, one of `GROUPINGS`.
        classes: Names of the classes that can be predicted: of reactions or strategies, and
            `carry_on` to go on with the base motion.
        members: For each class the choices that belong to it: names of reactions, or `carry_on`.
        absent: Choices of the library that no training sample was labelled with, so that no class
            stands for them.
        feature_names: The features that it takes, some of `features.FEATURE_NAMES`.
        trained_for: Library and character.
        trained_on: Samples.
        settings: The settings that decided over the labels, by name.
        exact: Predicts as the support vector machine does.
        reduced: Predicts from fewer principal components, where speed counts more.
        facts: What was measured in training, as JSON has it.
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
        """Find the features' columns and check that all parts fit together.

        Raises:
            ClassifierError: They do not; the message says which.
        """
        places = {name: column for column, name in enumerate(FEATURE_NAMES)}
        unknown = [name for name in self.feature_names if name not in places]
        if unknown or not self.feature_names:
            raise ClassifierError(
                f"the classifier takes {unknown[0] if unknown else 'no feature'!r}, which is no "
                f"feature of this version of dynresp; {_AGAIN}"
            )
        columns = np.array([places[name] for name in self.feature_names], dtype=np.intp)
        columns.flags.writeable = False
        object.__setattr__(self, "_columns", columns)
        names = [name for own in self.members for name in own]
        predictors = (self.exact, self.reduced)
        wide = [predictor.projection.shape[1] for predictor in predictors]
        problems = {
            f"an unknown grouping, {self.grouping!r}": self.grouping not in GROUPINGS,
            "members of other classes": len(self.members) != len(self.classes),
            "a class without members": not all(self.members),
            "a class twice": len(set(self.classes)) < len(self.classes),
            "a choice in two classes": len(set(names)) < len(names),
            "a choice both present and absent": not set(names).isdisjoint(self.absent),
            "a predictor of other classes": any(p.classes != len(self.classes) for p in predictors),
            "a predictor of other features": wide != [len(columns)] * 2,
        }
        for problem, found in problems.items():
            if found:
                raise ClassifierError(f"the classifier has {problem}; train it anew")

    @property
    def columns(self) -> npt.NDArray[np.intp]:
        """Columns of the features that it takes, in `features.FEATURE_NAMES`; read-only."""
        return self._columns

    def rank(
        self, features: npt.ArrayLike, best: int = 1, *, reduced: bool = False
    ) -> npt.NDArray[np.int64]:
        """Predict the best classes.

        Args:
            features: (n, all features) or (all features,), in the order of
                `features.FEATURE_NAMES`; those that the classifier does not take may be NaN.
            best: How many.
            reduced: Take the reduced model.

        Returns:
            (n, best) indices into `classes`, the best first.

        Raises:
            UsageError: Features of another shape, or not finite where they are taken; `best` is
                not between one and the number of classes.
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
        """Refuse another library or character than what it was trained for.

        Args:
            given: What it shall be used with.

        Raises:
            ClassifierError: It was trained for something else; the message says what.
        """
        own = self.trained_for
        if own.character != given.character:
            raise ClassifierError(
                f"the classifier was trained for another character ({own.character}) than this one "
                f"({given.character}); {_AGAIN}"
            )
        if own.library != given.library:
            raise ClassifierError(
                f"the classifier was trained for the library {own.library_name!r} "
                f"({own.library}), not for {given.library_name!r} as it is on this machine "
                f"({given.library}); {_AGAIN}"
            )

    def differing_settings(self, given: Mapping[str, Any]) -> list[str]:
        """Names of settings under which the oracle would choose otherwise than in training.

        Args:
            given: The settings in force, by name; those that do not decide over labels may be
                there, too.
        """
        return [
            name
            for name, value in self.settings.items()
            # JSON has no tuples.
            if json.dumps(given.get(name)) != json.dumps(value)
        ]
