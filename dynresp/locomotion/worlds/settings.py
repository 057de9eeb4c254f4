"""Settings that are numbers: what is none is refused where it is given, not where it is used."""

from __future__ import annotations

import dataclasses
import math
from numbers import Integral, Real
from typing import Any

from dynresp.support.errors import UsageError

_KINDS: dict[str, tuple[type, str]] = {
    "float": (Real, "a finite number"),
    "int": (Integral, "a whole number"),
}


def check_numbers(settings: Any) -> None:
    """Check that what a dataclass says to be a `float` or an `int` is one, and finite.

    Args:
        settings: The dataclass's object.

    Raises:
        UsageError: A field is not; the message names it.
    """
    for field in dataclasses.fields(settings):
        kind, expected = _KINDS.get(str(field.type), (object, ""))
        value = getattr(settings, field.name)
        if not expected:
            continue
        if not isinstance(value, kind) or isinstance(value, bool):
            raise UsageError(f"{field.name} must be {expected}, got {str(value)[:40]!r}")
        try:
            finite = math.isfinite(value)  # type: ignore[arg-type]
        except OverflowError:
            # It has more digits than Python may be willing to write.
            raise UsageError(
                f"{field.name} must be {expected}, got one that is larger than any float"
            ) from None
        if not finite:
            raise UsageError(f"{field.name} must be {expected}, got {str(value)[:40]!r}")
