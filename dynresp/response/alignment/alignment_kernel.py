"""The compiled part of the time alignment: mismatches between frames, sampling and descent.

The mismatch of two windows is that of `window_kernel`. Here a window may begin between two frames:
positions are interpolated along straight lines, quaternions along the shorter chord, and brought
back to unit length.

A track is stored as seven rows of float32, x y z w i j k; each has the bodies of the first frame,
then those of the next, and so on. A window is then one range of every row, wherever it begins, and
the next frames are the same range, shifted by the number of bodies. The loop over that range is the
only hot one. It writes only sums, so that the compiler makes vector instructions without a
check of which arrays overlap. The same pass gives the slopes along both times. A first call
compiles; importing this module imports numba, so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from dynresp.response.windows.window_kernel import Q0, Q1, Q2, Q3, Q4
from dynresp.support.compiling import compiled, helper

# Floats in one vector instruction: `LANES` of `dynresp.response.windows.windows`.
LANES = 8

# Coefficients of the derivative of `window_kernel`'s polynomial Q: angle = chord Q(chord^2).
_R2, _R3, _R4 = np.float32(2.0) * Q2, np.float32(3.0) * Q3, np.float32(4.0) * Q4

_ZERO, _HALF, _ONE, _TWO = (np.float32(v) for v in (0.0, 0.5, 1.0, 2.0))
# A difference smaller than this [m, or chord] has no direction, and no slope; a pelvis whose (w, k)
# is shorter than this is upside down, has no facing and is not turned.
_TINY = np.float32(1e-6)

# A step must lower the mismatch by this share of what the slope predicts (Armijo's rule); one that
# does not is shortened, at most this often.
_ARMIJO = 1e-4
_MOST_CUTS = 6

_UNIT_TOLERANCE = 1e-3

ROWS = 7
ERROR, EXIT, ENTRY, EVALUATIONS, SETS, COMPLETE, REFINED, COLUMNS = range(8)
"""Columns of the results of `align_kernel`, and how many there are."""

_TRACK = types.Array(types.float64, 3, "C", readonly=True)
_TRACKS = types.Array(types.float64, 4, "C", readonly=True)
_FLOATS = types.Array(types.float32, 1, "C", readonly=True)
_REALS = types.Array(types.float64, 1, "C", readonly=True)
_LAYOUT = types.Array(types.int64, 1, "C", readonly=True)
_INTS = types.Array(types.int64, 2, "C", readonly=True)
_INT, _REAL, _OUT = types.int64, types.float64, types.float64[::1]
_OUTS = types.float64[:, :, ::1]
# fmt: off
_LAY_OUT = types.boolean(_TRACK, _TRACK, _INT, types.float32[::1])
_ALIGN = _INT(_TRACKS, _TRACKS, _INTS, _FLOATS, _INTS, _FLOATS, _FLOATS, _INT, _REALS, _REAL, _INT,
              _INT, _INT, _REAL, _OUTS)
_ERRORS = types.boolean(_TRACK, _TRACK, _FLOATS, _LAYOUT, _FLOATS, _FLOATS, _INT, _REALS, _REALS,
                        _OUT)
# fmt: on

# A check for division by zero would keep a loop from becoming vector instructions.
_PLAIN: dict[str, Any] = {"error_model": "numpy"}
# Sums may be spread over the lanes of a vector: another processor may give other bits, but every
# call on one gives the same. The input has no NaN (`lay_out` checks it).
_FAST: dict[str, Any] = {**_PLAIN, "fastmath": {"contract", "nnan", "nsz", "reassoc"}}


@helper(forceinline=True, **_FAST)
def _heading(track, row, at, share, bodies):
    """Ground point and half yaw of the pelvis at a window's first frame, and their rates."""
    end = at + bodies
    x, y = track[at], track[row + at]
    dx, dy = track[end] - x, track[row + end] - y
    w, k = track[3 * row + at], track[6 * row + at]
    dw, dk = track[3 * row + end] - w, track[6 * row + end] - k
    w, k = w + share * dw, k + share * dk
    square = w * w + k * k
    if square < _TINY * _TINY:
        return x + share * dx, y + share * dy, _ONE, _ZERO, dx, dy, _ZERO
    size = math.sqrt(square)
    yaw_rate = _TWO * (w * dk - k * dw) / square
    return x + share * dx, y + share * dy, w / size, k / size, dx, dy, yaw_rate


