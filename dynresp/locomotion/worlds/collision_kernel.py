"""The compiled collision test: whether the footprint of a body overlaps a box.

Importing this module imports numba; import it where it is used.

A grid over the world has for each cell the distance from its middle to the nearest box, and a list
of the boxes that a body in the cell might touch. Far from all boxes the distance alone decides.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

REALS = types.Array(types.float64, 1, "C", readonly=True)
ROWS = types.Array(types.float64, 2, "C", readonly=True)
CLEARANCE = types.Array(types.float32, 2, "C", readonly=True)
WINDOWS = types.Array(types.int64, 2, "C", readonly=True)
LISTS = types.Array(types.int32, 1, "C", readonly=True)
FOOTPRINTS = types.Array(types.float32, 2, "C", readonly=True)


class Grid(NamedTuple):
    """The arrays of a `CollisionGrid`.

    Attributes:
        frame: (3,) x and y of the grid's corner, side of its cells [m].
        clearance: (columns, rows) distance from the middle of each cell to the nearest box, where
            that is within reach [m].
        starts: (columns * rows + 1,) where the boxes near each cell begin in `members`.
        members: (k,) boxes.
        boxes: (n, 6) rows of `World.boxes`.
    """

    frame: Any
    clearance: Any
    starts: Any
    members: Any
    boxes: Any


GRID = types.BaseTuple.from_types((REALS, CLEARANCE, LISTS, LISTS, ROWS), Grid)
"""Type of a `Grid`."""


@helper(inline="always")
def _is_separate(x, y, cosine, sine, half_x, half_y, box):
    """Whether a line along a side separates two rectangles (the separating axis theorem)."""
    away_x, away_y = box[0] - x, box[1] - y
    # Cosine and sine of the angle between them.
    c = abs(cosine * box[4] + sine * box[5])
    s = abs(cosine * box[5] - sine * box[4])
    return (
        abs(cosine * away_x + sine * away_y) > half_x + box[2] * c + box[3] * s
        or abs(cosine * away_y - sine * away_x) > half_y + box[2] * s + box[3] * c
        or abs(box[4] * away_x + box[5] * away_y) > box[2] + half_x * c + half_y * s
        or abs(box[4] * away_y - box[5] * away_x) > box[3] + half_x * s + half_y * c
    )


@helper
def collides(x, y, cosine, sine, footprint, margin, grid):
    """Whether a footprint, widened by a margin on all sides, overlaps a box or leaves the grid.

    Args:
        x: Of the root [m].
        y: Of the root [m].
        cosine: Of its yaw.
        sine: Of its yaw.
        footprint: (4,) least x, largest x, least y, largest y in the root's facing frame [m].
        margin: [m].
        grid: `Grid`.
    """
    frame, clearance = grid.frame, grid.clearance
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
    for member in range(grid.starts[cell], grid.starts[cell + 1]):
        box = grid.boxes[grid.members[member]]
        if not _is_separate(middle_x, middle_y, cosine, sine, half_x, half_y, box):
            return True
    return False


@helper(inline="always")
def _distance(x, y, box):
    """Distance of a point to a box [m], negative inside."""
    x, y = x - box[0], y - box[1]
    beyond_x = abs(box[4] * x + box[5] * y) - box[2]
    beyond_y = abs(box[4] * y - box[5] * x) - box[3]
    out_x, out_y = max(beyond_x, 0.0), max(beyond_y, 0.0)
    return math.sqrt(out_x * out_x + out_y * out_y) + min(max(beyond_x, beyond_y), 0.0)


@compiled(
    types.void(ROWS, WINDOWS, REALS, types.float64, types.float32[:, ::1], types.int64[::1])
)  # fmt: skip
def count_kernel(boxes, windows, frame, near, clearance, counts):
    """Count the boxes near each cell of a grid, and find the distance of the nearest one.

    Args:
        boxes: (n, 6) rows of `World.boxes`.
        windows: (n, 4) first and last column, first and last row of cells that may be near.
        frame: (3,) x and y of the grid's corner, side of its cells [m].
        near: Largest distance from the middle of a cell at which a box is near it [m].
        clearance: In and out, (columns, rows) the least distance [m].
        counts: Out, (columns * rows,), zeros before.
    """
    for box in range(len(boxes)):
        for column in range(windows[box, 0], windows[box, 1] + 1):
            x = frame[0] + frame[2] * (column + 0.5)
            for row in range(windows[box, 2], windows[box, 3] + 1):
                away = _distance(x, frame[1] + frame[2] * (row + 0.5), boxes[box])
                if away <= near:
                    counts[column * clearance.shape[1] + row] += 1
                    clearance[column, row] = min(clearance[column, row], np.float32(away))


@compiled(
    types.void(ROWS, WINDOWS, REALS, types.float64, types.int64, types.int64[::1], types.int32[::1])
)  # fmt: skip
def list_kernel(boxes, windows, frame, near, rows, free, members):
    """List the boxes near each cell of a grid, in ascending order.

    Args:
        boxes: See `count_kernel`.
        windows: The same.
        frame: The same.
        near: The same.
        rows: Of cells.
        free: (columns * rows,) in: where the list of each cell begins; out: where it ends.
        members: Out, (k,) the lists.
    """
    for box in range(len(boxes)):
        for column in range(windows[box, 0], windows[box, 1] + 1):
            x = frame[0] + frame[2] * (column + 0.5)
            for row in range(windows[box, 2], windows[box, 3] + 1):
                if _distance(x, frame[1] + frame[2] * (row + 0.5), boxes[box]) <= near:
                    cell = column * rows + row
                    members[free[cell]] = box
                    free[cell] += 1


@compiled(types.void(ROWS, types.float64, GRID, types.float64[::1]))
def distances_kernel(points, max_distance, grid, out):
    """Measure the distance of points to the nearest box.

    Args:
        points: (n, 2) [m].
        max_distance: Larger distances become this [m].
        grid: `Grid`.
        out: Out, (n,) [m], negative inside.
    """
    frame, clearance, boxes = grid.frame, grid.clearance, grid.boxes
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        column = math.floor((x - frame[0]) / frame[2])
        row = math.floor((y - frame[1]) / frame[2])
        nearest = max_distance
        if column < 0 or row < 0 or column >= clearance.shape[0] or row >= clearance.shape[1]:
            for box in range(len(boxes)):
                nearest = min(nearest, _distance(x, y, boxes[box]))
        else:
            cell = column * clearance.shape[1] + row
            for member in range(grid.starts[cell], grid.starts[cell + 1]):
                nearest = min(nearest, _distance(x, y, boxes[grid.members[member]]))
        out[i] = nearest


@compiled(types.void(ROWS, FOOTPRINTS, types.float64, GRID, types.boolean[::1]))
def collisions_kernel(roots, footprints, margin, grid, out):
    """Test many footprints.

    Args:
        roots: (n, 3) x, y [m] and yaw [rad].
        footprints: (n, 4); see `collides`.
        margin: [m].
        grid: `Grid`.
        out: Out, (n,).
    """
    for i in range(len(roots)):
        out[i] = collides(
            roots[i, 0], roots[i, 1], math.cos(roots[i, 2]), math.sin(roots[i, 2]),
            footprints[i], margin, grid,
        )  # fmt: skip
