"""Where on a path an avatar is, and eq. 8 along it, compiled into the searches that use them.

Importing this module imports numba; import it where it is used.

The paper takes a path as goal positions to be traversed one after the other (Lee et al. 2002,
section 5.2). So how much of it is done never becomes less: what lies behind is done, though the
path may come by there again. A path that turns back on itself is nearest twice at every place;
looked at from the first of the two on, and a little ahead, there and back are told apart.
"""

from __future__ import annotations

import math

from dynresp.support.compiling import helper

# Squared distances [m^2] that differ by less are alike: there and back on one line.
_ALIKE = 1e-9


@helper
def nearest_on(path, x, y, progress, window):
    """The nearest point of a path, from what is done of it on; of equal ones the first.

    Args:
        path: (p, 2) points about equally far apart, or one alone [m].
        x: Where the avatar is [m].
        y: The same.
        progress: How much of the path is done [points].
        window: How far beyond that the nearest point is looked for [points].

    Returns:
        How much is done then [points], at least `progress`, and the distance to there [m].
    """
    last = len(path) - 1
    if last == 0:
        return 0.0, math.hypot(x - path[0, 0], y - path[0, 1])
    first = min(int(progress), last - 1)
    least, nearest = math.inf, progress
    for k in range(first, min(first + int(window), last)):
        along_x, along_y = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        away_x, away_y = x - path[k, 0], y - path[k, 1]
        length = along_x * along_x + along_y * along_y
        share = (along_x * away_x + along_y * away_y) / length if length > 0.0 else 1.0
        share = min(max(share, progress - k, 0.0), 1.0)
        off_x, off_y = away_x - share * along_x, away_y - share * along_y
        square = off_x * off_x + off_y * off_y
        if square < least - _ALIKE:
            least, nearest = square, k + share
    return nearest, math.sqrt(least)


@helper
def eq_8(path, x, y, cosine, sine, progress, target, away, ahead, facing, spacing):
    """Eq. 8 with the way left along the path in place of the straight distance [m].

    Args:
        path: (p, 2) points `spacing` apart, or one alone [m].
        x: Where the avatar is [m].
        y: The same.
        cosine: Of the yaw that it faces.
        sine: Of the same.
        progress: How much of the path is done [points].
        target: How much of it is to be done [points].
        away: Distance to the path [m].
        ahead: How far ahead on the path the point is that it should face [m].
        facing: c of eq. 8.
        spacing: [m].
    """
    last = len(path) - 1
    goal = min(progress + ahead / spacing, float(last))
    k = min(int(goal), max(last - 1, 0))
    on = min(k + 1, last)
    to_x = path[k, 0] + (goal - k) * (path[on, 0] - path[k, 0]) - x
    to_y = path[k, 1] + (goal - k) * (path[on, 1] - path[k, 1]) - y
    straight = math.sqrt(to_x * to_x + to_y * to_y)
    left = max(target - progress, 0.0) * spacing + away
    if straight < 1e-9:
        return left
    return left * (1.0 - facing * (to_x * cosine + to_y * sine) / straight)
