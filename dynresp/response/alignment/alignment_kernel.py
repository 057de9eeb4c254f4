"""The compiled part of the time alignment: samples in sets, and descents from the best.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.response.alignment.mismatch_kernel import (
    PLAIN,
    ROWS,
    Track,
    Weights,
    error_between,
    lay_out,
    slopes_between,
)
from dynresp.support.compiling import compiled, helper

# Floats in one vector instruction: `LANES` of `dynresp.response.windows.windows`.
LANES = 8

# A step must lower the mismatch by this share of what the slope predicts (Armijo's rule); one that
# does not is shortened, at most this often.
_ARMIJO = 1e-4
_MOST_CUTS = 6

BEGIN, LENGTH, FIRST, LATER = range(4)
"""Columns of `Clips.layouts`."""
ERROR, EXIT, ENTRY, EVALUATIONS, SETS, COMPLETE, REFINED, COLUMNS = range(8)
"""Columns of the results of `align_kernel`, and how many there are."""


class Clips(NamedTuple):
    """The reactions.

    Attributes:
        rows: Clips of all reactions as `lay_out` stores them, one after the other.
        layouts: (reactions, 4) where a reaction's clip begins in `rows` (`BEGIN`), how long its
            rows are (`LENGTH`), the frame of the reaction with which it begins, which is the first
            entry (`FIRST`), and how many frames later the last entry is (`LATER`).
    """

    rows: Any
    layouts: Any


class Sampling(NamedTuple):
    """Which pairs of windows are compared first.

    Attributes:
        frames: Frames in a window.
        exits: (sets,) exits to sample, ascending [frames]; the trace must have a window after the
            first.
        step: Largest step of the entries to sample [frames].
        patience: Sampling ends after so many sets without a better sample.
    """

    frames: Any
    exits: Any
    step: Any
    patience: Any


class Descent(NamedTuple):
    """How the best samples are refined.

    Attributes:
        starts: Samples to descend from.
        most: Steps of a descent, 0 for none.
        gain: A descent ends where a step lowers the mismatch by no more than this share of it.
    """

    starts: Any
    most: Any
    gain: Any


_TRACK = types.Array(types.float64, 3, "C", readonly=True)
_TRACKS = types.Array(types.float64, 4, "C", readonly=True)
_FLOATS = types.Array(types.float32, 1, "C", readonly=True)
_REALS = types.Array(types.float64, 1, "C", readonly=True)
_INTS = types.Array(types.int64, 2, "C", readonly=True)
_INT, _REAL = types.int64, types.float64
_CLIPS = types.BaseTuple.from_types((_FLOATS, _INTS), Clips)
_WEIGHTS = types.BaseTuple.from_types((_FLOATS, _FLOATS), Weights)
_ALIGN = _INT(
    _TRACKS,
    _TRACKS,
    _INTS,
    _CLIPS,
    _WEIGHTS,
    types.BaseTuple.from_types((_INT, _REALS, _REAL, _INT), Sampling),
    types.BaseTuple.from_types((_INT, _INT, _REAL), Descent),
    types.float64[:, :, ::1],
)
_ERRORS = types.boolean(
    _TRACK,
    _TRACK,
    _INT,
    _CLIPS,
    _WEIGHTS,
    _INT,
    _REALS,
    _REALS,
    types.float64[::1],
)


@helper(**PLAIN)
def _can_descend(at, low, high, slope):
    """Whether a step down the slope stays between the bounds."""
    return not ((at <= low and slope >= 0.0) or (at >= high and slope <= 0.0))


@helper(**PLAIN)
def _descend(trace, first, last, clip, latest, weights, s, m, step, descent):
    """BFGS from a sample, kept within the bounds: mismatch, exit, entry and evaluations."""
    gain = descent.gain
    f, gs, gm = slopes_between(trace, s, last, clip, m, latest, weights)
    evaluations = 1
    # As if the minimum were half a sample away, until a step shows the curvature.
    hss = max(math.sqrt(gs * gs + gm * gm) / (0.5 * step), 1e-12)
    hmm, hsm, curvature_known = hss, 0.0, False
    for _ in range(descent.most):
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
            f1, gs1, gm1 = slopes_between(trace, s1, last, clip, m1, latest, weights)
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


@helper(**PLAIN)
def _lowest(errors, sets, entries):
    """The lowest mismatch of the first sets (infinity if all are), its set and its entry."""
    lowest, s, e = np.float32(np.inf), 0, 0
    for i in range(sets):
        for j in range(entries):
            if errors[i, j] < lowest:
                lowest, s, e = errors[i, j], i, j
    return lowest, s, e


@helper(**PLAIN)
def _clip(rows, layout, bodies):
    """The clip of a reaction."""
    begin, length = layout[BEGIN], layout[LENGTH]
    return Track(rows[begin : begin + ROWS * length], length, bodies)


@compiled(_ALIGN, **PLAIN)
def align_kernel(positions, quaternions, reactions, clips, weights, sampling, descent, found):
    """Align reactions with traces: sample in sets, one for each exit; descend from the best.

    Args:
        positions: (traces, frames, bodies, 3) [m], float64; frame 0 is the first contact, body 0
            the pelvis.
        quaternions: (traces, frames, bodies, 4), w x y z.
        reactions: (traces, k) reactions to align with each trace, as rows of `Clips.layouts`.
        clips: `Clips`.
        weights: `Weights`.
        sampling: `Sampling`.
        descent: `Descent`.
        found: Out, (traces, k, `COLUMNS`).

    Returns:
        The first trace that is not finite or not of unit length, -1 if there is none.
    """
    exits = sampling.exits
    given, bodies = positions.shape[1], positions.shape[2]
    sets = 0
    while sets < len(exits) and math.ceil(exits[sets]) + sampling.frames <= given:
        sets += 1
    used = math.ceil(exits[sets - 1]) + sampling.frames
    length = (used + 1) * bodies + LANES
    trace = Track(np.empty(ROWS * length, np.float32), length, bodies)
    for n in range(len(positions)):
        if not lay_out(positions[n], quaternions[n], used, trace.rows):
            return n
        for r in range(reactions.shape[1]):
            layout = clips.layouts[reactions[n, r]]
            clip, first = _clip(clips.rows, layout, bodies), layout[FIRST]
            latest = float(layout[LATER])
            entries = math.ceil(latest / sampling.step - 1e-9) + 1
            errors = np.empty((sets, entries), np.float32)
            entry_step = latest / max(entries - 1, 1)
            best, idle_sets, sampled = np.float32(np.inf), 0, 0
            while sampled < sets and idle_sets < sampling.patience:
                idle_sets += 1
                for e in range(entries):
                    error = error_between(trace, exits[sampled], clip, e * entry_step, weights)
                    errors[sampled, e] = error
                    if error < best:
                        best, idle_sets = error, 0
                sampled += 1
            out = found[n, r]
            out[ERROR] = np.inf
            out[EVALUATIONS] = sampled * entries
            out[SETS] = sampled
            out[COMPLETE] = sampled == len(exits) or idle_sets >= sampling.patience
            for _ in range(descent.starts):
                lowest, s, e = _lowest(errors, sampled, entries)
                if lowest == np.inf:
                    break
                # Its neighbours lead to the same minimum.
                for i in range(max(s - 1, 0), min(s + 2, sets)):
                    for j in range(max(e - 1, 0), min(e + 2, entries)):
                        errors[i, j] = np.inf
                if lowest < out[ERROR]:
                    out[REFINED] = 0.0
                    out[ERROR], out[EXIT], out[ENTRY] = lowest, exits[s], e * entry_step + first
                if descent.most > 0:
                    error, at, entry, cost = _descend(
                        trace, exits[0], exits[sampled - 1], clip, latest, weights, exits[s],
                        e * entry_step, sampling.step, descent,
                    )  # fmt: skip
                    out[EVALUATIONS] += cost
                    if error < out[ERROR]:
                        out[REFINED] = 1.0
                        out[ERROR], out[EXIT], out[ENTRY] = error, at, entry + first
    return -1


@compiled(_ERRORS, **PLAIN)
def errors_kernel(positions, quaternions, reaction, clips, weights, frames, exits, entries, errors):
    """Write mismatches of windows that begin anywhere between frames.

    Args:
        positions: (frames, bodies, 3), as for `align_kernel`.
        quaternions: (frames, bodies, 4).
        reaction: A row of `Clips.layouts`.
        clips: `Clips`.
        weights: `Weights`.
        frames: Frames in a window.
        exits: (pairs,) [frames].
        entries: (pairs,) [frames].
        errors: Out, (pairs,) [m].

    Returns:
        Whether what is needed of the trace is finite and of unit length.
    """
    bodies = positions.shape[1]
    last = 0.0
    for exit_at in exits:
        last = max(last, exit_at)
    used = math.ceil(last) + frames
    length = (used + 1) * bodies + LANES
    track = Track(np.empty(ROWS * length, np.float32), length, bodies)
    if not lay_out(positions, quaternions, used, track.rows):
        return False
    layout = clips.layouts[reaction]
    clip = _clip(clips.rows, layout, bodies)
    for p in range(len(exits)):
        errors[p] = error_between(track, exits[p], clip, entries[p] - layout[FIRST], weights)
    return True
