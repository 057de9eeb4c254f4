"""The compiled part of `dynresp.motion.feet.skating`.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

_CORNERS = types.Array(types.float64, 3, "C", readonly=True)


@helper
def least_slide(shifts, touching):
    """How the sole's stillest point moves over the ground.

    When a sole turns and shifts, the shift of a point is a linear function of where the point is.
    So the shifts of all points between corners fill the hull of the corners' shifts; this is the
    shortest of them.

    Args:
        shifts: (4, 2) how each corner moves over the ground [m].
        touching: (4,) which corners the foot stands on; at least one.

    Returns:
        The shift x, y of that point [m].
    """
    best, x, y = np.inf, 0.0, 0.0
    for i in range(4):
        for j in range(i, 4):
            if not (touching[i] and touching[j]):
                continue
            ax, ay = shifts[i, 0], shifts[i, 1]
            bx, by = shifts[j, 0] - ax, shifts[j, 1] - ay
            length = bx * bx + by * by
            part = 0.0
            if length > 0.0:
                part = min(max(-(ax * bx + ay * by) / length, 0.0), 1.0)
            px, py = ax + part * bx, ay + part * by
            distance = px * px + py * py
            if distance < best:
                best, x, y = distance, px, py
    for left_out in range(4):
        positive, negative, corners = 0, 0, 0
        for k in range(1, 4):
            i, j = (left_out + k) % 4, (left_out + k % 3 + 1) % 4
            corners += touching[i]
            cross = shifts[i, 0] * shifts[j, 1] - shifts[i, 1] * shifts[j, 0]
            positive += cross > 0.0
            negative += cross < 0.0
        # Some point does not move: the origin is in the triangle of three shifts.
        if corners == 3 and (positive == 3 or negative == 3):
            return 0.0, 0.0
    return x, y


@compiled(types.float64[:](_CORNERS, types.float64), interpreted_first=True)
def slides_kernel(corners, touch):
    """How far a foot slides from each frame to the next.

    Args:
        corners: (frames, 4, 3) where the corners of its sole are [m].
        touch: A corner touches that is at most this much above the lowest [m].

    Returns:
        (frames - 1,) [m].
    """
    slides = np.empty(len(corners) - 1)
    shifts = np.empty((4, 2))
    touching = np.empty(4, np.bool_)
    for k in range(len(slides)):
        lowest = np.inf
        for c in range(4):
            lowest = min(lowest, corners[k, c, 2])
            shifts[c, 0] = corners[k + 1, c, 0] - corners[k, c, 0]
            shifts[c, 1] = corners[k + 1, c, 1] - corners[k, c, 1]
        for c in range(4):
            touching[c] = corners[k, c, 2] <= lowest + touch
        x, y = least_slide(shifts, touching)
        slides[k] = math.sqrt(x * x + y * y)
    return slides
