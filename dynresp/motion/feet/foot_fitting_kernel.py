"""The compiled part of `dynresp.motion.feet.foot_fitting`: where one foot is to be, frame by frame.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used.

A track of a foot is a pair: ankle positions (n, 3) [m] and foot orientations (n, 4), in the world.
A correction takes the played foot to where it is to be; it is a pair, too: the ankle's shift (n, 3)
[m] and the foot's turn (n, 3), a rotation vector [rad], both in the world.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from dynresp.motion.feet.foot_fitting_place_kernel import put
from dynresp.motion.feet.skating_kernel import least_way
from dynresp.motion.quaternion_kernel import (
    from_to,
    from_vector,
    multiply,
    rotate,
    row,
    to_vector,
    yaw_of,
)
from dynresp.support.compiling import compiled

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_NUMBERS = types.Array(types.float64, 1, "C", readonly=True)
_FLAGS = types.Array(types.boolean, 1, "C", readonly=True)
_TRACK = types.UniTuple(_ROWS, 2)


@njit
def _fading(value, slope, at, length):
    """The cubic from a value and its slope per frame to neither in `length` frames."""
    if at >= length:
        return 0.0
    u = at / length
    return (1.0 - u) ** 2 * (value * (1.0 + 2.0 * u) + slope * length * u)


@njit
def _lowest(q, balls):
    """Height above the ankle of the lowest of some balls (n, 4), centre and radius, on a foot."""
    low = np.inf
    for k in range(len(balls)):
        height = rotate(q, balls[k, 0], balls[k, 1], balls[k, 2])[2] - balls[k, 3]
        low = min(low, height)
    return low


@njit
def _low(track, k, balls):
    """Height above the ground of the lowest of some balls on a foot at frame k."""
    return track[0][k, 2] + _lowest(row(track[1], k), balls)


@njit
def _wanted(played, turn, k):
    """Orientation of the corrected foot at frame k."""
    return multiply(from_vector(turn[k, 0], turn[k, 1], turn[k, 2]), row(played[1], k))


@njit
def _slide(before, after, x, y, sole, touch, ways, touching):
    """The way of the sole's stillest point where the ankle goes by (x, y) over the ground.

    Args:
        before: Orientation before the step.
        after: Orientation after it.
        x: The ankle's way.
        y: The ankle's way.
        sole: (4, 4) its corners in the foot's frame, and radii of 0.
        touch: How much higher than the lowest a corner that touches is at most [m].
        ways: (4, 3) scratch.
        touching: (4,) scratch.
    """
    lowest = np.inf
    for c in range(4):
        a = rotate(before, sole[c, 0], sole[c, 1], sole[c, 2])
        b = rotate(after, sole[c, 0], sole[c, 1], sole[c, 2])
        ways[c, 0], ways[c, 1], ways[c, 2] = x + b[0] - a[0], y + b[1] - a[1], a[2]
        lowest = min(lowest, a[2])
    for c in range(4):
        touching[c] = ways[c, 2] <= lowest + touch
    return least_way(ways, touching)


@njit
def _facing(start, window_stop, last, played, source, weight, turn, quickest):
    """How much a stance that begins is turned about the vertical from the source [rad]."""
    sine = cosine = 0.0
    for k in range(start, window_stop):
        off = yaw_of(from_to(row(source[1], k), row(played[1], k)))
        sine += weight[k] * math.sin(off)
        cosine += weight[k] * math.cos(off)
    yaw = math.atan2(sine, cosine)
    if last < 0:
        return yaw
    most = quickest * (start - last)
    own = yaw_of(from_to(row(source[1], start), row(played[1], start)))
    return min(max(yaw, own + turn[last, 2] - most), own + turn[last, 2] + most)


@njit
def _misfit(k, played, source, jump, shift, turn, sole):
    """What of a standing foot does not fit the source from frame k on, going on as played there.

    Returns:
        Yaw from the source [rad]; tilt about x and y, seen from there, and its slope per frame
        [rad]; how much higher the sole is [m], and the slope of that.
    """
    step = from_to(row(played[1], k - 1), row(played[1], k))
    before = _wanted(played, turn, k - 1)
    off = from_to(row(source[1], k), multiply(step, before))
    yaw = yaw_of(off)
    back = from_vector(0.0, 0.0, -yaw)
    tilt_x, tilt_y, _ = to_vector(multiply(back, off))
    climb = _low(played, k, sole) - _low(played, k - 1, sole)
    low = _low(source, k, sole)
    height = played[0][k - 1, 2] + shift[k - 1, 2] + _lowest(before, sole)
    rise = height + climb - low
    slope_x = slope_y = slope = 0.0
    if k + 1 < len(jump) and not jump[k + 1]:
        vector = to_vector(from_to(row(played[1], k), row(played[1], k + 1)))
        now = rotate(back, vector[0], vector[1], vector[2])
        own = to_vector(from_to(row(source[1], k), row(source[1], k + 1)))
        slope_x, slope_y = now[0] - own[0], now[1] - own[1]
        slope = _low(played, k + 1, sole) - _low(played, k, sole)
        slope -= _low(source, k + 1, sole) - low
    return yaw, (tilt_x, tilt_y, slope_x, slope_y), (rise, slope)


@njit
def _stand(
    start, stop, goes_on, hurry, yaw, played, source, jump, bound, sole, balls, blend, shift, turn
):
    """Write how the foot is turned, and how high it is, in a stance.

    One that begins in a hurry, which is 1 at once after a known correction and 0 where there is
    time for a whole swing, begins with as much of what is played.
    """
    off = from_to(row(source[1], start), row(played[1], start))
    tilt_x, tilt_y, _ = to_vector(multiply(from_vector(0.0, 0.0, -yaw_of(off)), off))
    tilt = (hurry * tilt_x, hurry * tilt_y, 0.0, 0.0)
    rise = (hurry * (_low(played, start, sole) - _low(source, start, sole)), 0.0)
    at = start
    for k in range(start, stop):
        if (k == start and goes_on) or (k > start and jump[k]):
            yaw, tilt, rise = _misfit(k, played, source, jump, shift, turn, sole)
            at = k
        tilt_x = _fading(tilt[0], tilt[2], k - at, blend)
        tilt_y = _fading(tilt[1], tilt[3], k - at, blend)
        off = multiply(from_vector(0.0, 0.0, yaw), from_vector(tilt_x, tilt_y, 0.0))
        orientation = multiply(off, row(source[1], k))
        vector = to_vector(from_to(row(played[1], k), orientation))
        turn[k, 0], turn[k, 1], turn[k, 2] = vector
        height = _low(source, k, sole) + _fading(rise[0], rise[1], k - at, blend)
        z = height - _lowest(orientation, sole)
        z = max(z, bound[k] - _lowest(orientation, balls))
        shift[k, 2] = z - played[0][k, 2]


@njit
def _hold(
    start, stop, goes_on, played, source, contact, jump, sole, still, touch, shift, turn,
    ways, touching,
):  # fmt: skip
    """Write where the foot is on the ground in a stance, so that it does not slide."""
    slip_x = slip_y = 0.0
    if not goes_on:
        shift[start, 0] = shift[start, 1] = 0.0
    elif start == 1 or contact[start - 2]:
        # A foot that slides when it is taken over comes to rest; where one frame alone is given,
        # how it would be played on tells how it slides.
        k = max(start - 1, 1)
        x, y = played[0][k, 0] - played[0][k - 1, 0], played[0][k, 1] - played[0][k - 1, 1]
        if start > 1:
            x, y = x + shift[k, 0] - shift[k - 1, 0], y + shift[k, 1] - shift[k - 1, 1]
        before, after = _wanted(played, turn, k - 1), _wanted(played, turn, k)
        slip_x, slip_y = _slide(before, after, x, y, sole, touch, ways, touching)
    first = start if goes_on else start + 1
    for k in range(first, stop):
        before, after = _wanted(played, turn, k - 1), _wanted(played, turn, k)
        own_x = played[0][k, 0] - played[0][k - 1, 0]
        own_y = played[0][k, 1] - played[0][k - 1, 1]
        x, y = own_x, own_y
        if not (k == start or jump[k]):
            yaw = yaw_of(from_to(row(source[1], k), after))
            x, y, _ = rotate(
                from_vector(0.0, 0.0, yaw),
                source[0][k, 0] - source[0][k - 1, 0], source[0][k, 1] - source[0][k - 1, 1], 0.0,
            )  # fmt: skip
        off = _slide(before, after, x, y, sole, touch, ways, touching)
        left = _fading(1.0, 0.0, k - start + 1, still)
        shift[k, 0] = shift[k - 1, 0] + x - off[0] + left * slip_x - own_x
        shift[k, 1] = shift[k - 1, 1] + y - off[1] + left * slip_y - own_y


@njit
def _restrain(start, stop, goes_on, farthest, shift):
    """Let a foot slide that would be held too far from where it is played."""
    if goes_on:
        farthest = max(farthest, math.hypot(shift[start - 1, 0], shift[start - 1, 1]))
    for k in range(start, stop):
        part = farthest / max(farthest, math.hypot(shift[k, 0], shift[k, 1]))
        shift[k, 0] *= part
        shift[k, 1] *= part


@njit
def _swing(last, following, known, ease, values):
    """Ease a correction (n, 3) from one frame in which it is known to the next.

    Args:
        last: The frame before, or -1.
        following: The frame after, or n.
        known: (n,) where it is known.
        ease: Frames in which it fades at most.
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
        _TRACK, _TRACK, _FLAGS, _FLAGS, _NUMBERS, _NUMBERS, _ROWS, _ROWS, types.int64,
        types.Tuple((_ROWS, _NUMBERS)),
        types.UniTuple(types.int64, 4), types.UniTuple(types.float64, 6),
        types.float64[:, ::1], types.float64[:, ::1],
    )
)  # fmt: skip
def correct_kernel(
    played,
    source,
    contact,
    jump,
    weight,
    bound,
    sole,
    balls,
    kept,
    leg,
    frames,
    limits,
    shift,
    turn,
):
    """Write the corrections of one foot.

    Args:
        played: Its track as played.
        source: Its track in the source.
        contact: (n,) whether it stands.
        jump: (n,) whether the source changes from the frame before to this one.
        weight: (n,) how much a frame tells where a stance is put; above 0.
        bound: (n,) how low the foot may reach [m].
        sole: (4, 4) corners of the sole in the foot's frame, and radii of 0.
        balls: (b, 4) balls that hold the whole foot: centres in its frame, and radii [m].
        kept: Frames at the beginning whose correction is given.
        leg: (n, 3) the hip as played, and (n,) how far from there the ankle may be [m].
        frames: How many a stance is looked at ahead; in how many a misfit to the source fades; a
            slide; and a correction in the swing.
        limits: How much higher a corner that touches is than the lowest [m]; by how much a
            correction may change a frame on the way to a stance [m]; the same turning [rad]; how
            far a standing foot is held from where it is played [m]; by how much a correction may
            change a frame where the leg would not reach otherwise [m]; and how far the hips may be
            lowered [m].
        shift: (n, 3) in the first `kept` rows, out in the others.
        turn: (n, 3) likewise.
    """
    window, blend, still, ease = frames
    touch, _, quickest, farthest, _, _ = limits
    n = len(contact)
    ways, touching = np.empty((4, 3)), np.empty(4, np.bool_)
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
        window_stop = min(start + window, stop)
        yaw = 0.0
        if not goes_on:
            yaw = _facing(start, window_stop, last, played, source, weight, turn, quickest)
        hurry = max(0.0, 1.0 - (start - last - 1) / ease) if last >= 0 else 0.0
        _stand(
            start, stop, goes_on, hurry, yaw, played, source, jump, bound, sole, balls, blend,
            shift, turn,
        )  # fmt: skip
        _hold(
            start, stop, goes_on, played, source, contact, jump, sole, still, touch, shift, turn,
            ways, touching,
        )  # fmt: skip
        if not goes_on:
            put(start, stop, window_stop, last, weight, played, leg, limits, shift)
        _restrain(start, stop, goes_on, farthest, shift)
        last, start = stop - 1, stop
    last = kept - 1
    for k in range(kept, n + 1):
        if k < n and not known[k]:
            continue
        if k > last + 1:
            _swing(last, k, known, ease, shift)
            _swing(last, k, known, ease, turn)
            for i in range(last + 1, k):
                low = shift[i, 2] + played[0][i, 2] + _lowest(_wanted(played, turn, i), balls)
                shift[i, 2] += max(0.0, bound[i] - low)
        last = k
