from __future__ import annotations

import numpy as np
import pytest

from dynresp.support import smoothing
from tests.oracles import smoothing as slow


@pytest.mark.parametrize("seed", range(10))
def test_curves_equal_those_made_frame_by_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values, half = rng.normal(size=rng.integers(1, 40)), int(rng.integers(1, 9))
    np.testing.assert_allclose(
        smoothing.average(values, half), slow.average(values.tolist(), half), atol=1e-12
    )
    np.testing.assert_allclose(
        smoothing.cover(values, half), slow.cover(values.tolist(), half), atol=1e-12
    )


def test_columns_are_averaged_one_by_one() -> None:
    values = np.random.default_rng(0).normal(size=(12, 3))
    averaged = smoothing.average(values, 2)
    for column in range(3):
        np.testing.assert_array_equal(averaged[:, column], smoothing.average(values[:, column], 2))


def test_a_cover_stays_above_the_values() -> None:
    values = np.random.default_rng(1).normal(size=200)
    assert (smoothing.cover(values, 5) >= values - 1e-12).all()
