import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dynresp.locomotion.vision.time_warping import warp_onto
from dynresp.support.errors import MotionError
from tests.oracles import warping as oracle


def rows(width: int) -> st.SearchStrategy[np.ndarray]:
    shape = st.tuples(st.integers(1, 12), st.just(width))
    return shape.flatmap(lambda s: arrays(np.float64, s, elements=st.floats(-3, 3, width=32)))


@given(first=rows(2), candidates=st.lists(rows(2), max_size=4), open_end=st.booleans())
def test_it_is_the_least_sum_over_all_matchings(first, candidates, open_end):
    warped = warp_onto(first, candidates, open_end)
    expected = [oracle.warp(first, c, open_end) for c in candidates]
    np.testing.assert_allclose(warped.costs, [cost for cost, _ in expected], atol=1e-12)
    for k, (cost, stop) in enumerate(expected):
        # With rounding, another stop may have the same cost.
        if warped.stops[k] != stop:
            assert oracle.warp(first, candidates[k][: warped.stops[k]], False)[0] == pytest.approx(
                cost, abs=1e-12
            )


def test_speed_does_not_count_but_order_does():
    path = np.stack([np.linspace(0, 3, 31), np.zeros(31)], axis=1)
    slowly = np.repeat(path, 3, axis=0)
    warped = warp_onto(path, [slowly, path[::-1]])
    assert warped.costs[0] == 0.0
    assert warped.costs[1] > 20.0
    assert warped.stops.tolist() == [93, 31]


def test_an_open_end_leaves_the_rest_of_a_candidate_unmatched():
    warped = warp_onto(np.arange(5.0), [np.arange(20.0)], open_end=True)
    assert warped.costs.tolist() == [0.0]
    assert warped.stops.tolist() == [5]
    assert warp_onto(np.arange(5.0), [np.arange(20.0)]).costs[0] > 100.0


def test_without_candidates_there_is_no_cost():
    assert warp_onto(np.arange(5.0), []).costs.shape == (0,)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (np.empty((0, 2)), np.ones((3, 2))),
        (np.ones((3, 2)), np.empty((0, 2))),
        (np.ones((3, 2)), np.ones((3, 3))),
        (np.array([1.0, np.nan]), np.ones(3)),
        (np.ones((3, 2, 2)), np.ones((3, 2))),
    ],
)
def test_sequences_that_cannot_be_warped_are_refused(first, second):
    with pytest.raises(MotionError, match="warp"):
        warp_onto(first, [second])
