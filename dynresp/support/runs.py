"""Runs: spans of consecutive frames in which a flag is set."""

from __future__ import annotations

import numpy as np

from dynresp.support.arrays import BoolArray


def runs(flags: BoolArray) -> list[tuple[int, int]]:
    """First and one past the last index of each run of set flags (n,), in order."""
    padded = np.zeros(len(flags) + 2, dtype=bool)
    padded[1:-1] = flags
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    return [(start, stop) for start, stop in edges.reshape(-1, 2).tolist()]
