"""Progress of an avatar along a path, and eq. 8 along it, compiled into the searches.

Importing this module imports numba; import it where it is used.

In the paper a path is a row of goals that the avatar reaches one after the other (Lee et al. 2002,
section 5.2). So progress never decreases, though the path may return to a point. Where a path goes
back along itself, two of its points are nearest. The search for the nearest point starts at the
progress so far and ends a little ahead, which separates the two.
"""

from __future__ import annotations

import math

from dynresp.support.compiling import helper

# Squared distances [m^2] that differ by less are equal: a path that goes back along one line.
_EQUAL = 1e-9


@helper
def nearest_on(path, x, y, progress, window):
    """Find the nearest point of a path from the progress on; of equal ones the first.

    Args:
        path: (p, 2) points at about equal distances, or a single one [m].
        x: Position of the avatar [m].
        y: The same.
        progress: Progress along the path so far [points].
        window: How far beyond that to search [points].

    Returns:
        The new progress [points], at least `progress`, and the distance to that point [m].
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
        if square < least - _EQUAL:
            least, nearest = square, k + share
    return nearest, math.sqrt(least)


@helper
def eq_8(path, x, y, cosine, sine, progress, target, away, ahead, facing, spacing):
    """Eq. 8 with the remaining length of the path in place of the straight distance [m].

    Args:
        path: (p, 2) points `spacing` apart, or a single one [m].
        x: Position of the avatar [m].
        y: The same.
        cosine: Cosine of its yaw.
        sine: Sine of its yaw.
        progress: Progress along the path [points].
        target: Progress at the goal [points].
        away: Distance to the path [m].
        ahead: Distance along the path to the point that it should face [m].
        facing: c of eq. 8.
        spacing: Distance of the points [m].
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
