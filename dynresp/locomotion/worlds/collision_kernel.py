"""The compiled collision test: does the footprint of a body overlap a box.

Importing this module compiles it (about a second) or loads it from numba's cache; import it where
it is used.

A grid over the world says for each cell how far the nearest box is from its middle, and which
boxes a body that stands in the cell might touch. Far from all boxes one look at the grid is enough.
"""

from __future__ import annotations

import math

from numba import njit, types

from dynresp.compiling import compiled

REALS = types.Array(types.float64, 1, "C", readonly=True)
ROWS = types.Array(types.float64, 2, "C", readonly=True)
CLEARANCE = types.Array(types.float32, 2, "C", readonly=True)
LISTS = types.Array(types.int32, 1, "C", readonly=True)
FOOTPRINTS = types.Array(types.float32, 2, "C", readonly=True)
GRID = (REALS, CLEARANCE, LISTS, LISTS, ROWS)
"""Types of the arrays of a `CollisionGrid`: frame, clearance, starts, members and boxes."""


@njit(inline="always")
def _apart(x, y, cosine, sine, half_x, half_y, box):  # type: ignore[no-untyped-def]
    """Whether a line along a side separates two rectangles (the separating axis theorem)."""
    away_x, away_y = box[0] - x, box[1] - y
    # Cosine and sine of the turn from one to the other.
    c = abs(cosine * box[4] + sine * box[5])
    s = abs(cosine * box[5] - sine * box[4])
    return (
        abs(cosine * away_x + sine * away_y) > half_x + box[2] * c + box[3] * s
        or abs(cosine * away_y - sine * away_x) > half_y + box[2] * s + box[3] * c
        or abs(box[4] * away_x + box[5] * away_y) > box[2] + half_x * c + half_y * s
        or abs(box[4] * away_y - box[5] * away_x) > box[3] + half_x * s + half_y * c
    )


@njit
def collides(  # type: ignore[no-untyped-def]
    x, y, cosine, sine, footprint, margin, frame, clearance, starts, members, boxes
):
    """Whether a footprint, widened by a margin on all sides, overlaps a box or leaves the grid.

    Args:
        x: Of the root [m].
        y: Of the root [m].
        cosine: Of its yaw.
        sine: Of its yaw.
        footprint: (4,) least x, largest x, least y, largest y in the root's facing frame [m].
        margin: [m].
        frame: (3,) x and y of the grid's corner, side of its cells [m].
        clearance: (columns, rows) distance from the middle of each cell to the nearest box [m].
        starts: (columns * rows + 1,) where the boxes near each cell begin in `members`.
        members: (k,) boxes.
        boxes: (n, 6) rows of `World.boxes`.
    """
    column = math.floor((x - frame[0]) / frame[2])
    row = math.floor((y - frame[1]) / frame[2])
    if column < 0 or row < 0 or column >= clearance.shape[0] or row >= clearance.shape[1]:
        return True
    far_x = max(-footprint[0], footprint[1]) + margin
    far_y = max(-footprint[2], footprint[3]) + margin
    if clearance[column, row] - 0.7072 * frame[2] > math.sqrt(far_x * far_x + far_y * far_y):
        return False
    half_x = 0.5 * (footprint[1] - footprint[0]) + margin
    half_y = 0.5 * (footprint[3] - footprint[2]) + margin
    ahead = 0.5 * (footprint[1] + footprint[0])
    aside = 0.5 * (footprint[3] + footprint[2])
    middle_x = x + cosine * ahead - sine * aside
    middle_y = y + sine * ahead + cosine * aside
    cell = column * clearance.shape[1] + row
    for member in range(starts[cell], starts[cell + 1]):
        if not _apart(middle_x, middle_y, cosine, sine, half_x, half_y, boxes[members[member]]):
            return True
    return False


@compiled(types.void(ROWS, FOOTPRINTS, types.float64, *GRID, types.boolean[::1]))
def collisions_kernel(  # type: ignore[no-untyped-def]
    roots, footprints, margin, frame, clearance, starts, members, boxes, out
):
    """Test many footprints.

    Args:
        roots: (n, 3) x, y [m] and yaw [rad].
        footprints: (n, 4); see `collides`, and there the other arguments.
        margin: [m].
        frame: Of the grid.
        clearance: Of its cells.
        starts: Of its lists.
        members: Its lists.
        boxes: Rows of `World.boxes`.
        out: Out, (n,).
    """
    for i in range(len(roots)):
        out[i] = collides(
            roots[i, 0], roots[i, 1], math.cos(roots[i, 2]), math.sin(roots[i, 2]),
            footprints[i], margin, frame, clearance, starts, members, boxes,
        )  # fmt: skip
