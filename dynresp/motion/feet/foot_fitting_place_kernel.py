"""Where a stance is put, and what the compiled part of foot fitting takes and returns.

All numbers are in metres, radians and frames; orientations are quaternions w x y z; all is in the
world unless said otherwise.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from dynresp.support.compiling import helper

# A position within reach is searched in so many steps, and to within so much [m].
_STEPS = 64
_NEAR = 1e-4


class Track(NamedTuple):
    """One foot, frame by frame: ankle positions (n, 3) and foot orientations (n, 4)."""

    ankles: Any
    feet: Any


class FootDemands(NamedTuple):
    """What is demanded of one foot, frame by frame.

    Attributes:
        contact: (n,) whether it stands.
        jump: (n,) whether the source changes from the frame before to this one.
        weight: (n,) how much a frame counts for where a stance is put; above 0.
        bound: (n,) how low the foot may reach [m].
    """

    contact: Any
    jump: Any
    weight: Any
    bound: Any


class FootShape(NamedTuple):
    """The shape of a foot, in its own frame.

    Attributes:
        sole: (4, 4) the sole's corners [m], and a radius of 0 for each.
        balls: (b, 4) balls whose hull holds the foot: centres, and radii [m].
    """

    sole: Any
    balls: Any


class Leg(NamedTuple):
    """A leg, frame by frame: the hip as played (n, 3), and how far the ankle may be away (n,)."""

    hips: Any
    reach: Any


class FitTimes(NamedTuple):
    """Lengths in frames.

    Attributes:
        stance: So much of a stance counts for where it is put.
        blend: A misfit to the source fades in this.
        still: A foot comes to rest in this that slides in the given frames.
        ease: A correction fades in this in a swing, at most.
    """

    stance: int
    blend: int
    still: int
    ease: int


class FitLimits(NamedTuple):
    """Bounds of the corrections.

    Attributes:
        touch: A corner of the sole touches that is at most this much above the lowest [m].
        shift: By this a correction may change a frame on the way to a stance [m].
        turn: The same for its turn [rad].
        hold_distance: A standing foot is held at most this far from where it is played [m].
        hurried_shift: By this a correction may change a frame where the leg would not reach the
            stance otherwise [m].
        root_drop: How far the hips may be lowered [m].
    """

    touch: float
    shift: float
    turn: float
    hold_distance: float
    hurried_shift: float
    root_drop: float


class Correction(NamedTuple):
    """What takes a played foot to where it is to be.

    Attributes:
        shift: (n, 3) of the ankle [m].
        turn: (n, 3) of the foot, a rotation vector [rad].
    """

    shift: Any
    turn: Any


@helper
def into_discs(x, y, discs):
    """Move a point into discs, or to where it is least far outside if they share no point.

    The point moves towards the centre of the disc that it is farthest outside of, again and again,
    in ever smaller steps.

    Args:
        x: Where it is [m].
        y: Where it is [m].
        discs: (m, 3) centres, and radii [m].

    Returns:
        Where it then is, x and y, and whether that is in all discs to within 0.1 mm.
    """
    for step in range(_STEPS):
        out, farthest = _NEAR, -1
        for k in range(len(discs)):
            away = np.hypot(x - discs[k, 0], y - discs[k, 1]) - discs[k, 2]
            if away > out:
                out, farthest = away, k
        if farthest < 0:
            return x, y, True
        to_x, to_y = discs[farthest, 0] - x, discs[farthest, 1] - y
        part = out / max(np.hypot(to_x, to_y), 1e-12) * 4.0 / max(step, 4)
        x, y = x + min(part, 1.0) * to_x, y + min(part, 1.0) * to_y
    return x, y, False


@helper
def _discs(start, stop, played, shift, leg, drop, max_distance, discs):
    """Write discs (2 (stop - start), 3) in which a stance may be put: the leg then reaches it.

    Every second disc keeps the foot near where it is played.
    """
    for k in range(start, stop):
        at = 2 * (k - start)
        discs[at, 0] = discs[at + 1, 0] = -shift[k, 0]
        discs[at, 1] = discs[at + 1, 1] = -shift[k, 1]
        discs[at, 0] += leg.hips[k, 0] - played.ankles[k, 0]
        discs[at, 1] += leg.hips[k, 1] - played.ankles[k, 1]
        down = max(leg.hips[k, 2] - drop - played.ankles[k, 2] - shift[k, 2], 0.0)
        discs[at, 2] = math.sqrt(max(leg.reach[k] * leg.reach[k] - down * down, 0.0))
        discs[at + 1, 2] = max_distance


@helper
def _near(x, y, start, last, most, shift):
    """A point moved so near to the last stance that a correction changes by `most` a frame."""
    if last < 0:
        return x, y
    off_x, off_y = x - shift[last, 0], y - shift[last, 1]
    part = min(1.0, most * (start - last) / max(np.hypot(off_x, off_y), 1e-12))
    return shift[last, 0] + part * off_x, shift[last, 1] + part * off_y


@helper
def put(start, stop, window_stop, last, weight, played, leg, limits, shift):
    """Shift a stance that begins to where it differs least from what is played, within reach.

    Within reach of the leg as it is played if that is possible; else of one whose hip is lowered.

    Args:
        start: Its first frame.
        stop: One past its last.
        window_stop: One past the last that counts for where it is put.
        last: The last frame before it whose correction is known, or -1.
        weight: See `FootDemands`.
        played: The `Track` as played.
        leg: The `Leg`.
        limits: `FitLimits`.
        shift: (n, 3) in and out; 0 along the ground in the stance's first frame.
    """
    total = mean_x = mean_y = 0.0
    for k in range(start, window_stop):
        total += weight[k]
        mean_x += weight[k] * shift[k, 0]
        mean_y += weight[k] * shift[k, 1]
    # The first shift is 0 so far.
    x, y = _near(-mean_x / total, -mean_y / total, start, last, limits.shift, shift)
    discs = np.empty((2 * (window_stop - start), 3))
    for drop in (0.0, limits.root_drop):
        _discs(start, window_stop, played, shift, leg, drop, limits.hold_distance, discs)
        x, y, reached = into_discs(x, y, discs)
        if reached:
            break
    x, y = _near(x, y, start, last, limits.hurried_shift, shift)
    for k in range(start, stop):
        shift[k, 0] += x
        shift[k, 1] += y
