from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from dynresp.support.checks import check_numbers, check_vector
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class Settings:
    """Two numbers, checked."""

    columns: int = 5
    cell_m: float = 1.8

    def __post_init__(self) -> None:
        check_numbers(self)


ALL = (Settings,)


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("wrong", ["1", None, True, np.nan, np.inf, [1.0], np.ones(2)])
def test_what_is_no_number(kind: Any, wrong: object) -> None:
    for field in dataclasses.fields(kind):
        if field.type in ("float", "int"):
            with pytest.raises(UsageError, match=field.name):
                kind(**{field.name: wrong})


def test_what_is_a_number() -> None:
    assert Settings(columns=np.int64(5), cell_m=np.float32(2.0)).columns == 5
    assert Settings(columns=3, cell_m=2).cell_m == 2
    with pytest.raises(UsageError, match=r"columns must be a whole number, got 2\.5"):
        Settings(columns=2.5)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("huge", [10**400, -(10**5000), Fraction(10**400)], ids="abc")
def test_numbers_larger_than_any_float(kind: Any, huge: object) -> None:
    for field in dataclasses.fields(kind):
        if field.type in ("float", "int"):
            with pytest.raises(UsageError, match=f"{field.name} must be"):
                kind(**{field.name: huge})


def test_rows_of_numbers() -> None:
    for right in ((1, 2.5), [0.0, -1e300], np.array([1.0, 2.0])):
        check_vector("corner", right, 2)
    for wrong in ("12", None, 3.0, (1.0,), (1.0, np.nan), (1.0, True), (1, 10**400), np.array(1.0)):
        with pytest.raises(UsageError, match="corner must be 2 finite numbers, got "):
            check_vector("corner", wrong, 2)
    with pytest.raises(UsageError, match=r"size must be 2 finite numbers above 0, got \(1, 0\)"):
        check_vector("size", (1, 0), 2, above=0.0)
