"""Dynamic time warping: how alike two sequences are if their speeds may differ.

Rows are matched in order, each at least once, with the least sum of distances: the recurrence of
Bruderlin and Williams 1995, with steps along either sequence or along both at once, all of equal
weight. Lee et al. 2002 compare sketched paths (section 5.2) and video (section 5.3) with motion
this way.

The kernel is our own. Libraries compare whole sequences with whole ones, or find a short one in a
long one. Here one sequence is compared with the beginnings of many sequences of different lengths,
ten times a second. This needs nothing but NumPy and numba.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError


@dataclass(frozen=True, eq=False)
class Warping:
    """One sequence warped onto each of many.

    Attributes:
        costs: (k,) sums of Euclidean distances over the matched pairs of rows.
        stops: (k,) how many rows of each candidate are matched.
    """

    costs: FloatArray
    stops: npt.NDArray[np.int64]


def warp_onto(
    first: npt.ArrayLike, candidates: Sequence[npt.ArrayLike], open_end: bool = False
) -> Warping:
    """Warp a sequence onto each of some candidates.

    Args:
        first: (m, d) rows, or (m,) numbers.
        candidates: Each (n, d) or (n,); n may differ.
        open_end: Whether `first` may end before a candidate does. Then so many rows at the
            candidate's end stay unmatched that the cost is least.

    Raises:
        MotionError: A sequence is empty or not finite, or the widths differ.
    """
    sequences = [
        _rows(first, "first"),
        *(_rows(c, f"candidate {k}") for k, c in enumerate(candidates)),
    ]
    widths = {rows.shape[1] for rows in sequences}
    if len(widths) > 1:
        raise MotionError(
            f"all sequences to warp must have rows of one width, got widths {sorted(widths)}"
        )
    rows = np.concatenate(sequences[1:]) if len(sequences) > 1 else np.empty((0, widths.pop()))
    offsets = np.cumsum([0, *(len(s) for s in sequences[1:])])
    return warp_onto_rows(sequences[0], rows, offsets, open_end)


def warp_onto_rows(
    first: FloatArray, rows: FloatArray, offsets: npt.NDArray[np.int64], open_end: bool
) -> Warping:
    """`warp_onto` without checks, for candidates in one array: for loops that run often.

    Args:
        first: (m, d), m at least 1.
        rows: (total, d) the candidates, one after the other.
        offsets: (k + 1,) where each candidate begins, and the last ends; none is empty.
        open_end: As in `warp_onto`.
    """
    # Numba takes a third of a second to import.
    from dynresp.locomotion.vision.time_warping_kernel import warp_kernel

    costs = np.empty(len(offsets) - 1)
    stops = np.empty(len(costs), dtype=np.int64)
    warp_kernel(
        np.ascontiguousarray(first, dtype=np.float64),
        np.ascontiguousarray(rows, dtype=np.float64),
        np.ascontiguousarray(offsets, dtype=np.int64),
        open_end,
        costs,
        stops,
    )
    return Warping(costs, stops)


def _rows(sequence: npt.ArrayLike, what: str) -> FloatArray:
    rows = np.asarray(sequence, dtype=np.float64)
    if rows.ndim == 1:
        rows = rows[:, None]
    if rows.ndim != 2 or 0 in rows.shape or not np.isfinite(rows).all():
        raise MotionError(
            f"{what} to warp must be finite, of shape (rows, width), and not empty, got "
            f"shape {rows.shape}"
        )
    return rows
