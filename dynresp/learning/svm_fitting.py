"""Fit the support vector machine, and search its parameters by cross-validation.

The pipeline is `StandardScaler`, `PCA`, `SVC` with a polynomial kernel of degree two, the kind that
`dynresp.response.prediction.compiled_classifier` compiles. Degree three and features without
principal components were measured and predict no better.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

from dynresp.learning.choice_metrics import ChoiceMetrics, in_use, measure
from dynresp.learning.labelled_samples import Labelled
from dynresp.motion.rotations import FloatArray
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.support.errors import UsageError
from dynresp.support.extras import require
from dynresp.support.progress import Progress

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

Result = TypeVar("Result")

# Memory for rows of the kernel [MiB]; each is as long as there are samples.
_CACHE_MIB = 1_000
# During a fit, progress is called this often [s].
_TELL_S = 0.5


@dataclass(frozen=True)
class Parameters:
    """Parameters of a fit.

    Attributes:
        components: Number of principal components; fewer if there are fewer features or samples.
        penalty: C, the penalty for samples on the wrong side.
        gamma_factor: The kernel's gamma as a multiple of scikit-learn's "scale", which is one over
            the sum of the components' variances.
    """

    components: int
    penalty: float
    gamma_factor: float


@dataclass(frozen=True)
class TriedParameters:
    """Result of the cross-validation of one set of parameters.

    Attributes:
        parameters: The parameters.
        metrics: Of all folds together, of the choices as the responder makes them.
    """

    parameters: Parameters
    metrics: ChoiceMetrics

    def to_json(self) -> dict[str, int | float]:
        """Parameters and metrics by name."""
        return {**asdict(self.parameters), **self.metrics.to_json()}


def fit_pipeline(
    features: npt.ArrayLike, labels: npt.NDArray[np.integer], parameters: Parameters
) -> Pipeline:
    """Fit the pipeline.

    Args:
        features: (n, F).
        labels: (n,) classes.
        parameters: Of the fit.

    Returns:
        The fitted pipeline; its `classes_` are those in `labels`.

    Raises:
        UsageError: All samples are of one class, or their features do not differ.
    """
    return _fit_machine(*_prepare(features, parameters.components), labels, parameters)


def _prepare(features: npt.ArrayLike, components: int) -> tuple[Pipeline, FloatArray]:
    """Scaler and principal components, and the samples in terms of these."""
    require("sklearn")
    from sklearn.decomposition import PCA
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import StandardScaler

    rows = np.asarray(features, dtype=np.float64)
    if not (rows != rows[:1]).any():
        raise UsageError("all training samples have the same features; generate hits that differ")
    # Exact, and fast if there are more samples than features.
    axes = PCA(min(components, *rows.shape), svd_solver="covariance_eigh")
    ahead = Pipeline([("scale", StandardScaler()), ("components", axes)])
    return ahead, ahead.fit_transform(rows)


def _fit_machine(
    ahead: Pipeline, reduced: FloatArray, labels: npt.NDArray[np.integer], parameters: Parameters
) -> Pipeline:
    from sklearn.pipeline import Pipeline
    from sklearn.svm import SVC

    if len(np.unique(labels)) < 2:
        raise UsageError("all training samples are of one class; expected at least two classes")
    # As in scikit-learn's "scale".
    spread = float(reduced.var()) * reduced.shape[1]
    machine = SVC(
        kernel="poly",
        degree=2,
        coef0=1.0,
        C=parameters.penalty,
        gamma=parameters.gamma_factor / spread,
        break_ties=True,
        cache_size=_CACHE_MIB,
    )
    machine.fit(reduced, labels)
    return Pipeline([*ahead.steps, ("machine", machine)])


def cross_validate(
    samples: Labelled,
    folds: npt.NDArray[np.intp],
    carry_on: int,
    grid: Sequence[Parameters],
    progress: Progress,
) -> list[TriedParameters]:
    """Cross-validate parameters: fit on all folds but one, measure on that one, for each fold.

    Args:
        samples: The samples.
        folds: (n,) the fold of each.
        carry_on: The class "no reaction".
        grid: The parameters to try.
        progress: Called with the number of fits done.

    Returns:
        The results, in the order of `grid`.
    """
    count = int(folds.max()) + 1
    most = min(3, len(np.unique(samples.labels)))
    ranked = {parameters: np.zeros((len(samples), most), np.intp) for parameters in grid}
    of, done, stage = count * len(grid), 0, f"trying parameters on {len(samples)} samples"
    for fold, components in product(range(count), dict.fromkeys(p.components for p in grid)):
        inside, outside = folds != fold, folds == fold
        ahead, reduced = _prepare(samples.features[inside], components)
        for parameters in grid:
            if parameters.components != components:
                continue
            progress(stage, done, of)
            pipeline = _fit_machine(ahead, reduced, samples.labels[inside], parameters)
            predictor = PairwiseQuadratic.from_pipeline(pipeline)
            best = predictor.rank(samples.features[outside], min(most, predictor.classes))
            # If a fold lacks a class, there can be one less to rank.
            best = np.pad(best, ((0, 0), (0, most - best.shape[1])), mode="edge")
            ranked[parameters][outside] = pipeline.classes_[best]
            done += 1
    progress(stage, of, of)
    tried = []
    for parameters in grid:
        choices = in_use(
            ranked[parameters], samples.errors, samples.grazes, carry_on, samples.carry_on_limit
        )
        tried.append(TriedParameters(parameters, measure(choices, samples.labels, samples.errors)))
    return tried


def best_first(tried: Sequence[TriedParameters]) -> list[TriedParameters]:
    """Sort results, best first; ties keep their order.

    Accuracies within one standard error of the best count as equal; among these the least regret
    comes first. Then come the others, by accuracy.
    """
    best = max(item.metrics.accuracy for item in tried)
    slack = np.sqrt(best * (1.0 - best) / tried[0].metrics.samples)

    def key(item: TriedParameters) -> tuple[bool, float]:
        worse = item.metrics.accuracy < best - slack
        return worse, -item.metrics.accuracy if worse else item.metrics.regret

    return sorted(tried, key=key)


def run_in_thread(work: Callable[[], Result], report: Callable[[], None]) -> Result:
    """Do long work in a thread, so that progress can be shown and control-C works.

    Args:
        work: The work.
        report: Called about twice a second meanwhile.

    Returns:
        The result of `work`; its exceptions are raised here.
    """
    results: list[Result] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    last = time.monotonic()
    while thread.is_alive():
        thread.join(_TELL_S)
        if time.monotonic() - last >= _TELL_S:
            report()
            last = time.monotonic()
    if errors:
        raise errors[0]
    return results[0]
