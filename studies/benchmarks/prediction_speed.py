"""How fast a reaction is chosen: the compiled predictor against scikit-learn's own `predict`."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult, Contender, median_seconds
from dynresp.motion.rotations import FloatArray
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.support.errors import DynrespError
from dynresp.support.extras import require

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

SAMPLES = 6_000
"""Samples that the synthetic classifier is trained on."""
CLASSES, FEATURES = 25, 432
"""As many as 24 reactions and `carry_on`, and as the large feature vector has."""
COMPONENTS = {"exact": 64, "reduced": 24}
"""Principal components of the two synthetic models."""
BATCH = 1_000
"""Rows of a batch; scikit-learn and the compiled predictors are compared on them."""
_ROUNDS = 30
_SLOW_EVERY = 10
# Rows predicted one after another in each round, so that the clock's own cost does not count.
_ALONE = 100
# The least share of rows on which the compiled predictor must choose as scikit-learn does; near
# ties aside it is all in double precision, and single precision makes a few more.
_LEAST_EQUAL = {"exact": 0.999, "reduced": 0.99}


@dataclass(frozen=True)
class Subject:
    """What is measured.

    Attributes:
        compiled: The predictors, "exact" and "reduced".
        pipelines: The pipelines that they were compiled from, by the same names.
        rows: (BATCH, F) what is predicted.
        about: What they are.
    """

    compiled: Mapping[str, PairwiseQuadratic]
    pipelines: Mapping[str, Pipeline]
    rows: FloatArray
    about: str


def run(seed: int = 0, *, model: Path | None = None) -> BenchResult:
    """Measure predictions; takes about ten seconds, most of it training.

    Args:
        seed: Seed of the synthetic problem, and of the rows drawn for a model.
        model: A file that `dynresp train` has written; None for a synthetic classifier.

    Returns:
        `value` is one prediction of the reduced model, in microseconds from call to result;
        `baseline` is the same by scikit-learn. The further figures hold the exact model and both
        in batches, and `agreement`, the share of rows on which the reduced model chooses as the
        exact one does.

    Raises:
        ClassifierError: The model cannot be read.
        DynrespError: The compiled predictors do not choose as scikit-learn does, which would make
            the times meaningless.
    """
    subject = synthetic(seed) if model is None else trained(model, seed)
    chosen = {name: _checked_choices(subject, name) for name in COMPONENTS}
    contenders = []
    for name in COMPONENTS:
        contenders += _contenders(name, subject)
    seconds = median_seconds(contenders, _ROUNDS)
    rows = {"alone": min(_ALONE, len(subject.rows)), "batch": len(subject.rows)}
    rows |= {"sklearn_alone": 1, "sklearn_votes": 1, "sklearn_batch": len(subject.rows)}
    times = {
        f"{name}_{how}": 1e6 * seconds[f"{name}_{how}"] / count
        for name in COMPONENTS
        for how, count in rows.items()
    }
    value, baseline = times.pop("reduced_alone"), times.pop("reduced_sklearn_alone")
    exact = subject.pipelines["exact"]
    return BenchResult(
        name="predict",
        value=value,
        unit="us/prediction",
        baseline=baseline,
        baseline_name="scikit-learn's predict of one row, with the same model",
        ratio=baseline / value,
        machine=describe_machine(("numpy", "numba", "scikit-learn")),
        more={
            **times,
            "ratio_votes": times["reduced_sklearn_votes"] / value,
            "agreement": float(np.mean(chosen["exact"] == chosen["reduced"])),
            "classes": subject.compiled["exact"].classes,
            "features": subject.rows.shape[1],
            "exact_components": len(subject.compiled["exact"].offset),
            "reduced_components": len(subject.compiled["reduced"].offset),
            "support_vectors": int(exact[-1].n_support_.sum()),
            "seed": seed,
        },
        notes=(
            f"{subject.about}. All times in us/prediction, medians of interleaved "
            "rounds; the compiled predictors run on one thread.",
            "scikit-learn breaks ties of votes by a loop over all pairs in Python; ratio_votes and "
            "sklearn_votes are against the same model without that, which ranks nothing.",
            "Alone, one row after another is given to the predictor, whose weights stay in the "
            "cache. The cost of scikit-learn grows with the support vectors, so with the samples "
            "trained on; that of the compiled predictor does not.",
        ),
    )


def synthetic(seed: int) -> Subject:
    """Train on a made problem that resembles the real one.

    A hit has few degrees of freedom (direction, speed, mass, height, phase); states of the bodies
    follow smoothly from them, and so does the error of every reaction, of which the least is
    chosen. Some reactions are good for many hits, some for few.

    Args:
        seed: Seed of the problem.
    """
    require("sklearn")
    from sklearn.decomposition import PCA
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    rng = np.random.default_rng(seed)
    hits = rng.uniform(-1.0, 1.0, (SAMPLES + BATCH, 6))

    def smooth(count: int) -> FloatArray:
        """Smooth random functions of the hits with mean zero and spread one, (hits, count)."""
        phases = rng.uniform(0.0, 2.0 * np.pi, 200)
        waves = np.sin(hits @ rng.normal(scale=0.8, size=(hits.shape[1], 200)) + phases)
        values = waves @ rng.normal(size=(200, count))
        return (values - values.mean(axis=0)) / values.std(axis=0)

    rows = smooth(FEATURES) + rng.normal(scale=0.05, size=(len(hits), FEATURES))
    rows = rows * rng.uniform(0.1, 3.0, FEATURES) + rng.normal(size=FEATURES)
    labels = (smooth(CLASSES) + np.linspace(0.0, 1.2, CLASSES)).argmin(axis=1)
    pipelines = {
        name: make_pipeline(
            StandardScaler(),
            PCA(components, random_state=0),
            SVC(kernel="poly", degree=2, coef0=1.0, C=10.0, break_ties=True, cache_size=500),
        ).fit(rows[:SAMPLES], labels[:SAMPLES])
        for name, components in COMPONENTS.items()
    }
    compiled = {name: PairwiseQuadratic.from_pipeline(pipelines[name]) for name in COMPONENTS}
    compiled["reduced"] = compiled["reduced"].single_precision()
    return Subject(compiled, pipelines, rows[SAMPLES:], "A synthetic problem")


def trained(model: Path, seed: int) -> Subject:
    """A classifier from a file, with rows spread as those which it was trained on.

    Args:
        model: The file.
        seed: Seed of the rows.

    Raises:
        ClassifierError: The file cannot be read.
    """
    from dynresp.response.prediction.classifier_file import load_classifier, load_pipelines

    classifier, pipelines = load_classifier(model), load_pipelines(model)
    scaler, axes = pipelines["exact"][0], pipelines["exact"][1]
    spread = np.sqrt(axes.explained_variance_)
    components = np.random.default_rng(seed).normal(size=(BATCH, len(spread))) * spread
    return Subject(
        {"exact": classifier.exact, "reduced": classifier.reduced},
        pipelines,
        scaler.inverse_transform(axes.inverse_transform(components)),
        f"The classifier {model.name}, on rows drawn with the spread of those it was trained on "
        "(how the two models do on hits, `dynresp evaluate` says)",
    )


def _contenders(name: str, subject: Subject) -> list[Contender]:
    """The compiled predictor and scikit-learn's, with one row and with all."""
    from sklearn.pipeline import Pipeline

    predictor, pipeline, rows = subject.compiled[name], subject.pipelines[name], subject.rows
    some = list(rows[:_ALONE])
    # The same model on scikit-learn's fast path, where equal votes go to the lower class.
    voting = copy.copy(pipeline[-1]).set_params(break_ties=False)
    votes = Pipeline([*pipeline.steps[:-1], ("votes", voting)])

    def one_by_one() -> None:
        for row in some:
            predictor.rank(row)

    return [
        Contender(f"{name}_alone", one_by_one),
        Contender(f"{name}_batch", lambda: predictor.rank(rows)),
        Contender(f"{name}_sklearn_alone", lambda: pipeline.predict(rows[:1])),
        Contender(f"{name}_sklearn_votes", lambda: votes.predict(rows[:1])),
        Contender(f"{name}_sklearn_batch", lambda: pipeline.predict(rows), every=_SLOW_EVERY),
    ]


def _checked_choices(subject: Subject, name: str) -> npt.NDArray[np.integer]:
    """Labels chosen by a compiled predictor; refused where scikit-learn chooses otherwise."""
    pipeline = subject.pipelines[name]
    found = pipeline.classes_[subject.compiled[name].rank(subject.rows)[:, 0]]
    equal = float(np.mean(found == pipeline.predict(subject.rows)))
    if equal < _LEAST_EQUAL[name]:
        raise DynrespError(
            f"the {name} predictor chooses as scikit-learn does for {100.0 * equal:.2f} % of the "
            f"rows, expected {100.0 * _LEAST_EQUAL[name]} %. Please report this with the machine "
            f"it happened on."
        )
    return found
