"""The mismatch of two windows that may begin between frames, and its slopes.

It is that of `window_kernel`, with positions interpolated along straight lines, quaternions along
the shorter chord, and brought back to unit length.

A track is stored as seven rows of float32, x y z w i j k; each has the bodies of the first frame,
then those of the next, and so on. A window is then one range of every row, wherever it begins, and
the next frames are the same range, shifted by the number of bodies. The loop over that range is the
only hot one. It writes only sums, so that the compiler makes vector instructions without a
check of which arrays overlap. The same pass gives the slopes along both times.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.response.windows.window_kernel import Q0, Q1, Q2, Q3, Q4
from dynresp.support.compiling import compiled, helper

# Coefficients of the derivative of `window_kernel`'s polynomial Q: angle = chord Q(chord^2).
_R2, _R3, _R4 = np.float32(2.0) * Q2, np.float32(3.0) * Q3, np.float32(4.0) * Q4

_ZERO, _HALF, _ONE, _TWO = (np.float32(v) for v in (0.0, 0.5, 1.0, 2.0))
# A difference smaller than this [m, or chord] has no direction, and no slope; a pelvis whose (w, k)
# is shorter than this is upside down, has no facing and is not turned.
_TINY = np.float32(1e-6)

_UNIT_TOLERANCE = 1e-3

ROWS = 7
"""Rows of a track."""

# A check for division by zero would keep a loop from becoming vector instructions.
PLAIN: dict[str, Any] = {"error_model": "numpy"}
"""Options of all kernels here."""
# Sums may be spread over the lanes of a vector: another processor may give other bits, but every
# call on one gives the same. The input has no NaN (`lay_out` checks it).
_FAST: dict[str, Any] = {**PLAIN, "fastmath": {"contract", "nnan", "nsz", "reassoc"}}

_POSITIONS = types.Array(types.float64, 3, "C", readonly=True)


class Track(NamedTuple):
    """A track as `lay_out` stores it.

    Attributes:
        rows: The seven rows, one after the other.
        length: Length of a row.
        bodies: Number of bodies.
    """

    rows: Any
    length: Any
    bodies: Any


class Weights(NamedTuple):
    """Weights of the mismatch, for each body of each frame of a window, padded with zeros.

    Attributes:
        metre: Of a metre.
        radian: Of a radian.
    """

    metre: Any
    radian: Any


@helper(forceinline=True, **_FAST)
def _heading(track, at, share):
    """Ground point and half yaw of the pelvis at a window's first frame, and their rates."""
    rows, row, end = track.rows, track.length, at + track.bodies
    x, y = rows[at], rows[row + at]
    dx, dy = rows[end] - x, rows[row + end] - y
    w, k = rows[3 * row + at], rows[6 * row + at]
    dw, dk = rows[3 * row + end] - w, rows[6 * row + end] - k
    w, k = w + share * dw, k + share * dk
    square = w * w + k * k
    if square < _TINY * _TINY:
        return x + share * dx, y + share * dy, _ONE, _ZERO, dx, dy, _ZERO
    size = math.sqrt(square)
    yaw_rate = _TWO * (w * dk - k * dw) / square
    return x + share * dx, y + share * dy, w / size, k / size, dx, dy, yaw_rate


