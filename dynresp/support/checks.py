"""Checks of numbers that a user gives in Python."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from numbers import Integral, Real

from dynresp.support.errors import UsageError

LARGEST = sys.float_info.max
"""The largest float: whatever is within plus or minus this is finite."""


def check_number(
    name: str,
    value: object,
    low: float = -LARGEST,
    high: float = LARGEST,
    unit: str = "",
    whole: bool = False,
    *,
    above_low: bool = False,
) -> None:
    """Refuse what is not a finite number, or is out of range.

    Args:
        name: What the number is called in the message.
        value: What was given.
        low: The least number allowed.
        high: The largest.
        unit: Unit of the number, for the message.
        whole: Whether it must be a whole number.
        above_low: Whether `low` itself is refused, too.

    Raises:
        UsageError: It is not such a number; the message says what was given and expected.
    """
    expected = "a whole number" if whole else "a number"
    if not isinstance(value, Integral if whole else Real) or isinstance(value, bool):
        raise UsageError(f"{name} must be {expected}, got {_shown(repr, value)}")
    number = _as_float(value)
    # NaN fails this, too.
    if not low <= number <= high or (above_low and number == low):
        unit = unit and f" {unit}"
        if low <= -LARGEST:
            limits = "finite"
        elif above_low:
            most = f"at most {high:g}{unit}" if high < LARGEST else "finite"
            limits = f"above {low:g}{unit}, and {most}"
        elif high < LARGEST:
            limits = f"from {low:g} to {high:g}{unit}"
        else:
            limits = f"{low:g}{unit} or more, and finite"
        raise UsageError(f"{name} must be {limits}, got {_shown(str, value)}")


def check_vector(name: str, value: object, count: int, above: float = -math.inf) -> None:
    """Refuse what is not a row of finite numbers.

    Args:
        name: What the row is called in the message.
        value: What was given.
        count: How many numbers it must have.
        above: All must be larger than this.

    Raises:
        UsageError: It is not such a row; the message says what was given and expected.
    """
    try:
        numbers = list(value)  # type: ignore[call-overload]
    except TypeError:
        numbers = []
    if len(numbers) != count or not all(above < _as_float(x) <= LARGEST for x in numbers):
        bound = "" if above == -math.inf else f" above {above:g}"
        raise UsageError(f"{name} must be {count} finite numbers{bound}, got {_shown(repr, value)}")


def _as_float(value: object) -> float:
    """A number as a float: infinite if it is larger than any float, NaN if it is no number."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _shown(write: Callable[[object], str], value: object) -> str:
    """A value as a message shows it: at most 60 characters."""
    try:
        return write(value)[:60]
    except ValueError:  # It has more digits than Python is willing to write.
        return "a number with thousands of digits"
