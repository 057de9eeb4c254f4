"""The compiled inner loop of the window search.

Importing this module imports numba (a third of a second); so import it where it is used.

The mismatch (window error) of a pair is (Zordan et al. 2007, section 5)

    E = sum_i w_i sum_b ( wp_b |p_b - p'_b| + wt_b angle(q_b, q'_b) ),   sum_i w_i = 1,

summed frame by frame and body by body in float32. The innermost loop runs over the entry windows,
which are neighbours in memory and become the lanes of vector instructions; no sum runs across
lanes, so the order of additions, and with it every bit of the result, is fixed.

The angle is taken from the chord c = |q - q'| of the nearer of q' and -q', angle = 4 asin(c / 2).
Unlike acos of the dot product, that keeps its digits near the identity, and as c * Q(c^2) with a
polynomial Q it needs no branch and no library call.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

# Q(u) = 4 asin(sqrt(u) / 2) / sqrt(u) on 0 <= u <= 2 (rotations up to 180 degrees), fitted by
# weighted least squares for the smallest largest relative error, 5.8e-6. Two more terms would give
# 1.8e-7 and cost an eighth more time.
Q0 = np.float32(2.0000112)
Q1 = np.float32(0.08307144)
Q2 = np.float32(0.010329804)
Q3 = np.float32(0.00022560566)
Q4 = np.float32(0.00075941515)

# A pair excludes others only if they exceed it by more than rounding can explain.
_SLACK = np.float32(1.0001)
_FLOOR = np.float32(1e-5)
_ZERO = np.float32(0.0)


class Entries(NamedTuple):
    """Windows of all reactions.

    Attributes:
        buffer: Windows of the reactions, each (frames, bodies, 7, entries padded), flat float32.
        offsets: (reactions,) index in `buffer` at which each reaction begins.
        counts: (reactions,) entries of each reaction without padding.
    """

    buffer: Any
    offsets: Any
    counts: Any


class BodyWeights(NamedTuple):
    """Weights of the mismatch, (frames, bodies) each: w_i wp_b of positions, w_i wt_b of angles."""

    position: Any
    angle: Any


class Best(NamedTuple):
    """The best pair of windows of every reaction.

    Attributes:
        errors: (reactions,) its mismatch [m].
        exits: (reactions,) index of the exit; of equal mismatches the lowest exit, then the lowest
            entry.
        entries: (reactions,) index of the entry.
    """

    errors: Any
    exits: Any
    entries: Any


_FLOATS, _INTS, _TABLE = types.float32[::1], types.int64[::1], types.float32[:, ::1]
_FROZEN = types.Array(types.float32, 1, "C", readonly=True)
_FROZEN_INTS = types.Array(types.int64, 1, "C", readonly=True)
_SIGNATURE = types.void(
    types.Array(types.float32, 4, "C", readonly=True),
    types.int64,
    types.BaseTuple.from_types((_FROZEN, _FROZEN_INTS, _FROZEN_INTS), Entries),
    types.BaseTuple.from_types((_TABLE, _TABLE), BodyWeights),
    types.int64,
    types.boolean,
    types.BaseTuple.from_types((_FLOATS, _INTS, _INTS), Best),
    _TABLE,
)
# No reassociation: the order of additions is fixed. The input has no NaN (`make_windows` checks).
_FASTMATH = {"contract", "nnan", "nsz"}


@helper(inline="always")
def _difference(ax, ay, az, aw, ai, aj, ak, bx, by, bz, bw, bi, bj, bk, wp, wt):
    """Weighted difference of two states of a body."""
    x, y, z = ax - bx, ay - by, az - bz
    distance = math.sqrt(x * x + y * y + z * z)
    w, i, j, k = aw - bw, ai - bi, aj - bj, ak - bk
    near = w * w + i * i + j * j + k * k
    w, i, j, k = aw + bw, ai + bi, aj + bj, ak + bk
    u = min(near, w * w + i * i + j * j + k * k)
    q = Q0 + u * (Q1 + u * (Q2 + u * (Q3 + u * Q4)))
    return wp * distance + wt * (math.sqrt(u) * q)


@compiled(_SIGNATURE, fastmath=_FASTMATH)
def search_kernel(trace, exits, entries, weights, lanes, early_stop, found, errors):
    """Find the best pair of windows of every reaction.

    With `early_stop`, entries at both ends of an exit's row are skipped as soon as their sum so far
    exceeds the whole mismatch of another pair. Terms are never negative, so what is skipped could
    not have won, and what is kept is summed as always: the result is the same.

    Args:
        trace: (frames, bodies, 7, exits padded) float32.
        exits: Number of exits without padding.
        entries: `Entries`.
        weights: `BodyWeights`.
        lanes: Windows are padded to a multiple of this; rows are cut at multiples of it.
        early_stop: Whether to skip pairs that cannot win.
        found: Out, `Best`.
        errors: Scratch, (exits, largest padded count); has all mismatches of the last reaction
            afterwards if `early_stop` is off.
    """
    frames, bodies = trace.shape[0], trace.shape[1]
    buffer, offsets = entries.buffer, entries.offsets
    position_weights, angle_weights = weights.position, weights.angle
    low = np.empty(exits, np.int64)
    high = np.empty(exits, np.int64)
    for r in range(len(offsets)):
        count = entries.counts[r]
        padded = (count + lanes - 1) // lanes * lanes
        low[:] = 0
        high[:] = padded
        errors[:, :padded] = _ZERO
        bound = np.float32(np.inf)
        tried_exit, tried_entry = -1, -1
        for f in range(frames):
            for b in range(bodies):
                row = offsets[r] + (f * bodies + b) * 7 * padded
                px = buffer[row : row + padded]
                py = buffer[row + padded : row + 2 * padded]
                pz = buffer[row + 2 * padded : row + 3 * padded]
                qw = buffer[row + 3 * padded : row + 4 * padded]
                qi = buffer[row + 4 * padded : row + 5 * padded]
                qj = buffer[row + 5 * padded : row + 6 * padded]
                qk = buffer[row + 6 * padded : row + 7 * padded]
                wp, wt = position_weights[f, b], angle_weights[f, b]
                for s in range(exits):
                    tx, ty, tz = trace[f, b, 0, s], trace[f, b, 1, s], trace[f, b, 2, s]
                    tw, ti = trace[f, b, 3, s], trace[f, b, 4, s]
                    tj, tk = trace[f, b, 5, s], trace[f, b, 6, s]
                    total = errors[s]
                    for m in range(np.uint64(low[s]), np.uint64(high[s])):
                        total[m] += _difference(
                            px[m], py[m], pz[m], qw[m], qi[m], qj[m], qk[m],
                            tx, ty, tz, tw, ti, tj, tk, wp, wt,
                        )  # fmt: skip
            if not early_stop or f == frames - 1:
                continue
            # The whole mismatch of the pair that leads so far bounds that of the winner.
            lead, lead_exit, lead_entry = np.float32(np.inf), 0, 0
            for s in range(exits):
                for m in range(low[s], min(high[s], count)):
                    if errors[s, m] < lead:
                        lead, lead_exit, lead_entry = errors[s, m], s, m
            if lead_exit != tried_exit or lead_entry != tried_entry:
                tried_exit, tried_entry = lead_exit, lead_entry
                for g in range(f + 1, frames):
                    for b in range(bodies):
                        at = offsets[r] + (g * bodies + b) * 7 * padded + lead_entry
                        lead += _difference(
                            buffer[at], buffer[at + padded], buffer[at + 2 * padded],
                            buffer[at + 3 * padded], buffer[at + 4 * padded],
                            buffer[at + 5 * padded], buffer[at + 6 * padded],
                            trace[g, b, 0, lead_exit], trace[g, b, 1, lead_exit],
                            trace[g, b, 2, lead_exit], trace[g, b, 3, lead_exit],
                            trace[g, b, 4, lead_exit], trace[g, b, 5, lead_exit],
                            trace[g, b, 6, lead_exit], position_weights[g, b], angle_weights[g, b],
                        )  # fmt: skip
                bound = min(bound, lead * _SLACK + _FLOOR)
            for s in range(exits):
                first, last = low[s], min(high[s], count)
                while first < last and errors[s, first] > bound:
                    first += 1
                while first < last and errors[s, last - 1] > bound:
                    last -= 1
                low[s] = first // lanes * lanes
                high[s] = (last + lanes - 1) // lanes * lanes if first < last else low[s]
        best = np.float32(np.inf)
        found.exits[r], found.entries[r] = 0, 0
        for s in range(exits):
            for m in range(low[s], min(high[s], count)):
                if errors[s, m] < best:
                    best = errors[s, m]
                    found.exits[r], found.entries[r] = s, m
        found.errors[r] = best