@helper(forceinline=True, **_FAST)
def _measure(trace, exit_frame, exit_share, clip, entry_frame, entry_share, weights):
    """Mismatch of two windows [m] and its slopes along the first frame of either [m/frame].

    The window of the trace begins `exit_share`, 0 to 1, after its frame `exit_frame`; that of the
    clip likewise. The second is moved onto the first, not both to the origin; the mismatch is the
    same.
    """
    a, a_row, b, b_row = trace.rows, trace.length, clip.rows, clip.length
    bodies, wp, wt = trace.bodies, weights.metre, weights.radian
    f, g = np.float32(exit_share), np.float32(entry_share)
    i, j = exit_frame * bodies, entry_frame * bodies
    aox, aoy, ac, as_, aodx, aody, a_yaw = _heading(trace, i, f)
    box, boy, bc, bs, bodx, body, b_yaw = _heading(clip, j, g)
    # The turn that brings the second window onto the first: its half angle, then its whole.
    c, s = ac * bc + as_ * bs, as_ * bc - ac * bs
    cc, ss = c * c - s * s, _TWO * c * s
    # Unsigned, so that no index needs a check of its sign.
    n, step = np.uint64(len(wp)), np.uint64(bodies)
    ax, ay, az = a[i:], a[a_row + i :], a[2 * a_row + i :]
    aw, ai = a[3 * a_row + i :], a[4 * a_row + i :]
    aj, ak = a[5 * a_row + i :], a[6 * a_row + i :]
    bx, by, bz = b[j:], b[b_row + j :], b[2 * b_row + j :]
    bw, bi = b[3 * b_row + j :], b[4 * b_row + j :]
    bj, bk = b[5 * b_row + j :], b[6 * b_row + j :]
    total, along_a, along_b = _ZERO, _ZERO, _ZERO
    for e in range(n):
        h = e + step
        # Positions.
        vax, vay, vaz = ax[h] - ax[e], ay[h] - ay[e], az[h] - az[e]
        vbx, vby, vbz = bx[h] - bx[e], by[h] - by[e], bz[h] - bz[e]
        px, py = bx[e] + g * vbx - box, by[e] + g * vby - boy
        px, py = cc * px - ss * py, ss * px + cc * py
        dx, dy = ax[e] + f * vax - aox - px, ay[e] + f * vay - aoy - py
        dz = az[e] + f * vaz - (bz[e] + g * vbz)
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        vax, vay, vbx, vby = vax - aodx, vay - aody, vbx - bodx, vby - body
        vbx, vby = cc * vbx - ss * vby, ss * vbx + cc * vby
        twist = px * dy - py * dx
        per_metre = wp[e] / max(distance, _TINY)
        slope_a = per_metre * (dx * vax + dy * vay + dz * vaz - a_yaw * twist)
        slope_b = per_metre * (b_yaw * twist - dx * vbx - dy * vby - dz * vbz)
        # Quaternions: interpolate, bring to unit length, turn the second's.
        uw, ui, uj, uk = aw[h] - aw[e], ai[h] - ai[e], aj[h] - aj[e], ak[h] - ak[e]
        qw, qi, qj, qk = aw[e] + f * uw, ai[e] + f * ui, aj[e] + f * uj, ak[e] + f * uk
        tw, ti, tj, tk = bw[h] - bw[e], bi[h] - bi[e], bj[h] - bj[e], bk[h] - bk[e]
        rw, ri, rj, rk = bw[e] + g * tw, bi[e] + g * ti, bj[e] + g * tj, bk[e] + g * tk
        unit_a = _ONE / math.sqrt(qw * qw + qi * qi + qj * qj + qk * qk)
        unit_b = _ONE / math.sqrt(rw * rw + ri * ri + rj * rj + rk * rk)
        qw, qi, qj, qk = unit_a * qw, unit_a * qi, unit_a * qj, unit_a * qk
        rw, ri, rj, rk = unit_b * rw, unit_b * ri, unit_b * rj, unit_b * rk
        rw, rk, ri, rj = c * rw - s * rk, s * rw + c * rk, c * ri - s * rj, s * ri + c * rj
        tw, tk, ti, tj = c * tw - s * tk, s * tw + c * tk, c * ti - s * tj, s * ti + c * tj
        dot = qw * rw + qi * ri + qj * rj + qk * rk
        sign = _ONE if dot >= _ZERO else -_ONE
        cw, ci, cj, ck = qw - sign * rw, qi - sign * ri, qj - sign * rj, qk - sign * rk
        u = cw * cw + ci * ci + cj * cj + ck * ck
        chord = math.sqrt(u)
        q = Q0 + u * (Q1 + u * (Q2 + u * (Q3 + u * Q4)))
        total += wp[e] * distance + wt[e] * (chord * q)
        # d(chord Q) / du, times the change of u; the turn itself changes with either facing.
        rise = (_HALF * q + u * (Q1 + u * (_R2 + u * (_R3 + u * _R4)))) / max(chord, _TINY)
        rise = sign * wt[e] * rise
        swing = qk * rw - qw * rk + qj * ri - qi * rj
        own = qw * uw + qi * ui + qj * uj + qk * uk
        across = rw * uw + ri * ui + rj * uj + rk * uk
        along_a += slope_a - rise * (_TWO * unit_a * (across - dot * own) + a_yaw * swing)
        own = rw * tw + ri * ti + rj * tj + rk * tk
        across = qw * tw + qi * ti + qj * tj + qk * tk
        along_b += slope_b - rise * (_TWO * unit_b * (across - dot * own) - b_yaw * swing)
    return total, along_a, along_b


