"""Runs of flags, found frame by frame."""

from __future__ import annotations

from collections.abc import Sequence


def runs(flags: Sequence[bool]) -> list[tuple[int, int]]:
    """First and one past the last index of each run of set flags."""
    found, start = [], None
    for i, flag in enumerate([*flags, False]):
        if flag and start is None:
            start = i
        elif not flag and start is not None:
            found.append((start, i))
            start = None
    return found
