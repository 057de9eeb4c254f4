"""Measure how well a classifier chooses, on samples that it was not trained on."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning.baselines import at_random, most_frequent, nearest_neighbours
from dynresp.learning.choice_metrics import (
    Choices,
    confusion,
    in_use,
    measure,
    merge_mirrors,
)
from dynresp.learning.class_groups import Groups
from dynresp.learning.holdout import Split
from dynresp.learning.labelled_samples import Labelled, groups_of, labelled
from dynresp.learning.prediction_latency import latency_us
from dynresp.response.prediction.classifier import Classifier, ClassifierError, TrainedFor
from dynresp.support.errors import UsageError
from dynresp.support.progress import Progress

# Most samples that nearest neighbours predict: a second with a hundred thousand training samples.
_MAX_NEIGHBOUR_SAMPLES = 2_000


def evaluate(classifier: Classifier, dataset: Dataset, progress: Progress) -> dict[str, Any]:
    """Measure how well a classifier chooses.

    Of its own training dataset only the held-out samples count; of any other dataset all. Misses
    and samples with missing features are left out.

    Args:
        classifier: The classifier.
        dataset: Labelled hits, of the same library and character.
        progress: Called with stage, number done, and number in all.

    Returns:
        The content of `evaluation.json`; `docs/learning.md` explains it. The values at the top are
        of the exact model, with mirror images as two classes.

    Raises:
        ClassifierError: The dataset is of another library or character.
        UsageError: There are no samples to measure with.
    """
    facts = dataset.facts
    classifier.check(TrainedFor(facts.library, facts.library_identity, facts.character_identity))
    groups = groups_of(dataset, classifier.grouping)
    unknown = [name for name in classifier.classes if name not in groups.names]
    if unknown:
        raise ClassifierError(
            f"the classifier predicts {unknown[0]!r}, which is not in the dataset; train it again"
        )
    known = np.array([groups.names.index(name) for name in classifier.classes], dtype=np.intp)
    usable = labelled(dataset, groups, classifier.columns)
    learning, judged = _split_samples(classifier, dataset, usable)

    progress("predicting", 0, 1)
    most = min(3, len(classifier.classes))
    exact = known[classifier.exact.rank(judged.features, most)]
    reduced = known[classifier.reduced.rank(judged.features, most)]
    progress("comparing", 0, 1)
    baselines = _baselines(classifier, groups, known, learning, judged)
    progress("measuring", 0, 1)
    latency = latency_us(classifier, dataset.features[np.isin(dataset.index, judged.index[:300])])
    progress("measuring", 1, 1)
    return {
        "model": _model_summary(classifier),
        "dataset": {
            "plan": facts.spec["plan"]["name"],
            "identity": facts.identity,
            "library": facts.library,
            "bases": list(facts.bases),
            "samples": len(dataset),
        },
        "samples": len(judged),
        "held_out_only": facts.origin == classifier.trained_on.dataset,
        "left_out": {
            "nothing_hit": int(np.count_nonzero(dataset.label < 0)),
            "features_missing": int(np.count_nonzero(dataset.label >= 0)) - len(usable),
            "not_held_out": len(usable) - len(judged),
        },
        "differing_settings": classifier.differing_settings(facts.settings),
        **_metrics(exact, judged, groups),
        "reduced": {
            **_metrics(reduced, judged, groups),
            "agreement": float(np.mean(exact[:, 0] == reduced[:, 0])),
        },
        "baselines": baselines,
        "per_strategy": _per_strategy(_in_use(exact, judged, groups), judged, groups),
        "confusion": {
            "classes": list(groups.names),
            "counts": confusion(
                _in_use(exact, judged, groups)[:, 0], judged.labels, len(groups.names)
            ).tolist(),
        },
        "latency_us": latency,
    }


def _split_samples(
    classifier: Classifier, dataset: Dataset, usable: Labelled
) -> tuple[Labelled, Labelled]:
    """The training samples, as far as they are in the dataset, and the samples to measure with."""
    trained_on = classifier.trained_on
    nothing = np.zeros(0, dtype=np.intp)
    if dataset.facts.origin != trained_on.dataset:
        learning, judged = usable.take(nothing), usable
    else:
        split = Split(trained_on.seed, trained_on.held_out)
        judged = usable.take(split.is_held_out(usable.index))
        # The dataset may have grown since the training.
        before = usable.take(usable.index < trained_on.count)
        learning = before.take(split.trained(before.index, trained_on.limit))
        if not len(judged):
            raise UsageError(
                f"the classifier was trained on this dataset with a share of "
                f"{trained_on.held_out:g} held out, so that there is no sample to measure it with; "
                "give another dataset, or train with a larger --held-out"
            )
    if not len(judged):
        raise UsageError(
            f"none of the {len(dataset)} samples can be used: they are misses, or features are "
            "missing"
        )
    return learning, judged


def _metrics(ranked: Choices, judged: Labelled, groups: Groups) -> dict[str, Any]:
    """Metrics of the choices as the responder makes them, and of the predictions alone."""
    used = _in_use(ranked, judged, groups)
    return {**_measured(used, judged, groups), "alone": _measured(ranked, judged, groups)}


def _in_use(ranked: Choices, judged: Labelled, groups: Groups) -> Choices:
    return in_use(ranked, judged.errors, judged.grazes, groups.carry_on, judged.carry_on_limit)


def _measured(ranked: Choices, judged: Labelled, groups: Groups) -> dict[str, Any]:
    return {
        **measure(ranked, judged.labels, judged.errors).to_json(),
        "reactions_accuracy": _reactions_accuracy(ranked, judged, groups),
        "strategy_accuracy": _strategy_accuracy(ranked, judged, groups),
        "mirrors_as_one": _mirrors_as_one(ranked, judged, groups),
    }


def _reactions_accuracy(ranked: Choices, judged: Labelled, groups: Groups) -> float | None:
    """Accuracy where the full search chose a reaction; None if it never did."""
    rows = judged.labels != groups.carry_on
    return float(np.mean(ranked[rows, 0] == judged.labels[rows])) if rows.any() else None


def _mirrors_as_one(ranked: Choices, judged: Labelled, groups: Groups) -> dict[str, float]:
    merged = merge_mirrors(ranked[:, :2], groups.mirrors)
    right = merged == merge_mirrors(judged.labels, groups.mirrors)[:, None]
    return {
        "accuracy": float(right[:, 0].mean()),
        "top2_accuracy": float(right.any(axis=1).mean()),
    }


def _strategy_accuracy(ranked: Choices, judged: Labelled, groups: Groups) -> float:
    """Share in which the first choice has the same strategy as the full search's."""
    strategies = np.array(groups.strategies)
    return float(np.mean(strategies[ranked[:, 0]] == strategies[judged.labels]))


