from fractions import Fraction

import numpy as np
import pytest

from dynresp.support.checks import check_number, check_vector
from dynresp.support.errors import UsageError


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("wrong", ["1", None, True, np.nan, np.inf, [1.0], np.ones(2)])
def test_what_is_no_number(wrong: object, whole: bool) -> None:
    with pytest.raises(UsageError, match="size must be"):
        check_number("size", wrong, whole=whole)


def test_what_is_a_number() -> None:
    check_number("columns", np.int64(5), whole=True)
    check_number("size", np.float32(2.0))
    check_number("size", 2)
    with pytest.raises(UsageError, match=r"columns must be a whole number, got 2\.5"):
        check_number("columns", 2.5, whole=True)


@pytest.mark.parametrize("huge", [10**400, -(10**5000), Fraction(10**400)], ids="abc")
def test_numbers_larger_than_any_float(huge: object) -> None:
    for whole in (False, True):
        with pytest.raises(UsageError, match="size must be"):
            check_number("size", huge, whole=whole)


def test_rows_of_numbers() -> None:
    for right in ((1, 2.5), [0.0, -1e300], np.array([1.0, 2.0])):
        check_vector("corner", right, 2)
    for wrong in ("12", None, 3.0, (1.0,), (1.0, np.nan), (1.0, True), (1, 10**400), np.array(1.0)):
        with pytest.raises(UsageError, match="corner must be 2 finite numbers, got "):
            check_vector("corner", wrong, 2)
    with pytest.raises(UsageError, match=r"size must be 2 finite numbers above 0, got \(1, 0\)"):
        check_vector("size", (1, 0), 2, above=0.0)
