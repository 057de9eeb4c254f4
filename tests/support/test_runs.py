from __future__ import annotations

import numpy as np
import pytest

from dynresp.support.runs import runs
from tests.oracles import runs as slow


@pytest.mark.parametrize("seed", range(20))
def test_runs_are_those_found_frame_by_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    flags = rng.random(rng.integers(0, 40)) < rng.random()
    assert runs(flags) == slow.runs(flags.tolist())


@pytest.mark.parametrize(
    ("flags", "expected"),
    [([], []), ([False], []), ([True], [(0, 1)]), ([True, False, True, True], [(0, 1), (2, 4)])],
)
def test_runs_at_the_ends(flags: list[bool], expected: list[tuple[int, int]]) -> None:
    assert runs(np.array(flags, dtype=bool)) == expected