def _per_strategy(ranked: Choices, judged: Labelled, groups: Groups) -> dict[str, Any]:
    """Metrics for the samples of each strategy, by the choice of the full search."""
    strategies = np.array(groups.strategies)[judged.labels]
    table = {}
    for strategy in dict.fromkeys(groups.strategies):
        rows = np.flatnonzero(strategies == strategy)
        if len(rows):
            some = judged.take(rows)
            table[strategy] = {
                **measure(ranked[rows], some.labels, some.errors).to_json(),
                "strategy_accuracy": _strategy_accuracy(ranked[rows], some, groups),
            }
    return table


def _baselines(
    classifier: Classifier,
    groups: Groups,
    known: npt.NDArray[np.intp],
    learning: Labelled,
    judged: Labelled,
) -> dict[str, Any]:
    """Metrics of the baselines; None for the neighbours if the training samples are not here."""
    counts = [classifier.facts["samples_per_class"].get(name, 0) for name in groups.names]
    rng = np.random.default_rng(classifier.trained_on.seed)
    found: dict[str, Any] = {
        "random": _metrics(at_random(known.tolist(), len(judged), rng), judged, groups),
        "most_frequent": _metrics(most_frequent(counts, len(judged)), judged, groups),
        "nearest_neighbours": None,
    }
    if len(learning):
        some = judged.take(np.sort(rng.permutation(len(judged))[:_MAX_NEIGHBOUR_SAMPLES]))
        ranked = nearest_neighbours(learning, some.features, len(groups.names))
        found["nearest_neighbours"] = _metrics(ranked, some, groups)
    return found


def _model_summary(classifier: Classifier) -> dict[str, Any]:
    facts = classifier.facts
    return {
        "grouping": classifier.grouping,
        "classes": len(classifier.classes),
        "absent": list(classifier.absent),
        "vector": facts["vector"],
        "slices_s": facts["slices_s"],
        "features": len(classifier.feature_names),
        "components": {
            name: len(model.offset)
            for name, model in (("exact", classifier.exact), ("reduced", classifier.reduced))
        },
        "trained_for": asdict(classifier.trained_for),
        "trained_on": asdict(classifier.trained_on),
    }
