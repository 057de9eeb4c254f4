"""The part of `dynresp.motion.feet.foot_fitting_kernel` that tells where a stance is put."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# A place is sought within reach in so many steps, and to within so much [m].
_SEARCH = 64
_NEAR = 1e-4


@njit
def into_discs(x, y, discs):
    """Move a point into discs, or to where it is least far out of them if they have none in common.

    It moves towards the centre of the disc that it is farthest out of, again and again, and by ever
    less.

    Args:
        x: Where it is [m].
        y: Where it is [m].
        discs: (m, 3) centres, and radii [m].

    Returns:
        Where it then is, x and y, and whether that is in all discs, to a tenth of a
        millimetre.
    """
    for turn in range(_SEARCH):
        out, farthest = _NEAR, -1
        for k in range(len(discs)):
            away = math.hypot(x - discs[k, 0], y - discs[k, 1]) - discs[k, 2]
            if away > out:
                out, farthest = away, k
        if farthest < 0:
            return x, y, True
        way_x, way_y = discs[farthest, 0] - x, discs[farthest, 1] - y
        part = out / max(math.hypot(way_x, way_y), 1e-12) * 4.0 / max(turn, 4)
        x, y = x + min(part, 1.0) * way_x, y + min(part, 1.0) * way_y
    return x, y, False


@njit
def _discs(start, stop, played, shift, leg, lowered, farthest, discs):
    """Write where a stance may be put (2 (stop - start), 3) so that the leg reaches it throughout.

    Also so that the foot is not too far from where it is played.
    """
    hips, reach = leg
    for k in range(start, stop):
        at = 2 * (k - start)
        discs[at, 0] = discs[at + 1, 0] = -shift[k, 0]
        discs[at, 1] = discs[at + 1, 1] = -shift[k, 1]
        discs[at, 0] += hips[k, 0] - played[0][k, 0]
        discs[at, 1] += hips[k, 1] - played[0][k, 1]
        down = max(hips[k, 2] - lowered - played[0][k, 2] - shift[k, 2], 0.0)
        discs[at, 2] = math.sqrt(max(reach[k] ** 2 - down**2, 0.0))
        discs[at + 1, 2] = farthest


@njit
def _near(x, y, start, last, most, shift):
    """A place drawn so near to the last stance that a correction changes by `most` a frame."""
    if last < 0:
        return x, y
    off_x, off_y = x - shift[last, 0], y - shift[last, 1]
    part = min(1.0, most * (start - last) / max(math.hypot(off_x, off_y), 1e-12))
    return shift[last, 0] + part * off_x, shift[last, 1] + part * off_y


@njit
def put(start, stop, window_stop, last, weight, played, leg, limits, shift):
    """Shift a stance that begins to where it departs least from what is played, but within reach.

    If it can be, within reach of the leg as it is played; else of one whose hip is lowered.

    Args:
        start: Its first frame.
        stop: One past its last.
        window_stop: One past the last that tells where it is put.
        last: The last frame before it whose correction is known, or -1.
        weight: See `foot_fitting_kernel.correct_kernel`.
        played: Likewise.
        leg: Likewise.
        limits: Likewise.
        shift: (n, 3) in and out; 0 along the ground in the stance's first frame.
    """
    _, fastest, _, farthest, hastiest, deepest = limits
    total = mean_x = mean_y = 0.0
    for k in range(start, window_stop):
        total += weight[k]
        mean_x += weight[k] * shift[k, 0]
        mean_y += weight[k] * shift[k, 1]
    # The first shift is 0 so far.
    x, y = _near(-mean_x / total, -mean_y / total, start, last, fastest, shift)
    discs = np.empty((2 * (window_stop - start), 3))
    for lowered in (0.0, deepest):
        _discs(start, window_stop, played, shift, leg, lowered, farthest, discs)
        x, y, reached = into_discs(x, y, discs)
        if reached:
            break
    x, y = _near(x, y, start, last, hastiest, shift)
    for k in range(start, stop):
        shift[k, 0] += x
        shift[k, 1] += y
