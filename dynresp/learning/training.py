"""Train a classifier on a dataset."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning.choice_metrics import in_use, measure
from dynresp.learning.class_groups import Groups
from dynresp.learning.holdout import Split
from dynresp.learning.labelled_samples import Labelled, groups_of, labelled
from dynresp.learning.svm_fitting import (
    Parameters,
    TriedParameters,
    best_first,
    cross_validate,
    fit_pipeline,
    run_in_thread,
)
from dynresp.response.prediction.classifier import GROUPINGS, Classifier, TrainedFor, TrainedOn
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import FEATURE_NAMES, SLICES_S, vector_columns
from dynresp.support.errors import UnknownNameError, UsageError
from dynresp.support.progress import Progress

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

# Settings that act after the choice, and so change no label.
_AFTERWARDS = ("blend_s", "second_pass", "carry_on_s")


FOLDS = 3
"""Folds of the cross-validation."""
SEARCHED_SAMPLES = 6_000
"""All parameters are tried on at most this many samples."""
FINALISTS = 4
"""So many of the best parameters are tried again on four times as many samples, if there are as
many: the best parameters for few samples need not be the best for many."""


@dataclass(frozen=True)
class TrainConfig:
    """How a classifier is trained.

    Attributes:
        vector: The feature vector, "large" or "small".
        slices_s: Which slices of it [s].
        grouping: Classes, one of `GROUPINGS`: reactions or strategies.
        samples: Train on at most this many samples; None for all that are not held out.
        split: Which samples are held out.
        components: Principal components to try for the exact model.
        penalties: Values of C to try.
        gamma_factors: Values of gamma to try, as multiples of scikit-learn's "scale".
        reduced_components: Principal components of the reduced model.
    """

    vector: str = "large"
    slices_s: tuple[float, ...] = SLICES_S
    grouping: str = GROUPINGS[0]
    samples: int | None = None
    split: Split = field(default_factory=Split)
    components: tuple[int, ...] = (40, 64, 100)
    penalties: tuple[float, ...] = (1.0, 10.0, 100.0)
    gamma_factors: tuple[float, ...] = (0.5, 1.0)
    reduced_components: int = 32

    def __post_init__(self) -> None:
        """Check what can be checked without data.

        Raises:
            UsageError: A value is out of range; the message names it.
        """
        if self.grouping not in GROUPINGS:
            raise UnknownNameError("grouping of classes", self.grouping, GROUPINGS)
        vector_columns(self.vector, self.slices_s)
        if self.samples is not None and self.samples < 2:
            raise UsageError(f"samples must be at least 2, got {self.samples}")
        grids = (self.components, self.penalties, self.gamma_factors)
        if any(not values or min(values) <= 0 for values in grids):
            raise UsageError("components, penalties and gamma_factors need values above 0")
        if self.reduced_components < 1:
            raise UsageError(
                f"reduced_components must be at least 1, got {self.reduced_components}"
            )

    def grid(self, features: int) -> list[Parameters]:
        """All parameters to try, without duplicates if there are fewer features than components."""
        components = dict.fromkeys(min(k, features) for k in self.components)
        return [Parameters(*p) for p in product(components, self.penalties, self.gamma_factors)]


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained classifier.

    Attributes:
        classifier: The classifier.
        pipelines: The scikit-learn pipelines that it was compiled from: "exact", "reduced".
    """

    classifier: Classifier
    pipelines: Mapping[str, Pipeline]


def train(dataset: Dataset, config: TrainConfig, progress: Progress) -> Trained:
    """Train a classifier.

    Args:
        dataset: Labelled hits.
        config: How.
        progress: Called with stage, number done, and number in all.

    Returns:
        The classifier, and the pipelines that it was compiled from.

    Raises:
        UsageError: There are too few samples, or too few classes among them.
    """
    from threadpoolctl import threadpool_limits

    began = time.perf_counter()
    groups = groups_of(dataset, config.grouping)
    columns = vector_columns(config.vector, config.slices_s)
    usable = labelled(dataset, groups, columns)
    learning = usable.take(config.split.trained(usable.index, config.samples))
    _check_enough(learning, groups, len(dataset))

    # One thread: the same bits on any number of cores; and on a busy machine, many small matrices
    # take several threads a hundred times as long.
    with threadpool_limits(limits=1):
        tried = _search(learning, groups.carry_on, config, progress)
        models = _fit_models(learning, best_first(tried[-1])[0].parameters, config, progress)

    progress("evaluating", 0, 1)
    held_out = usable.take(config.split.is_held_out(usable.index))
    present = models["exact"].pipeline.classes_
    choices = {name for own in present for name in groups.members[own]}
    counts = np.bincount(learning.labels, minlength=len(groups.names))
    names = tuple(FEATURE_NAMES[column] for column in columns)
    facts = dataset.facts
    classifier = Classifier(
        grouping=config.grouping,
        classes=tuple(groups.names[own] for own in present),
        members=tuple(groups.members[own] for own in present),
        absent=tuple(name for name in facts.classes if name not in choices),
        feature_names=names,
        trained_for=TrainedFor(facts.library, facts.library_identity, facts.character_identity),
        trained_on=TrainedOn(
            dataset=facts.origin,
            count=facts.count,
            samples=len(learning),
            limit=config.samples,
            seed=config.split.seed,
            held_out=config.split.held_out,
        ),
        settings={k: v for k, v in facts.settings.items() if k not in _AFTERWARDS},
        exact=models["exact"].predictor,
        reduced=models["reduced"].predictor,
        facts={
            "vector": config.vector,
            "slices_s": sorted({float(name.partition("/")[0]) for name in names}),
            "plan": facts.spec["plan"]["name"],
            "bases": list(facts.bases),
            "left_out": len(dataset) - len(usable),
            "samples_per_class": dict(zip(groups.names, counts.tolist(), strict=True)),
            "models": {
                name: {**model.about(), "held_out": model.metrics(held_out, groups.carry_on)}
                for name, model in models.items()
            },
            "cross_validation": {
                "folds": FOLDS,
                "rounds": [[item.to_json() for item in tries] for tries in tried],
            },
            "training_s": round(time.perf_counter() - began, 2),
        },
    )
    progress("evaluating", 1, 1)
    return Trained(classifier, {name: model.pipeline for name, model in models.items()})


