import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.learning.holdout import Split
from dynresp.support.errors import UsageError


def test_a_sample_keeps_its_part_in_any_order_and_company(rng: np.random.Generator) -> None:
    split = Split(seed=3, held_out=0.2)
    index = np.arange(1_000)
    held_out = split.is_held_out(index)
    shuffled = rng.permutation(1_000)
    np.testing.assert_array_equal(split.is_held_out(shuffled), held_out[shuffled])
    np.testing.assert_array_equal(split.is_held_out(index[:100]), held_out[:100])
    taken = set(shuffled[split.trained(shuffled, 300)].tolist())
    assert taken == set(index[split.trained(index, 300)].tolist())


@given(st.integers(0, 2**63 - 1), st.floats(0.0, 0.9))
def test_shares_are_as_asked_and_parts_do_not_meet(seed: int, share: float) -> None:
    split, index = Split(seed, share), np.arange(4_000)
    held_out = split.is_held_out(index)
    assert held_out.mean() == pytest.approx(share, abs=0.04)
    trained = split.trained(index)
    assert not held_out[trained].any()
    assert len(trained) == np.count_nonzero(~held_out)


def test_fewer_samples_are_a_part_of_more() -> None:
    split, index = Split(), np.arange(500)
    many, few = split.trained(index, 200), split.trained(index, 50)
    assert set(few) < set(many)
    assert (np.diff(index[many]) > 0).all()
    assert len(split.trained(index, 10_000)) == np.count_nonzero(~split.is_held_out(index))


def test_another_seed_is_another_split() -> None:
    index = np.arange(1_000)
    assert (Split(1).is_held_out(index) != Split(2).is_held_out(index)).any()


@given(st.integers(0, 1_000), st.integers(2, 5))
def test_every_class_is_spread_over_the_folds(seed: int, count: int) -> None:
    labels = np.random.default_rng(seed).integers(5, size=60)
    folds = Split(seed).folds(np.arange(60), labels, count)
    for label in np.unique(labels):
        sizes = np.bincount(folds[labels == label], minlength=count)
        assert sizes.max() - sizes.min() <= 1


@pytest.mark.parametrize("wrong", [{"held_out": 1.0}, {"held_out": -0.1}, {"seed": -1}])
def test_what_is_no_split(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="must be"):
        Split(**wrong)  # type: ignore[arg-type]
