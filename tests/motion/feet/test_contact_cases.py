"""The paper's four cases, against a reading of it frame by frame."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.motion.feet.contact_cases import ContactCase, contact_cases

seeds = st.integers(0, 2**32 - 1)


def _twin(
    flags: npt.NDArray[np.bool_], end: int, source: int, target: int, blend: int
) -> ContactCase:
    """Walk through the blend, frames target to target + blend - 1."""
    last = target + blend - 1
    for begin in range(target, min(last + 1, end)):
        if not flags[begin]:
            continue
        stop = begin
        while stop + 1 < end and flags[stop + 1]:
            stop += 1
        lasts = stop >= last
        if begin > target:
            return ContactCase.AFTER if lasts else ContactCase.INSIDE
        if lasts:
            return ContactCase.ACROSS
        return ContactCase.BEFORE if flags[source] else ContactCase.INSIDE
    return ContactCase.NONE


@given(seed=seeds, blend=st.integers(1, 12))
def test_equal_their_twin(seed: int, blend: int) -> None:
    rng = np.random.default_rng(seed)
    n = 60
    contacts = np.repeat(rng.random((n // 3, 2)) > 0.5, rng.integers(1, 5, n // 3), axis=0)
    n = len(contacts)
    split = int(rng.integers(1, n))
    ends = np.where(np.arange(n) < split, split, n)
    sources, targets = rng.integers(0, n, (2, 80))
    cases = contact_cases(contacts, ends, sources, targets, blend)
    for foot in range(2):
        twin = [
            _twin(contacts[:, foot], ends[j], i, j, blend)
            for i, j in zip(sources, targets, strict=True)
        ]
        assert cases[:, foot].tolist() == twin


@pytest.mark.parametrize(
    ("stands", "case"),
    [
        # The transition leaves frame 3 and enters frame 10; four frames are blended.
        ("...# ......##......", ContactCase.BEFORE),
        ("...# ......####....", ContactCase.ACROSS),
        ("...# ......#####...", ContactCase.ACROSS),
        (".... .......###.....", ContactCase.AFTER),
        (".... .......##.....", ContactCase.INSIDE),
        (".... ......##......", ContactCase.INSIDE),
        (".... ..........##..", ContactCase.NONE),
        ("...# ..............", ContactCase.NONE),
    ],
)
def test_each_case(stands: str, case: ContactCase) -> None:
    flags = np.array([[x == "#"] for x in stands.replace(" ", "")])
    assert contact_cases(flags, np.full(len(flags), len(flags)), [3], [10], 4)[0, 0] == case


def test_an_empty_database() -> None:
    none = np.zeros((0, 2), dtype=bool)
    assert contact_cases(none, [], [], [], 5).shape == (0, 2)