@helper(**_FAST)
def error_between(trace, exit_at, clip, entry_at, weights):
    """Mismatch alone; the compiler drops what only the slopes need."""
    s, m = int(exit_at), int(entry_at)
    return _measure(trace, s, exit_at - s, clip, m, entry_at - m, weights)[0]


@helper(**_FAST)
def slopes_between(trace, exit_at, last, clip, entry_at, latest, weights):
    """Mismatch and slopes; at the upper bounds, the slopes from below."""
    s, m = int(exit_at), int(entry_at)
    if exit_at >= last and s == exit_at and s > 0:
        s -= 1
    if entry_at >= latest and m == entry_at and m > 0:
        m -= 1
    return _measure(trace, s, exit_at - s, clip, m, entry_at - m, weights)


@compiled(types.boolean(_POSITIONS, _POSITIONS, types.int64, types.float32[::1]), **PLAIN)
def lay_out(positions, quaternions, frames, rows):
    """Store a track in rows; one more frame, a copy of the last, and finite padding follow.

    Args:
        positions: (frames or more, bodies, 3) [m], float64.
        quaternions: (frames or more, bodies, 4), w x y z.
        frames: How many of them to take.
        rows: Out, (7 * row length,) float32. The ground point of the first frame's pelvis is
            subtracted from all positions, in double precision; signs of quaternions are chosen
            so that neighbour frames are in one hemisphere.

    Returns:
        Whether all numbers are finite and all quaternions of unit length.
    """
    bodies = positions.shape[1]
    row = len(rows) // ROWS
    ox, oy = positions[0, 0, 0], positions[0, 0, 1]
    for f in range(frames):
        for b in range(bodies):
            e = f * bodies + b
            x, y, z = positions[f, b, 0] - ox, positions[f, b, 1] - oy, positions[f, b, 2]
            w, i = quaternions[f, b, 0], quaternions[f, b, 1]
            j, k = quaternions[f, b, 2], quaternions[f, b, 3]
            size = math.sqrt(w * w + i * i + j * j + k * k)
            if not (abs(size - 1.0) <= _UNIT_TOLERANCE and math.isfinite(x + y + z)):
                return False
            scale = 1.0 / size
            if f > 0:
                p = e - bodies
                dot = w * rows[3 * row + p] + i * rows[4 * row + p]
                dot += j * rows[5 * row + p] + k * rows[6 * row + p]
                if dot < 0.0:
                    scale = -scale
            rows[e], rows[row + e], rows[2 * row + e] = x, y, z
            rows[3 * row + e], rows[4 * row + e] = scale * w, scale * i
            rows[5 * row + e], rows[6 * row + e] = scale * j, scale * k
    end = frames * bodies
    for c in range(ROWS):
        for e in range(end, row):
            rows[c * row + e] = rows[c * row + e - bodies]
    return True