def _search(
    learning: Labelled, carry_on: int, config: TrainConfig, progress: Progress
) -> list[list[TriedParameters]]:
    """Cross-validate all parameters on some samples, then the best ones on more samples."""
    grid = config.grid(learning.features.shape[1])
    size, rounds = SEARCHED_SAMPLES, []
    while True:
        some = learning.take(config.split.searched(learning.index, size))
        folds = config.split.folds(some.index, some.labels, FOLDS)
        rounds.append(cross_validate(some, folds, carry_on, grid, progress))
        if len(rounds) == 2 or len(learning) <= size:
            return rounds
        grid = [item.parameters for item in best_first(rounds[-1])[:FINALISTS]]
        size *= 4


@dataclass(frozen=True, eq=False)
class _Model:
    """A fitted pipeline and what it was compiled to."""

    pipeline: Pipeline
    predictor: PairwiseQuadratic
    parameters: Parameters
    fit_s: float

    def about(self) -> dict[str, Any]:
        _, axes, machine = (step for _, step in self.pipeline.steps)
        return {
            "components": int(axes.n_components_),
            "variance_kept": round(float(axes.explained_variance_ratio_.sum()), 4),
            "penalty": self.parameters.penalty,
            "gamma_factor": self.parameters.gamma_factor,
            "gamma": float(machine.gamma),
            "support_vectors": int(machine.n_support_.sum()),
            "fit_s": round(self.fit_s, 2),
        }

    def metrics(self, samples: Labelled, carry_on: int) -> dict[str, Any] | None:
        """Metrics on held-out samples; None if there are none."""
        if not len(samples):
            return None
        most = min(3, self.predictor.classes)
        ranked = self.pipeline.classes_[self.predictor.rank(samples.features, most)]
        used = in_use(ranked, samples.errors, samples.grazes, carry_on, samples.carry_on_limit)
        return {
            **measure(used, samples.labels, samples.errors).to_json(),
            "alone": measure(ranked, samples.labels, samples.errors).to_json(),
        }


def _fit_models(
    learning: Labelled, best: Parameters, config: TrainConfig, progress: Progress
) -> dict[str, _Model]:
    """The exact model, and the reduced one: the same parameters with fewer components."""
    fewer = replace(best, components=min(config.reduced_components, best.components))
    models = {}
    for done, (name, parameters) in enumerate((("exact", best), ("reduced", fewer))):
        stage = f"fitting the {name} model to {len(learning)} samples"
        progress(stage, done, 2)
        began = time.perf_counter()
        pipeline = run_in_thread(
            partial(fit_pipeline, learning.features, learning.labels, parameters),
            partial(progress, stage, done, 2),
        )
        took = time.perf_counter() - began
        predictor = PairwiseQuadratic.from_pipeline(pipeline)
        if name == "reduced":
            predictor = predictor.single_precision()
        models[name] = _Model(pipeline, predictor, parameters, took)
    return models


def _check_enough(learning: Labelled, groups: Groups, count: int) -> None:
    """Refuse too few samples or classes."""
    counts = np.bincount(learning.labels, minlength=len(groups.names))
    if np.count_nonzero(counts >= FOLDS) >= 2:
        return
    seen = ", ".join(f"{n} {name}" for name, n in zip(groups.names, counts, strict=True) if n)
    raise UsageError(
        f"a classifier needs at least two classes with {FOLDS} samples or more; of {count} samples "
        f"there are to train on: {seen or 'none'}. Generate more samples of different impacts."
    )
