"""The compiled predictor against scikit-learn, and against its readable twin."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.decomposition import PCA
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.support.errors import UsageError
from tests.oracles import prediction as twin

FEATURES = 30
CASES = [(2, 3, 0), (3, 6, 1), (7, 12, 2), (25, 16, 3)]
"""Number of classes, principal components, seed."""


def machine(**settings: Any) -> SVC:
    return SVC(
        **{"kernel": "poly", "degree": 2, "coef0": 1.0, "C": 10, "break_ties": True} | settings
    )


@cache
def trained(classes: int, components: int, seed: int, samples: int = 700) -> Pipeline:
    """A pipeline trained on classes of very different frequency, whose labels have gaps."""
    rng = np.random.default_rng(seed)
    rows = draw(rng, samples)
    appeal = rows @ rng.normal(size=(FEATURES, classes)) / 40.0
    appeal += (rows / 10.0) ** 2 @ rng.normal(size=(FEATURES, classes)) / 10.0
    labels = (appeal - np.linspace(0.0, 2.0, classes)).argmax(axis=1)
    labels[:classes] = range(classes)
    return make_pipeline(
        StandardScaler(), PCA(components, random_state=0), machine(coef0=0.5 + seed)
    ).fit(rows, 3 * labels + 5)


def draw(rng: np.random.Generator, count: int) -> npt.NDArray[np.float64]:
    return rng.normal(size=(count, FEATURES)) * np.linspace(0.1, 10.0, FEATURES) + 3.0


def decisions_of(pipeline: Pipeline, rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """scikit-learn's decisions of all pairs, in libsvm's sign."""
    *ahead, svc = (step for _, step in pipeline.steps)
    for step in ahead:
        rows = step.transform(rows)
    if len(svc.classes_) == 2:
        return -svc.decision_function(rows)[:, None]
    svc.decision_function_shape, svc.break_ties = "ovo", False
    try:
        return svc.decision_function(rows)
    finally:
        svc.decision_function_shape, svc.break_ties = "ovr", True


def by_scores(predictor: PairwiseQuadratic, rows: npt.ArrayLike) -> npt.NDArray[np.intp]:
    return np.argsort(-predictor.scores(rows), axis=1, kind="stable")


def constant(decisions: npt.ArrayLike, classes: int) -> PairwiseQuadratic:
    """A predictor whose decisions of all pairs are these, whatever the one feature is."""
    weights = np.zeros((classes * (classes - 1) // 2, 3))
    weights[:, 0] = decisions
    return PairwiseQuadratic(np.zeros((1, 1)), np.zeros(1), weights, classes)


@pytest.mark.parametrize(("classes", "components", "seed"), CASES)
def test_equal_to_scikit_learn(
    classes: int, components: int, seed: int, rng: np.random.Generator
) -> None:
    pipeline = trained(classes, components, seed)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    rows = draw(rng, 1500)
    expected = decisions_of(pipeline, rows)
    np.testing.assert_allclose(predictor.pair_decisions(rows), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(
        pipeline.predict(rows), pipeline.classes_[predictor.rank(rows)[:, 0]]
    )
    if classes > 2:
        scores = pipeline.decision_function(rows)
        np.testing.assert_allclose(predictor.scores(rows), scores, atol=1e-9)
        np.testing.assert_array_equal(
            predictor.rank(rows, classes), np.argsort(-scores, axis=1, kind="stable")
        )


@pytest.mark.parametrize(("classes", "components", "seed"), CASES)
def test_equal_to_the_twin(
    classes: int, components: int, seed: int, rng: np.random.Generator
) -> None:
    pipeline = trained(classes, components, seed)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    for row in draw(rng, 3):
        expected = twin.pair_decisions(pipeline, row)
        np.testing.assert_allclose(predictor.pair_decisions(row)[0], expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            predictor.scores(row)[0], twin.scores(expected, classes), atol=1e-9
        )
        assert predictor.rank(row, classes)[0].tolist() == twin.rank(expected, classes)


@pytest.mark.slow
def test_equal_to_scikit_learn_on_a_hundred_thousand_inputs(rng: np.random.Generator) -> None:
    """What differs must be nearly a tie: two scores that rounding alone can exchange."""
    pipeline = trained(25, 24, 4, samples=1500)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    rows = draw(rng, 100_000)
    decisions = decisions_of(pipeline, rows)
    scores = pipeline.decision_function(rows)
    expected = np.argsort(-scores, axis=1, kind="stable")[:, :3]
    found = predictor.rank(rows, 3)
    np.testing.assert_allclose(predictor.pair_decisions(rows), decisions, rtol=1e-9, atol=1e-9)
    # A pair at the edge of its sign may change a vote, two scores at the same height their order.
    highest = -np.sort(-scores, axis=1)[:, :4]
    near = (np.abs(decisions).min(axis=1) < 1e-9) | (np.diff(-highest, axis=1).min(axis=1) < 1e-9)
    differing = np.flatnonzero((found != expected).any(axis=1))
    print(f"near-ties: {np.flatnonzero(near).tolist()}, differing: {differing.tolist()}")
    assert near[differing].all()
    assert near.sum() < 100


@given(
    classes=st.integers(2, 9), values=st.sampled_from([1, 2, 1000]), seed=st.integers(0, 2**32 - 1)
)
def test_the_best_are_those_of_all_pairs(classes: int, values: int, seed: int) -> None:
    """Random votes have many circles; with few values confidences are equal, too."""
    rng = np.random.default_rng(seed)
    pairs = classes * (classes - 1) // 2
    decisions = rng.integers(-values, values, size=pairs, endpoint=True).astype(float)
    predictor = constant(decisions, classes)
    expected = twin.rank(decisions, classes)
    np.testing.assert_allclose(predictor.scores([0.0])[0], twin.scores(decisions, classes))
    for best in range(1, classes + 1):
        assert predictor.rank([0.0], best)[0].tolist() == expected[:best]


@pytest.mark.parametrize(
    ("decisions", "expected"),
    [
        # 0 beats 1, 1 beats 2, 2 beats 0: one vote each, the sums of decisions are 2, 1 and -3.
        ([3.0, -1.0, 4.0], [0, 1, 2]),
        ([1.0, -4.0, 3.0], [1, 2, 0]),
        # All equal: the lowest index first.
        ([1.0, -1.0, 1.0], [0, 1, 2]),
        # A decision of exactly zero is a vote for the lower index.
        ([0.0, 0.0, 0.0], [0, 1, 2]),
    ],
)
def test_a_circle_of_three(decisions: list[float], expected: list[int]) -> None:
    predictor = constant(decisions, 3)
    for best in (1, 2, 3):
        assert predictor.rank([7.0], best)[0].tolist() == expected[:best]


def test_circles_at_every_rank() -> None:
    """Nine classes, three circles: each circle beats all of the next."""
    classes, decisions = 9, []
    for i in range(classes):
        for j in range(i + 1, classes):
            same = i // 3 == j // 3
            decisions.append(-1.0 - 0.1 * i if same and j - i == 2 else 1.0 + 0.01 * j)
    predictor = constant(decisions, classes)
    expected = twin.rank(np.array(decisions), classes)
    assert {c // 3 for c in expected[:3]} == {0}
    for best in range(1, classes + 1):
        assert predictor.rank([0.0], best)[0].tolist() == expected[:best]


@pytest.mark.parametrize("single", [False, True])
def test_a_row_has_the_same_bits_alone_and_in_a_batch(
    single: bool, rng: np.random.Generator
) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[-1]))
    if single:
        predictor = predictor.single_precision()
    rows = draw(rng, 101)
    decisions, ranks = predictor.pair_decisions(rows), predictor.rank(rows, 3)
    for i, row in enumerate(rows):
        assert predictor.pair_decisions(row).tobytes() == decisions[i].tobytes()
        np.testing.assert_array_equal(predictor.rank(row, 3)[0], ranks[i])
    np.testing.assert_array_equal(ranks, by_scores(predictor, rows)[:, :3])


def test_single_precision(rng: np.random.Generator) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[-1]))
    single = predictor.single_precision()
    rows = draw(rng, 2000)
    exact, rough = predictor.pair_decisions(rows), single.pair_decisions(rows)
    assert single.weights.dtype == rough.dtype == np.float32
    np.testing.assert_allclose(rough, exact, atol=1e-4 * np.abs(exact).max())
    assert (single.rank(rows) == predictor.rank(rows)).mean() > 0.995
    assert predictor.weights.dtype == np.float64


def test_features_in_other_layouts(rng: np.random.Generator) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[1]))
    rows = draw(rng, 5).astype(np.float32)
    expected = predictor.scores(rows.astype(np.float64))
    for given_rows in (rows, np.asfortranarray(rows), rows.tolist(), np.repeat(rows, 2, 0)[::2]):
        np.testing.assert_array_equal(predictor.scores(given_rows), expected)
    rows.setflags(write=False)
    assert predictor.rank(rows, 2).shape == (5, 2)
    assert predictor.rank(rows[0]).shape == (1, 1)
    assert predictor.rank(rows[:0], 2).shape == (0, 2)
    assert predictor.scores(rows[:0]).shape == (0, 3)


def test_arrays_are_read_only() -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[0]))
    for array in (predictor.projection, predictor.offset, predictor.weights):
        assert not array.flags.writeable


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e200])
def test_features_that_are_not_plausible(value: float, rng: np.random.Generator) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[1]))
    rows = draw(rng, 20)
    rows[13, 4] = value
    rows[17, 2] = value
    for call in (predictor.rank, predictor.scores, predictor.pair_decisions):
        with pytest.raises(UsageError, match="row 13 "):
            call(rows)


@pytest.mark.parametrize("shape", [(), (29,), (4, 31), (2, 2, 30)])
def test_features_of_another_shape(shape: tuple[int, ...]) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[1]))
    with pytest.raises(UsageError, match=r"expects \(n, 30\)"):
        predictor.rank(np.zeros(shape))


@pytest.mark.parametrize("best", [0, -1, 4])
def test_more_ranks_than_classes(best: int) -> None:
    predictor = PairwiseQuadratic.from_pipeline(trained(*CASES[1]))
    with pytest.raises(UsageError, match="expected 1 to 3"):
        predictor.rank(np.zeros(FEATURES), best)


@pytest.mark.parametrize(
    ("pipeline", "message"),
    [
        (machine(), "cannot compile SVC; expected a fitted Pipeline"),
        (make_pipeline(StandardScaler(), machine()), "cannot compile StandardScaler, SVC"),
        (make_pipeline(StandardScaler(), PCA(2), KNeighborsClassifier()), "KNeighborsClassifier"),
        (make_pipeline(StandardScaler(), PCA(2), machine(degree=3)), r"SVC\(degree=3\)"),
        (make_pipeline(StandardScaler(), PCA(2), machine(kernel="rbf")), r"SVC\(kernel='rbf'\)"),
        (make_pipeline(StandardScaler(), PCA(2), machine(break_ties=False)), "break_ties=False"),
        (make_pipeline(StandardScaler(with_std=False), PCA(2), machine()), "with_std=False"),
        (make_pipeline(StandardScaler(), PCA(2, whiten=True), machine()), "whiten=True"),
        (make_pipeline(StandardScaler(), PCA(2), machine()), "StandardScaler is not fitted"),
    ],
)
def test_other_pipelines_are_refused(pipeline: Any, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        PairwiseQuadratic.from_pipeline(pipeline)


def test_arrays_that_do_not_fit_are_refused() -> None:
    right = constant([1.0, 2.0, 3.0], 3)
    for wrong in (
        {"classes": 4},
        {"classes": 1},
        {"offset": np.zeros(2)},
        {"projection": np.zeros(1)},
        {"weights": np.zeros((3, 4))},
    ):
        with pytest.raises(UsageError, match="do not fit together"):
            replace(right, **wrong)  # type: ignore[arg-type]
    for name in ("projection", "offset", "weights"):
        with pytest.raises(UsageError, match=f"{name} of a predictor hold NaN"):
            replace(right, **{name: np.full(getattr(right, name).shape, np.nan)})
