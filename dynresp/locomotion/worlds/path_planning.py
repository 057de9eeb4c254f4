"""Paths over the ground that keep away from boxes: planned to a goal, or fitted to a sketch."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.paths import as_point, resampled
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IndexArray, sparse_graph
from dynresp.support.errors import DynrespError, UsageError

# Side of the cells of the grid, and about the distance between the points of a path [m].
_CELL_M = 0.1
# Smallest distance from a box [m]: half the width that a body needs. From the second distance on
# [m] it costs nothing; a metre at the first counts as 1 + _NEAR_COST metres.
_NARROW_M, _COMFORT_M, _NEAR_COST = 0.2, 0.5, 3.0
# A metre at a distance d from a sketch counts as 1 + _PULL d^2 metres [1/m^2].
_PULL = 8.0
# Largest distance from a sketch of a path around obstacles [m]; if there is no path, the next
# search goes four times as far.
_REACH_M = 1.0
# Steps to half of the eight neighbours of a cell; the other half are the same steps back.
_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))
# How often a path is smoothed: over about half a metre if planned, a quarter of a metre if it must
# stay near a sketch.
_SMOOTHINGS_PLANNED, _SMOOTHINGS_FITTED = 60, 15
# Most states of a search around a sketch, each of about 1 kB: those within 1 m of 2.5 km, or within
# 4 m of 160 m.
_MAX_STATES = 4_000_000
# Most cells times discs: every disc is compared with every cell.
_MAX_DISC_CELLS = 500_000_000


class _Grid:
    """The middles of square cells over a world, and what a metre costs there."""

    def __init__(self, world: World, blocked: FloatArray) -> None:
        self.low = np.array(world.bounds[:2])
        self.shape = world.grid_shape(_CELL_M)
        if self.cells * len(blocked) > _MAX_DISC_CELLS:
            raise UsageError(
                f"{len(blocked)} discs in {self.cells} cells are too many: their product may be "
                f"at most {_MAX_DISC_CELLS}; put obstacles into the world instead"
            )
        self.boxes = CollisionGrid.of(world, _COMFORT_M, _CELL_M)
        self.blocked = blocked
        index = np.stack(np.unravel_index(np.arange(self.cells), self.shape), axis=1)
        self.middles = self.low + _CELL_M * (index + 0.5)
        self.clearance = self.clearance_at(self.middles)
        near = np.clip((_COMFORT_M - self.clearance) / (_COMFORT_M - _NARROW_M), 0.0, 1.0)
        self.weights = 1.0 + _NEAR_COST * near
        self.free = self.clearance >= _NARROW_M

    @property
    def cells(self) -> int:
        return int(np.prod(self.shape))

    def clearance_at(self, points: FloatArray) -> FloatArray:
        """Distance of points (n, 2) to boxes and to blocked discs (rows x, y, radius).

        At most `_COMFORT_M`.
        """
        out = self.boxes.distances(points)
        for x, y, radius in self.blocked:
            np.minimum(out, np.hypot(points[:, 0] - x, points[:, 1] - y) - radius, out=out)
        return out

    def nearest_free(self, point: FloatArray, what: str) -> int:
        """The free cell nearest to a point.

        Raises:
            DynrespError: No cell is free within two metres.
        """
        away = np.hypot(*(self.middles - point).T)
        away[~self.free] = np.inf
        cell = int(np.argmin(away))
        if not away[cell] < 2.0:
            raise DynrespError(
                f"the {what} ({point[0]:.2f}, {point[1]:.2f}) is not within 2 m of ground that is "
                f"{_NARROW_M:g} m away from all obstacles; choose another"
            )
        return cell

    def edges(self) -> tuple[IndexArray, IndexArray, FloatArray]:
        """Pairs of neighbouring free cells, each in one direction, and what a step costs."""
        index = np.arange(self.cells).reshape(self.shape)
        starts, stops, costs = [], [], []
        for dx, dy in _STEPS:
            a = index[: self.shape[0] - dx, max(0, -dy) : self.shape[1] - max(0, dy)].ravel()
            b = index[dx:, max(0, dy) : self.shape[1] + min(0, dy)].ravel()
            both = self.free[a] & self.free[b]
            a, b = a[both], b[both]
            starts.append(a)
            stops.append(b)
            length = _CELL_M * np.hypot(dx, dy)
            costs.append(0.5 * length * (self.weights[a] + self.weights[b]))
        return np.concatenate(starts), np.concatenate(stops), np.concatenate(costs)


def plan_path(
    world: World,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    blocked: npt.ArrayLike = (),
) -> FloatArray:
    """A short path with clearance, by Dijkstra's algorithm on a grid, then smoothed.

    Args:
        world: The boxes.
        start: (2,) where it begins [m].
        goal: (2,) where it ends [m].
        blocked: (n, 3) discs to keep out of: x, y and radius [m].

    Returns:
        (k, 2) points at distances of about 0.1 m, from the free point nearest to the start to that
        nearest to the goal.

    Raises:
        UsageError: The world has too many cells.
        DynrespError: There is no path, or no free ground near the start or the goal.
    """
    from scipy.sparse.csgraph import dijkstra

    ends = np.stack([as_point(start, "a start"), as_point(goal, "a goal")])
    grid = _Grid(world, np.asarray(blocked, dtype=np.float64).reshape(-1, 3))
    first, last = grid.nearest_free(ends[0], "start"), grid.nearest_free(ends[1], "goal")
    a, b, costs = grid.edges()
    edges = sparse_graph(costs, a, b, grid.cells)
    _, before = dijkstra(edges, directed=False, indices=[first], return_predecessors=True)
    if first != last and before[0, last] < 0:
        raise DynrespError(
            f"there is no path from ({ends[0, 0]:.2f}, {ends[0, 1]:.2f}) to "
            f"({ends[1, 0]:.2f}, {ends[1, 1]:.2f}) that "
            f"keeps {_NARROW_M:g} m away from all obstacles; choose another goal"
        )
    path = grid.middles[_trace(before[0], last)]
    return _smooth(grid, _with_ends(grid, path, ends), _SMOOTHINGS_PLANNED)


def fit_path(
    world: World,
    sketch: npt.ArrayLike,
    blocked: npt.ArrayLike = (),
) -> FloatArray:
    """The path with clearance nearest to a sketch, which may touch or cut obstacles.

    It is the shortest path in the product of the grid and the sketch: a state is a cell and the
    progress along the sketch. So the path follows the sketch from one end to the other, loops
    included, and takes no short cut to a part of it behind a wall.

    Args:
        world: The boxes.
        sketch: (k, 2) points from start to goal [m].
        blocked: (n, 3) discs to keep out of: x, y and radius [m].

    Returns:
        (k, 2) as of `plan_path`. If obstacles are too large to go around within 4 m of the sketch,
        the path is planned from the sketch's start to its end.

    Raises:
        UsageError: The world has too many cells, or the sketch is so long that too many cells are
            within 1 m of it, or, if obstacles cut it off, within 4 m.
        DynrespError: There is no path, or no free ground near the start or the goal.
    """
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import cKDTree

    discs = np.asarray(blocked, dtype=np.float64).reshape(-1, 3)
    grid = _Grid(world, discs)
    points = resampled(sketch, 2.0 * _CELL_M)
    first, last = grid.nearest_free(points[0], "start"), grid.nearest_free(points[-1], "goal")
    a, b, costs = grid.edges()
    free = np.flatnonzero(grid.free)
    tree = cKDTree(grid.middles[free])
    for reach in (_REACH_M, 4.0 * _REACH_M):
        states = int(np.sum(tree.query_ball_point(points, reach, return_length=True)))
        if states > _MAX_STATES:
            length = np.hypot(*np.diff(points, axis=0).T).sum()
            raise UsageError(
                f"a sketch {length:.1f} m long is too long to search {reach:g} m around it "
                f"in cells of {_CELL_M:g} m; cut it, or draw it around the obstacles"
            )
        inside = [free[tree.query_ball_point(point, reach)] for point in points]
        keys, away = _near(grid, points, inside, first, last)
        layer, cell = np.divmod(keys, grid.cells)
        # Steps along the grid within a layer.
        count = np.bincount(cell, minlength=grid.cells)
        rows, columns, weights = [], [], []
        order = np.argsort(cell, kind="stable")
        offsets = np.concatenate([[0], np.cumsum(count)])
        repeats = count[a]
        edge = np.repeat(np.arange(len(a)), repeats)
        within = np.arange(len(edge)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        source = order[offsets[a[edge]] + within]
        target_key = layer[source] * grid.cells + b[edge]
        target = np.searchsorted(keys, target_key)
        found = (target < len(keys)) & (keys[np.minimum(target, len(keys) - 1)] == target_key)
        edge, source, target = edge[found], source[found], target[found]
        pulled = 1.0 + 0.5 * _PULL * (away[source] ** 2 + away[target] ** 2)
        for one, other in ((source, target), (target, source)):
            rows.append(one)
            columns.append(other)
            weights.append(costs[edge] * pulled)
        # To the next point of the sketch, in the same cell.
        next_key = keys + grid.cells
        target = np.searchsorted(keys, next_key)
        found = (target < len(keys)) & (keys[np.minimum(target, len(keys) - 1)] == next_key)
        source, target = np.flatnonzero(found), target[found]
        rows.append(source)
        columns.append(target)
        weights.append(2.0 * _CELL_M * (1e-3 + _PULL * away[target] ** 2))
        edges = sparse_graph(
            np.concatenate(weights), np.concatenate(rows), np.concatenate(columns), len(keys)
        )
        begin = int(np.searchsorted(keys, first))
        end = int(np.searchsorted(keys, (len(points) - 1) * grid.cells + last))
        _, before = dijkstra(edges, indices=[begin], return_predecessors=True)
        if before[0, end] >= 0:
            path = grid.middles[cell[_trace(before[0], end)]]
            return _smooth(grid, _with_ends(grid, path, points[[0, -1]]), _SMOOTHINGS_FITTED)
    return plan_path(world, points[0], points[-1], discs)


def _near(
    grid: _Grid, points: FloatArray, inside: list[IndexArray], first: int, last: int
) -> tuple[IndexArray, FloatArray]:
    """States around a sketch: layer * cells + cell, ascending; distances to its points.

    Args:
        grid: The cells.
        points: (k, 2) points of the sketch.
        inside: For each point the cells within reach.
        first: The cell of the start, included wherever it is.
        last: The cell of the goal.
    """
    inside = [*inside]
    inside[0] = np.append(inside[0], first)
    inside[-1] = np.append(inside[-1], last)
    keys = np.unique(np.concatenate([k * grid.cells + np.asarray(c) for k, c in enumerate(inside)]))
    layer, cell = np.divmod(keys.astype(np.intp), grid.cells)
    return keys.astype(np.intp), np.hypot(*(grid.middles[cell] - points[layer]).T)


def _trace(before: npt.NDArray[np.int32], last: int) -> list[int]:
    """The nodes from the source of a tree of shortest paths to a node."""
    path = [last]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _with_ends(grid: _Grid, path: FloatArray, ends: FloatArray) -> FloatArray:
    """The path with its ends moved to the wanted ends (2, 2), if they are on free ground."""
    path = path.copy() if len(path) > 1 else np.repeat(path, 2, axis=0)
    free = grid.clearance_at(ends) >= _NARROW_M
    for where, end, is_free in zip((0, -1), ends, free, strict=True):
        if is_free:
            path[where] = end
    return path


def _smooth(grid: _Grid, path: FloatArray, times: int) -> FloatArray:
    """Move points to the middle between their neighbours where that keeps the clearance."""
    path = resampled(path, _CELL_M)
    clearance = grid.clearance_at(path)
    for _ in range(times):
        moved = path.copy()
        moved[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        there = grid.clearance_at(moved)
        keeps = there >= np.minimum(clearance, _COMFORT_M) - 1e-9
        path = np.where(keeps[:, None], moved, path)
        clearance = np.where(keeps, there, clearance)
    return resampled(path, _CELL_M)
