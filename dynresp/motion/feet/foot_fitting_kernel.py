"""The compiled part of `dynresp.motion.feet.foot_fitting`: where one foot is to be, frame by frame.

Importing this module imports numba; so import it where it is used. `foot_fitting_place_kernel` says
what the arguments hold.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from dynresp.motion.feet.foot_fitting_place_kernel import (
    Correction,
    FitLimits,
    FitTimes,
    FootDemands,
    FootShape,
    Leg,
    Track,
    put,
)
from dynresp.motion.feet.skating_kernel import least_slide
from dynresp.motion.quaternion_kernel import (
    from_to,
    from_vector,
    multiply,
    rotate,
    row,
    to_vector,
    yaw_of,
)
from dynresp.support.compiling import compiled, helper

_ROWS = types.float64[:, ::1]
_NUMBERS = types.float64[::1]
_FLAGS = types.boolean[::1]


@helper
def _fading(value, slope, at, length):
    """The cubic from a value and its slope per frame to 0 and slope 0 in `length` frames."""
    if at >= length:
        return 0.0
    u = at / length
    left = 1.0 - u
    return left * left * (value * (1.0 + 2.0 * u) + slope * length * u)


@helper
def _lowest(q, balls):
    """Height of the lowest of some balls (n, 4: centre, radius) of a foot above its ankle."""
    low = np.inf
    for k in range(len(balls)):
        height = rotate(q, balls[k, 0], balls[k, 1], balls[k, 2])[2] - balls[k, 3]
        low = min(low, height)
    return low


@helper
def _low(track, k, balls):
    """Height of the lowest of some balls of a foot above the ground at frame k."""
    return track.ankles[k, 2] + _lowest(row(track.feet, k), balls)


@helper
def _corrected(played, turn, k):
    """Orientation of the corrected foot at frame k."""
    return multiply(from_vector(turn[k, 0], turn[k, 1], turn[k, 2]), row(played.feet, k))


@helper
def _slide(before, after, x, y, sole, touch, shifts, touching):
    """How the sole's stillest point moves where the ankle moves by (x, y) over the ground.

    Args:
        before: Orientation before the step.
        after: Orientation after it.
        x: How the ankle moves [m].
        y: How the ankle moves [m].
        sole: See `FootShape`.
        touch: See `FitLimits`.
        shifts: (4, 3) scratch.
        touching: (4,) scratch.
    """
    lowest = np.inf
    for c in range(4):
        a = rotate(before, sole[c, 0], sole[c, 1], sole[c, 2])
        b = rotate(after, sole[c, 0], sole[c, 1], sole[c, 2])
        shifts[c, 0], shifts[c, 1], shifts[c, 2] = x + b[0] - a[0], y + b[1] - a[1], a[2]
        lowest = min(lowest, a[2])
    for c in range(4):
        touching[c] = shifts[c, 2] <= lowest + touch
    return least_slide(shifts, touching)


@helper
def _facing(start, window_stop, last, played, source, weight, turn, max_turn):
    """How far a stance that begins is turned about the vertical from the source [rad]."""
    sine = cosine = 0.0
    for k in range(start, window_stop):
        off = yaw_of(from_to(row(source.feet, k), row(played.feet, k)))
        sine += weight[k] * math.sin(off)
        cosine += weight[k] * math.cos(off)
    yaw = math.atan2(sine, cosine)
    if last < 0:
        return yaw
    most = max_turn * (start - last)
    own = yaw_of(from_to(row(source.feet, start), row(played.feet, start)))
    return min(max(yaw, own + turn[last, 2] - most), own + turn[last, 2] + most)


@helper
def _misfit(k, played, source, jump, correction, sole):
    """How a standing foot differs from the source at frame k, if it moves on as played there.

    Returns:
        Yaw from the source [rad]; tilt about x and y, seen from there, and its slope per frame
        [rad]; how much higher the sole is [m], and the slope of that per frame.
    """
    step = from_to(row(played.feet, k - 1), row(played.feet, k))
    before = _corrected(played, correction.turn, k - 1)
    off = from_to(row(source.feet, k), multiply(step, before))
    yaw = yaw_of(off)
    back = from_vector(0.0, 0.0, -yaw)
    tilt_x, tilt_y, _ = to_vector(multiply(back, off))
    climb = _low(played, k, sole) - _low(played, k - 1, sole)
    low = _low(source, k, sole)
    height = played.ankles[k - 1, 2] + correction.shift[k - 1, 2] + _lowest(before, sole)
    rise = height + climb - low
    slope_x = slope_y = slope = 0.0
    if k + 1 < len(jump) and not jump[k + 1]:
        vector = to_vector(from_to(row(played.feet, k), row(played.feet, k + 1)))
        now = rotate(back, vector[0], vector[1], vector[2])
        own = to_vector(from_to(row(source.feet, k), row(source.feet, k + 1)))
        slope_x, slope_y = now[0] - own[0], now[1] - own[1]
        slope = _low(played, k + 1, sole) - _low(played, k, sole)
        slope -= _low(source, k + 1, sole) - low
    return yaw, (tilt_x, tilt_y, slope_x, slope_y), (rise, slope)


@helper
def _stand(stance, hurry, yaw, played, source, demands, shape, blend, correction):
    """Write how the foot is turned, and how high it is, in a stance.

    Args:
        stance: First frame, one past the last, and whether the foot stood in the frame before.
        hurry: 1 where the stance begins right after a known correction, 0 where there is time for
            a whole swing: the foot begins with this part of the played tilt and height.
        yaw: How far the stance is turned about the vertical from the source [rad].
        played: See `correct_kernel`.
        source: Likewise.
        demands: Likewise.
        shape: Likewise.
        blend: Frames in which a misfit to the source fades.
        correction: Out.
    """
    start, stop, goes_on = stance
    sole, turn, shift = shape.sole, correction.turn, correction.shift
    off = from_to(row(source.feet, start), row(played.feet, start))
    tilt_x, tilt_y, _ = to_vector(multiply(from_vector(0.0, 0.0, -yaw_of(off)), off))
    tilt = (hurry * tilt_x, hurry * tilt_y, 0.0, 0.0)
    rise = (hurry * (_low(played, start, sole) - _low(source, start, sole)), 0.0)
    at = start
    for k in range(start, stop):
        if (k == start and goes_on) or (k > start and demands.jump[k]):
            yaw, tilt, rise = _misfit(k, played, source, demands.jump, correction, sole)
            at = k
        tilt_x = _fading(tilt[0], tilt[2], k - at, blend)
        tilt_y = _fading(tilt[1], tilt[3], k - at, blend)
        off = multiply(from_vector(0.0, 0.0, yaw), from_vector(tilt_x, tilt_y, 0.0))
        orientation = multiply(off, row(source.feet, k))
        vector = to_vector(from_to(row(played.feet, k), orientation))
        turn[k, 0], turn[k, 1], turn[k, 2] = vector
        height = _low(source, k, sole) + _fading(rise[0], rise[1], k - at, blend)
        z = height - _lowest(orientation, sole)
        z = max(z, demands.bound[k] - _lowest(orientation, shape.balls))
        shift[k, 2] = z - played.ankles[k, 2]


@helper
def _hold(stance, played, source, demands, sole, still, touch, correction):
    """Write where the foot is on the ground in a stance, so that it does not slide.

    Args:
        stance: See `_stand`.
        played: See `correct_kernel`.
        source: Likewise.
        demands: Likewise.
        sole: See `FootShape`.
        still: Frames in which a foot comes to rest that slides when the stance is taken over.
        touch: See `FitLimits`.
        correction: Out.
    """
    start, stop, goes_on = stance
    shift, turn = correction.shift, correction.turn
    shifts, touching = np.empty((4, 3)), np.empty(4, np.bool_)
    slip_x = slip_y = 0.0
    if not goes_on:
        shift[start, 0] = shift[start, 1] = 0.0
    elif start == 1 or demands.contact[start - 2]:
        # A foot that slides in the given frames comes to rest. Where only one frame is given, the
        # slide is that with which it would be played on.
        k = max(start - 1, 1)
        x = played.ankles[k, 0] - played.ankles[k - 1, 0]
        y = played.ankles[k, 1] - played.ankles[k - 1, 1]
        if start > 1:
            x, y = x + shift[k, 0] - shift[k - 1, 0], y + shift[k, 1] - shift[k - 1, 1]
        before, after = _corrected(played, turn, k - 1), _corrected(played, turn, k)
        slip_x, slip_y = _slide(before, after, x, y, sole, touch, shifts, touching)
    first = start if goes_on else start + 1
    for k in range(first, stop):
        before, after = _corrected(played, turn, k - 1), _corrected(played, turn, k)
        own_x = played.ankles[k, 0] - played.ankles[k - 1, 0]
        own_y = played.ankles[k, 1] - played.ankles[k - 1, 1]
        x, y = own_x, own_y
        if not (k == start or demands.jump[k]):
            yaw = yaw_of(from_to(row(source.feet, k), after))
            x = source.ankles[k, 0] - source.ankles[k - 1, 0]
            y = source.ankles[k, 1] - source.ankles[k - 1, 1]
            x, y, _ = rotate(from_vector(0.0, 0.0, yaw), x, y, 0.0)
        off = _slide(before, after, x, y, sole, touch, shifts, touching)
        left = _fading(1.0, 0.0, k - start + 1, still)
        shift[k, 0] = shift[k - 1, 0] + x - off[0] + left * slip_x - own_x
        shift[k, 1] = shift[k - 1, 1] + y - off[1] + left * slip_y - own_y


@helper
def _restrain(stance, max_distance, shift):
    """Let a foot slide that would be held too far from where it is played."""
    start, stop, goes_on = stance
    if goes_on:
        max_distance = max(max_distance, np.hypot(shift[start - 1, 0], shift[start - 1, 1]))
    for k in range(start, stop):
        part = max_distance / max(max_distance, np.hypot(shift[k, 0], shift[k, 1]))
        shift[k, 0] *= part
        shift[k, 1] *= part


@helper
def _swing(last, following, known, ease, values):
    """Ease a correction (n, 3) from one frame where it is known to the next.

    Args:
        last: The frame before, or -1.
        following: The frame after, or n.
        known: (n,) where it is known.
        ease: Frames in which it fades, at most.
        values: In and out.
    """
    n = len(values)
    length = min(following - last, ease) if last >= 0 and following < n else ease
    for axis in range(3):
        a = slope_a = b = slope_b = 0.0
        if last >= 0:
            a = values[last, axis]
            if last > 0 and known[last - 1]:
                slope_a = a - values[last - 1, axis]
        if following < n:
            b = values[following, axis]
            if following + 1 < n and known[following + 1]:
                slope_b = values[following + 1, axis] - b
        for k in range(last + 1, following):
            value = 0.0
            if last >= 0:
                value += _fading(a, slope_a, k - last, length)
            if following < n:
                value += _fading(b, -slope_b, following - k, length)
            values[k, axis] = value


@compiled(
    types.void(
        types.BaseTuple.from_types((_ROWS, _ROWS), Track),
        types.BaseTuple.from_types((_ROWS, _ROWS), Track),
        types.BaseTuple.from_types((_FLAGS, _FLAGS, _NUMBERS, _NUMBERS), FootDemands),
        types.BaseTuple.from_types((_ROWS, _ROWS), FootShape),
        types.BaseTuple.from_types((_ROWS, _NUMBERS), Leg),
        types.int64,
        types.BaseTuple.from_types((types.int64,) * 4, FitTimes),
        types.BaseTuple.from_types((types.float64,) * 6, FitLimits),
        types.BaseTuple.from_types((_ROWS, _ROWS), Correction),
    ),
    interpreted_first=True,
)
def correct_kernel(played, source, demands, shape, leg, kept, times, limits, correction):
    """Write the corrections of one foot.

    Args:
        played: The foot's `Track` as played.
        source: Its `Track` in the source.
        demands: `FootDemands`, frame by frame.
        shape: The foot's `FootShape`.
        leg: Its `Leg`.
        kept: Frames at the beginning whose correction is given.
        times: `FitTimes`.
        limits: `FitLimits`.
        correction: `Correction`; in for the first `kept` rows, out for the others.
    """
    contact, shift, turn = demands.contact, correction.shift, correction.turn
    n = len(contact)
    known = contact.copy()
    known[:kept] = True
    last = kept - 1
    start = kept
    while start < n:
        if not contact[start]:
            start += 1
            continue
        goes_on = start == kept and kept > 0 and contact[kept - 1]
        stop = start + 1
        while stop < n and contact[stop]:
            stop += 1
        window_stop = min(start + times.stance, stop)
        yaw = 0.0
        if not goes_on:
            yaw = _facing(
                start, window_stop, last, played, source, demands.weight, turn, limits.turn
            )
        hurry = max(0.0, 1.0 - (start - last - 1) / times.ease) if last >= 0 else 0.0
        stance = (start, stop, goes_on)
        _stand(stance, hurry, yaw, played, source, demands, shape, times.blend, correction)
        _hold(stance, played, source, demands, shape.sole, times.still, limits.touch, correction)
        if not goes_on:
            put(start, stop, window_stop, last, demands.weight, played, leg, limits, shift)
        _restrain(stance, limits.hold_distance, shift)
        last, start = stop - 1, stop
    last = kept - 1
    for k in range(kept, n + 1):
        if k < n and not known[k]:
            continue
        if k > last + 1:
            _swing(last, k, known, times.ease, shift)
            _swing(last, k, known, times.ease, turn)
            for i in range(last + 1, k):
                orientation = _corrected(played, turn, i)
                low = shift[i, 2] + played.ankles[i, 2] + _lowest(orientation, shape.balls)
                shift[i, 2] += max(0.0, demands.bound[i] - low)
        last = k
