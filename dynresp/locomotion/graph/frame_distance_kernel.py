"""Compiled search for pairs of frames that resemble each other.

Importing this module imports numba; so import it where it is used. There are two passes over the
pairs of a row. The first drops most pairs by a lower bound: each frame has a vector of 16 numbers,
and the squared distance of two vectors is never above the distance of the frames. The second
computes the remaining distances in full. Every pair is computed once, by the same instructions
wherever its row begins, so the result does not depend on how rows are divided among threads.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.array_growth_kernel import doubled
from dynresp.support.compiling import compiled, helper

LANES = 16
"""Rotations of a frame, padded with the identity: one vector."""

BOUND_SIZE = 16
"""Numbers of a bound vector; a multiple of four."""

PARTS = 7
"""Rows of LANES numbers in a packed frame: the four parts of its quaternions, then three for
positions and velocities."""

# Half an angle squared, divided by the squared chord u = |q - q'|^2, on 0 <= u <= 2: a polynomial
# fitted for the smallest largest relative error, 4e-7 in float32.
_G0 = np.float32(1.0000002)
_G1 = np.float32(0.083320074)
_G2 = np.float32(0.011211397)
_G3 = np.float32(0.0015059111)
_G4 = np.float32(0.0006785783)
_G5 = np.float32(-0.000165599995)
_G6 = np.float32(7.2013143e-05)

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_QUARTER = np.float32(0.5 * math.pi)
# Pairs that are bounded at once: their data stays in the nearest cache.
_RUN = 256


class Groups(NamedTuple):
    """How frames are stored: those of a group side by side, ascending.

    Attributes:
        place_of: (n,) place of each frame, -1 where it is in no group.
        stops: (n,) one past the last place of each frame's group.
        frame_of: (m,) frame at each place.
    """

    place_of: Any
    stops: Any
    frame_of: Any


class PackedFrames(NamedTuple):
    """The frames at their places.

    Attributes:
        bounds: (BOUND_SIZE, m) the bound vectors.
        packed: (m, PARTS, LANES) the numbers of each frame.
        yaws: (m,) yaw of the root [rad].
        turned: (m, 4, 10) roots after none to three quarter turns: position, quaternion w x y z,
            linear velocity. With blocks, `packed` has no root; otherwise this has no rows.
        cell: (3,) size of a block [m].
    """

    bounds: Any
    packed: Any
    yaws: Any
    turned: Any
    cell: Any


_LONGS, _SINGLES = types.int64[::1], types.float32[::1]
_SIGNATURE = types.Tuple((_LONGS, types.int32[::1], _SINGLES))(
    types.int64,
    types.int64,
    types.BaseTuple.from_types((_LONGS, _LONGS, types.int32[::1]), Groups),
    types.BaseTuple.from_types(
        (types.float32[:, ::1], types.float32[:, :, ::1], _SINGLES, types.float32[:, :, ::1],
         _SINGLES),
        PackedFrames,
    ),
    types.float32,
    types.float32,
)  # fmt: skip
_FASTMATH = {"contract", "nnan", "nsz", "reassoc"}


@helper(inline="always")
def _half_squared(aw, ax, ay, az, bw, bx, by, bz):
    """Half the angle between two rotations, squared."""
    sign = _ONE if aw * bw + ax * bx + ay * by + az * bz >= _ZERO else -_ONE
    w, x, y, z = aw - sign * bw, ax - sign * bx, ay - sign * by, az - sign * bz
    u = w * w + x * x + y * y + z * z
    return u * (_G0 + u * (_G1 + u * (_G2 + u * (_G3 + u * (_G4 + u * (_G5 + u * _G6))))))


@helper(inline="always")
def _lower_bounds(bounds, own, start, count, sums):
    """Squared distances of bound vectors from one of them."""
    for d in range(0, BOUND_SIZE, 4):
        x0, x1, x2, x3 = bounds[d, own], bounds[d + 1, own], bounds[d + 2, own], bounds[d + 3, own]
        r0, r1 = bounds[d, start : start + count], bounds[d + 1, start : start + count]
        r2, r3 = bounds[d + 2, start : start + count], bounds[d + 3, start : start + count]
        for t in range(count):
            e0, e1, e2, e3 = r0[t] - x0, r1[t] - x1, r2[t] - x2, r3[t] - x3
            part = e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3
            sums[t] = part if d == 0 else sums[t] + part


@compiled(_SIGNATURE, fastmath=_FASTMATH)
def close_pairs(first, stop, groups, frames, max_bound, max_distance):
    """Pairs (i, j), i <= j, of frames of one group that are at most `max_distance` apart.

    A frame in no group has no pairs. The first pair of every other frame is the one with itself.

    Args:
        first: First row.
        stop: One past the last row.
        groups: `Groups`.
        frames: `PackedFrames`.
        max_bound: Largest squared distance of bound vectors.
        max_distance: Largest distance of a pair.

    Returns:
        Where rows begin (stop - first + 1,), the frames j (pairs,), and the distances (pairs,).
    """
    place_of, packed, turned = groups.place_of, frames.packed, frames.turned
    bounds, yaws, cell = frames.bounds, frames.yaws, frames.cell
    offsets = np.zeros(stop - first + 1, np.int64)
    columns = np.empty(4096, np.int32)
    distances = np.empty(4096, np.float32)
    sums = np.empty(_RUN, np.float32)
    candidates = np.empty(_RUN, np.int64)
    found = 0
    on_blocks = turned.shape[0] > 0
    # Read at run time: loops over constants would be unrolled instead of vectorised.
    lanes = packed.shape[2]
    for i in range(first, stop):
        own = place_of[i]
        if own < 0:
            offsets[i - first + 1] = found
            continue
        a = packed[own]
        for start in range(own, groups.stops[i], _RUN):
            count = min(_RUN, groups.stops[i] - start)
            _lower_bounds(bounds, own, start, count, sums)
            left = 0
            for t in range(count):
                candidates[left] = start + t
                left += sums[t] <= max_bound
            if found + left > len(columns):
                columns, distances = doubled(columns), doubled(distances)
            for t in range(left):
                place = candidates[t]
                b = packed[place]
                total = _ZERO
                for k in range(lanes):
                    total += _half_squared(
                        a[0, k], a[1, k], a[2, k], a[3, k], b[0, k], b[1, k], b[2, k], b[3, k]
                    )
                    x, y, z = a[4, k] - b[4, k], a[5, k] - b[5, k], a[6, k] - b[6, k]
                    total += x * x + y * y + z * z
                if on_blocks:
                    turn = np.int64(np.rint((yaws[own] - yaws[place]) / _QUARTER)) & 3
                    p, q = turned[own, 0], turned[place, turn]
                    total += _half_squared(p[3], p[4], p[5], p[6], q[3], q[4], q[5], q[6])
                    for k in range(3):
                        offset = p[k] - q[k]
                        offset -= cell[k] * np.rint(offset / cell[k])
                        speed = p[k + 7] - q[k + 7]
                        total += offset * offset + speed * speed
                columns[found] = groups.frame_of[place]
                distances[found] = total
                found += total <= max_distance
        offsets[i - first + 1] = found
    return offsets, columns[:found].copy(), distances[:found].copy()
