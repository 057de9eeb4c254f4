import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.learning.choice_metrics import (
    confusion,
    in_use,
    measure,
    merge_mirrors,
    regrets,
)
from dynresp.support.errors import UsageError

from ..oracles import learning as slow

SEEDS = st.integers(0, 10_000)


def judged(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Choices, labels, errors and grazes at random; ties and choices better than the label's."""
    rng = np.random.default_rng(seed)
    classes, samples = int(rng.integers(2, 7)), int(rng.integers(1, 30))
    ranked = np.array([rng.permutation(classes) for _ in range(samples)])
    errors = rng.choice([0.0, 0.5, 0.503, 0.51, 1.0, 2.0], size=(samples, classes))
    return ranked, rng.integers(classes, size=samples), errors, rng.random(samples) < 0.3


@given(SEEDS)
def test_figures_are_those_of_a_plain_loop(seed: int) -> None:
    ranked, labels, errors, _ = judged(seed)
    found, expected = (
        measure(ranked, labels, errors).to_json(),
        slow.figures(ranked, labels, errors),
    )
    assert found == pytest.approx(expected)


@given(SEEDS)
def test_in_use_carrying_on_is_measured(seed: int) -> None:
    ranked, _, errors, grazes = judged(seed)
    found = in_use(ranked, errors, grazes, 1, 0.6)
    assert found.tolist() == slow.in_use(ranked, errors, grazes, 1, 0.6)
    assert (found[grazes, 0] == 1).all()


@given(SEEDS)
def test_the_confusion_counts_every_sample_once(seed: int) -> None:
    ranked, labels, errors, _ = judged(seed)
    counts = confusion(ranked[:, 0], labels, errors.shape[1])
    assert counts.sum() == len(labels)
    assert counts.trace() == pytest.approx(len(labels) * measure(ranked, labels, errors).accuracy)
    for row, label in zip(ranked, labels, strict=True):
        counts[label, row[0]] -= 1
    assert not counts.any()


def test_regret_is_never_negative() -> None:
    # The oracle carries on only where that fits well, so another choice may fit better than its.
    errors = np.array([[1.0, 0.8], [1.0, 1.5]])
    assert regrets(np.array([1, 1]), np.array([0, 0]), errors).tolist() == [0.0, 0.5]


def test_an_error_of_zero_costs_no_division() -> None:
    errors = np.array([[0.0, 0.0]])
    assert regrets(np.array([1]), np.array([0]), errors).tolist() == [0.0]


def test_mirrors_count_as_one() -> None:
    mirrors = np.array([1, 0, 2, 4, 3])
    assert merge_mirrors(np.array([[0, 1], [2, 4]]), mirrors).tolist() == [[0, 0], [2, 3]]


def test_no_samples_are_no_figures() -> None:
    with pytest.raises(UsageError, match="no samples"):
        measure(np.zeros((0, 2), int), np.zeros(0, int), np.zeros((0, 2)))
