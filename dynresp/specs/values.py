"""Values in spec files: fixed or drawn at random, their bounds, and errors in plain words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np
from pydantic import PlainValidator

Item = TypeVar("Item", float, str)

_MOST_CHOICES = 1000


@dataclass(frozen=True)
class Uniform:
    """A number between two, all equally likely.

    Attributes:
        low: The smallest.
        high: The largest.
    """

    low: float
    high: float


@dataclass(frozen=True)
class Choice(Generic[Item]):
    """One of several values, all equally likely.

    Attributes:
        values: The values.
    """

    values: tuple[Item, ...]


Number: TypeAlias = float | Uniform | Choice[float]
"""A number of a spec file."""
Name: TypeAlias = str | Choice[str]
"""A name of a spec file."""


def draw(value: Any, rng: np.random.Generator) -> Any:
    """A value itself, or a draw from it.

    Args:
        value: A `Number`, a `Name`, or anything else, which is returned as it is.
        rng: Random generator; used only for random values.
    """
    if isinstance(value, Uniform):
        return float(rng.uniform(value.low, value.high))
    if isinstance(value, Choice):
        return value.values[int(rng.integers(len(value.values)))]
    return value


def number(least: float, greatest: float, unit: str) -> PlainValidator:
    """For a field of type `Number`: a number, or a random one, within bounds.

    Args:
        least: The smallest number allowed.
        greatest: The largest.
        unit: For messages, such as "m/s".
    """
    check, expected = _checker(least, greatest, unit)

    def parse(given: Any) -> Number:
        if not isinstance(given, dict):
            return check(given)
        return _random(given, check, expected)

    return PlainValidator(parse)


def fixed(least: float, greatest: float, unit: str = "") -> PlainValidator:
    """For a field of type `float`: a number within bounds."""
    return PlainValidator(_checker(least, greatest, unit)[0])


def whole(least: int, greatest: int) -> PlainValidator:
    """For a field of type `int`: a whole number within bounds."""

    def check(given: Any) -> int:
        if isinstance(given, bool) or not isinstance(given, int) or not least <= given <= greatest:
            raise ValueError(
                f"expected a whole number from {least} to {greatest}, got {shown(given)}"
            )
        return given

    return PlainValidator(check)


def name(check: Callable[[str], None]) -> PlainValidator:
    """For a field of type `Name`: a name, or one chosen at random.

    Args:
        check: Raises `ValueError` for a name that is not allowed.
    """

    def checked(given: Any) -> str:
        if not isinstance(given, str):
            raise ValueError(f"expected a name in quotes, got {shown(given)}")
        check(given)
        return given

    def parse(given: Any) -> Name:
        if not isinstance(given, dict):
            return checked(given)
        if set(given) != {"choice"}:
            raise ValueError(f"expected a name or {{ choice = [name, ...] }}, got {shown(given)}")
        return Choice(_choices(given["choice"], checked))

    return PlainValidator(parse)


def shown(value: object) -> str:
    """A value as messages show it, cut to 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _checker(least: float, greatest: float, unit: str) -> tuple[Callable[[Any], float], str]:
    """A function that checks a number, and what it expects, in words."""
    expected = f"a number from {least:g} to {greatest:g} {unit}".rstrip()

    def check(given: Any) -> float:
        right = isinstance(given, int | float) and not isinstance(given, bool)
        # NaN fails the comparison, too.
        if not (right and least <= given <= greatest):
            raise ValueError(f"expected {expected}, got {shown(given)}")
        return float(given)

    return check, expected


def _random(given: dict[str, Any], check: Callable[[Any], float], expected: str) -> Number:
    """`{ uniform = [low, high] }` or `{ choice = [...] }`."""
    if set(given) == {"uniform"}:
        bounds = given["uniform"]
        if not isinstance(bounds, list) or len(bounds) != 2:
            raise ValueError(f"uniform takes [least, greatest], got {shown(bounds)}")
        low, high = check(bounds[0]), check(bounds[1])
        if low > high:
            raise ValueError(f"uniform takes [least, greatest] in this order, got {shown(bounds)}")
        return Uniform(low, high)
    if set(given) == {"choice"}:
        return Choice(_choices(given["choice"], check))
    raise ValueError(
        f"expected {expected}, {{ uniform = [least, greatest] }} or {{ choice = [...] }}, "
        f"got {shown(given)}"
    )


def _choices(given: Any, check: Callable[[Any], Item]) -> tuple[Item, ...]:
    if not isinstance(given, Sequence) or isinstance(given, str) or not given:
        raise ValueError(f"choice takes a list of at least one value, got {shown(given)}")
    if len(given) > _MOST_CHOICES:
        raise ValueError(f"choice takes at most {_MOST_CHOICES} values, got {len(given)}")
    return tuple(check(item) for item in given)