@helper(forceinline=True, **_FAST)
def _measure(a, a_row, a_frame, a_share, b, b_row, b_frame, b_share, bodies, wp, wt):
    """Mismatch of two windows [m] and its slopes along the first frame of either [m/frame].

    The window of track `a` begins `a_share`, 0 to 1, after its frame `a_frame`; that of `b`
    likewise. The second is moved onto the first, not both to the origin; the mismatch is the same.
    """
    f, g = np.float32(a_share), np.float32(b_share)
    i, j = a_frame * bodies, b_frame * bodies
    aox, aoy, ac, as_, aodx, aody, a_yaw = _heading(a, a_row, i, f, bodies)
    box, boy, bc, bs, bodx, body, b_yaw = _heading(b, b_row, j, g, bodies)
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
def _error(a, a_row, exit_at, b, b_row, entry_at, bodies, wp, wt):
    """Mismatch alone; the compiler drops what only the slopes need."""
    s, m = int(exit_at), int(entry_at)
    found = _measure(a, a_row, s, exit_at - s, b, b_row, m, entry_at - m, bodies, wp, wt)
    return found[0]


@helper(**_FAST)
def _slope(a, a_row, exit_at, last, b, b_row, entry_at, latest, bodies, wp, wt):
    """Mismatch and slopes; at the upper bounds, the slopes from below."""
    s, m = int(exit_at), int(entry_at)
    if exit_at >= last and s == exit_at and s > 0:
        s -= 1
    if entry_at >= latest and m == entry_at and m > 0:
        m -= 1
    return _measure(a, a_row, s, exit_at - s, b, b_row, m, entry_at - m, bodies, wp, wt)


@compiled(_LAY_OUT, **_PLAIN)
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


@helper(**_PLAIN)
def _can_descend(at, low, high, slope):
    """Whether a step down the slope stays between the bounds."""
    return not ((at <= low and slope >= 0.0) or (at >= high and slope <= 0.0))


@helper(**_PLAIN)
def _descend(a, a_row, first, last, b, b_row, latest, bodies, wp, wt, s, m, step, most, gain):
    """BFGS from a sample, kept within the bounds: mismatch, exit, entry and evaluations."""
    f, gs, gm = _slope(a, a_row, s, last, b, b_row, m, latest, bodies, wp, wt)
    evaluations = 1
    # As if the minimum were half a sample away, until a step shows the curvature.
    hss = max(math.sqrt(gs * gs + gm * gm) / (0.5 * step), 1e-12)
    hmm, hsm, curvature_known = hss, 0.0, False
    for _ in range(most):
        s_free, m_free = _can_descend(s, first, last, gs), _can_descend(m, 0.0, latest, gm)
        if not (s_free or m_free):
            break
        ds = -gs / hss if s_free else 0.0
        dm = -gm / hmm if m_free else 0.0
        if s_free and m_free:
            det = hss * hmm - hsm * hsm
            ns, nm = (hsm * gm - hmm * gs) / det, (hsm * gs - hss * gm) / det
            # Where a bound shortens it, the step may lead up.
            ts, tm = min(max(s + ns, first), last) - s, min(max(m + nm, 0.0), latest) - m
            if gs * ts + gm * tm < 0.0:
                ds, dm = ns, nm
        size, accepted = 1.0, False
        for _ in range(_MOST_CUTS):
            s1 = min(max(s + size * ds, first), last)
            m1 = min(max(m + size * dm, 0.0), latest)
            promised = gs * (s1 - s) + gm * (m1 - m)
            if -promised <= gain * f:
                break
            f1, gs1, gm1 = _slope(a, a_row, s1, last, b, b_row, m1, latest, bodies, wp, wt)
            evaluations += 1
            if f1 <= f + _ARMIJO * promised:
                accepted = True
                break
            # The lowest point of the parabola through both ends with the slope at the first.
            size *= min(max(-0.5 * promised / (f1 - f - promised), 0.1), 0.5)
        if not accepted:
            break
        xs, xm, ys, ym = s1 - s, m1 - m, gs1 - gs, gm1 - gm
        bend, length = xs * ys + xm * ym, xs * xs + xm * xm
        if bend > 1e-9 * length:
            if not curvature_known:
                hss = hmm = (ys * ys + ym * ym) / bend
                curvature_known = True
            bs, bm = hss * xs + hsm * xm, hsm * xs + hmm * xm
            stiff = xs * bs + xm * bm
            hss += ys * ys / bend - bs * bs / stiff
            hsm += ys * ym / bend - bs * bm / stiff
            hmm += ym * ym / bend - bm * bm / stiff
        small = f - f1 <= gain * f
        s, m, f, gs, gm = s1, m1, f1, gs1, gm1
        if small:
            break
    return f, s, m, evaluations


@helper(**_PLAIN)
def _lowest(errors, sets, entries):
    """The lowest mismatch of the first sets (infinity if all are), its set and its entry."""
    lowest, s, e = np.float32(np.inf), 0, 0
    for i in range(sets):
        for j in range(entries):
            if errors[i, j] < lowest:
                lowest, s, e = errors[i, j], i, j
    return lowest, s, e


