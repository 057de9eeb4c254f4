"""The compiled step of `dynresp.locomotion.vision.belief`: one more row of video.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.compiling import compiled

_ROW = types.Array(types.float32, 1, "C", readonly=True)
_GRID = types.float32[:, ::1]


class FrameViews(NamedTuple):
    """The frames of the database from all viewpoints. Read-only.

    Attributes:
        rows: (n, views, d) float32, what is seen of each frame from each viewpoint.
        headings: (n, views) uint16, which of the `views` directions the person of a frame faces,
            as that viewpoint sees it.
        past: (n,) uint8, how many frames of the same clip come before each frame, at most 2.
    """

    rows: Any
    headings: Any
    past: Any


class StepChances(NamedTuple):
    """Chances of what happens from one frame of video to the next, float32.

    Attributes:
        stay: The same frame again.
        advance: The next frame of the clip.
        skip: The next frame but one.
        turn: A neighbouring viewpoint fits better than before.
        exponent_scale: Half the inverse of the usual squared distance between rows that look alike.
    """

    stay: Any
    advance: Any
    skip: Any
    turn: Any
    exponent_scale: Any


_FRAMES = types.NamedTuple(
    (
        types.Array(types.float32, 3, "C", readonly=True),
        types.Array(types.uint16, 2, "C", readonly=True),
        types.Array(types.uint8, 1, "C", readonly=True),
    ),
    FrameViews,
)
# Numba's name for a named tuple whose fields are all of one type.
_CHANCES = types.NamedUniTuple(types.float32, 5, StepChances)
_SIGNATURE = types.void(_FRAMES, _CHANCES, _ROW, types.float32[::1], _GRID, _GRID, _GRID)

# Likelihoods beyond this many powers of e below the best count as 0.
_MAX_EXPONENT = np.float32(60.0)

# The sum of a distance may be spread over the lanes of a vector; tables hold no NaN.
_FAST = {"contract", "nnan", "nsz", "reassoc"}


@compiled(_SIGNATURE, error_model="numpy", fastmath=_FAST)
def belief_step_kernel(frames, chances, row, fresh, distances, belief, after):
    """Move a belief one frame on, and weight it by what is seen.

    Args:
        frames: The frames of the database.
        chances: Chances of what happens from one frame of video to the next.
        row: (d,) what is seen now.
        fresh: (views,) chance, for each frame of the database, that the person now faces each
            direction and does something that does not follow from the belief.
        distances: Scratch, (n, views).
        belief: (n, views) the belief so far; sums to 1.
        after: Out, (n, views) the new belief.
    """
    table, headings, past = frames.rows, frames.headings, frames.past
    stay, advance, skip = chances.stay, chances.advance, chances.skip
    turn, exponent_scale = chances.turn, chances.exponent_scale
    n, views, width = table.shape
    nearest = np.float32(math.inf)
    for i in range(n):
        for v in range(views):
            total = np.float32(0.0)
            for k in range(width):
                difference = table[i, v, k] - row[k]
                total += difference * difference
            distances[i, v] = total * exponent_scale
            nearest = min(nearest, distances[i, v])
    total_belief = 0.0
    for i in range(n):
        for v in range(views):
            expected = stay * belief[i, v]
            if past[i] >= 1:
                expected += advance * belief[i - 1, v]
            if past[i] >= 2:
                expected += skip * belief[i - 2, v]
            after[i, v] = expected
        first, left = after[i, 0], after[i, views - 1]
        half = np.float32(0.5) * turn
        for v in range(views):
            here = after[i, v]
            right = first
            if v + 1 < views:
                right = after[i, v + 1]
            expected = (np.float32(1.0) - turn) * here + half * (left + right)
            expected += fresh[headings[i, v]]
            left = here
            exponent = distances[i, v] - nearest
            likelihood = np.float32(0.0)
            if exponent < _MAX_EXPONENT:
                likelihood = np.float32(math.exp(-exponent))
            after[i, v] = expected * likelihood
            total_belief += after[i, v]
    scale = np.float32(1.0 / total_belief)
    for i in range(n):
        for v in range(views):
            after[i, v] *= scale