@compiled(_ALIGN, **_PLAIN)
def align_kernel(
    positions, quaternions, rows, clips, layouts, wp, wt, frames, exits, step, patience, starts,
    most, gain, found,
):  # fmt: skip
    """Align reactions with traces: sample in sets, one for each exit; descend from the best.

    Args:
        positions: (traces, frames, bodies, 3) [m], float64; frame 0 is the first contact, body 0
            the pelvis.
        quaternions: (traces, frames, bodies, 4), w x y z.
        rows: (traces, k) reactions to align with each trace.
        clips: Clips of all reactions as `lay_out` stores them, one after the other.
        layouts: (reactions, 4): index in `clips` at which a reaction's clip begins, its row length,
            the frame of the reaction with which it begins, which is the first entry, and how many
            frames later the last entry is.
        wp: Weight of a metre for each body of each frame of a window, padded with zeros.
        wt: Weight of a radian likewise.
        frames: Frames in a window.
        exits: (sets,) exits to sample, ascending [frames]; the trace must have a window after the
            first.
        step: Largest step of the entries to sample [frames].
        patience: Sampling ends after so many sets without a better sample.
        starts: Samples to descend from.
        most: Steps of a descent, 0 for none.
        gain: A descent ends where a step lowers the mismatch by no more than this share of it.
        found: Out, (traces, k, `COLUMNS`).

    Returns:
        The first trace that is not finite or not of unit length, -1 if there is none.
    """
    traces, given, bodies = positions.shape[0], positions.shape[1], positions.shape[2]
    sets = 0
    while sets < len(exits) and math.ceil(exits[sets]) + frames <= given:
        sets += 1
    used = math.ceil(exits[sets - 1]) + frames
    a_row = (used + 1) * bodies + LANES
    a = np.empty(ROWS * a_row, np.float32)
    for n in range(traces):
        if not lay_out(positions[n], quaternions[n], used, a):
            return n
        for r in range(rows.shape[1]):
            layout = layouts[rows[n, r]]
            b_row, latest = layout[1], float(layout[3])
            b = clips[layout[0] : layout[0] + ROWS * b_row]
            entries = math.ceil(latest / step - 1e-9) + 1
            errors = np.empty((sets, entries), np.float32)
            entry_step = latest / max(entries - 1, 1)
            best, idle_sets, sampled = np.float32(np.inf), 0, 0
            while sampled < sets and idle_sets < patience:
                idle_sets += 1
                for e in range(entries):
                    error = _error(
                        a, a_row, exits[sampled], b, b_row, e * entry_step, bodies, wp, wt
                    )
                    errors[sampled, e] = error
                    if error < best:
                        best, idle_sets = error, 0
                sampled += 1
            out = found[n, r]
            out[ERROR] = np.inf
            out[EVALUATIONS] = sampled * entries
            out[SETS] = sampled
            out[COMPLETE] = sampled == len(exits) or idle_sets >= patience
            for _ in range(starts):
                lowest, s, e = _lowest(errors, sampled, entries)
                if lowest == np.inf:
                    break
                # Its neighbours lead to the same minimum.
                for i in range(max(s - 1, 0), min(s + 2, sets)):
                    for j in range(max(e - 1, 0), min(e + 2, entries)):
                        errors[i, j] = np.inf
                if lowest < out[ERROR]:
                    out[REFINED] = 0.0
                    out[ERROR], out[EXIT], out[ENTRY] = lowest, exits[s], e * entry_step + layout[2]
                if most > 0:
                    error, at, entry, cost = _descend(
                        a, a_row, exits[0], exits[sampled - 1], b, b_row, latest, bodies, wp, wt,
                        exits[s], e * entry_step, step, most, gain,
                    )  # fmt: skip
                    out[EVALUATIONS] += cost
                    if error < out[ERROR]:
                        out[REFINED] = 1.0
                        out[ERROR], out[EXIT], out[ENTRY] = error, at, entry + layout[2]
    return -1


@compiled(_ERRORS, **_PLAIN)
def errors_kernel(positions, quaternions, clips, layout, wp, wt, frames, exits, entries, errors):
    """Write mismatches of windows that begin anywhere between frames to `errors` (pairs,) [m].

    `layout` is the reaction's row of `layouts`; all else is as for `align_kernel`, with one trace.
    Returns False if what is needed of the trace is not finite or not of unit length.
    """
    bodies = positions.shape[1]
    latest = 0.0
    for exit_at in exits:
        latest = max(latest, exit_at)
    used = math.ceil(latest) + frames
    a_row = (used + 1) * bodies + LANES
    a = np.empty(ROWS * a_row, np.float32)
    if not lay_out(positions, quaternions, used, a):
        return False
    b_row = layout[1]
    b = clips[layout[0] : layout[0] + ROWS * b_row]
    for p in range(len(exits)):
        errors[p] = _error(a, a_row, exits[p], b, b_row, entries[p] - layout[2], bodies, wp, wt)
    return True
