"""Paths over the ground that keep away from boxes: planned to a goal, or fitted to a sketch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.paths import as_point, resampled
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IndexArray
from dynresp.support.checks import check_numbers
from dynresp.support.errors import DynrespError, UsageError

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


@dataclass(frozen=True)
class PlanningConfig:
    """What a good path is.

    Attributes:
        resolution_m: Side of the cells of the grid, and about the distance between the points of
            the path [m].
        narrow_m: Smallest distance from a box [m]: half the width that a body needs.
        comfort_m: From this distance from a box on, distance costs nothing [m].
        dislike: A metre at `narrow_m` from a box counts as 1 + dislike metres.
        pull: A metre at a distance d from the sketch counts as 1 + pull d^2 metres [1/m^2].
        reach_m: Largest distance from a sketch of a path around obstacles [m]; four times as much
            if there is none.

    Raises:
        UsageError: A number is out of range.
    """

    resolution_m: float = 0.1
    narrow_m: float = 0.2
    comfort_m: float = 0.5
    dislike: float = 3.0
    pull: float = 8.0
    reach_m: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)
        if not (0 < self.resolution_m <= self.reach_m and 0 < self.narrow_m < self.comfort_m):
            raise UsageError(
                "a plan needs 0 < resolution_m <= reach_m and 0 < narrow_m < comfort_m, got "
                f"{self.resolution_m}, {self.reach_m}, {self.narrow_m}, {self.comfort_m}"
            )
        if not (self.dislike >= 0 and self.pull >= 0):
            raise UsageError(f"dislike and pull must be 0 or more, got {self.dislike}, {self.pull}")


class _Grid:
    """The middles of square cells over a world, and what a metre costs there."""

    def __init__(self, world: World, config: PlanningConfig, blocked: FloatArray) -> None:
        self.config = config
        self.low = np.array(world.bounds[:2])
        self.shape = world.grid_shape(config.resolution_m)
        if self.cells * len(blocked) > _MAX_DISC_CELLS:
            raise UsageError(
                f"{len(blocked)} discs in {self.cells} cells are too many: their product may be "
                f"at most {_MAX_DISC_CELLS}; put obstacles into the world instead"
            )
        self.boxes = CollisionGrid.of(world, config.comfort_m, config.resolution_m)
        self.blocked = blocked
        index = np.stack(np.unravel_index(np.arange(self.cells), self.shape), axis=1)
        self.middles = self.low + config.resolution_m * (index + 0.5)
        self.clearance = self.clearance_at(self.middles)
        near = np.clip(
            (config.comfort_m - self.clearance) / (config.comfort_m - config.narrow_m), 0.0, 1.0
        )
        self.weights = 1.0 + config.dislike * near
        self.free = self.clearance >= config.narrow_m

    @property
    def cells(self) -> int:
        return int(np.prod(self.shape))

    def clearance_at(self, points: FloatArray) -> FloatArray:
        """Distance of points (n, 2) to boxes and to blocked discs (rows x, y, radius).

        At most `comfort_m`.
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
                f"{self.config.narrow_m:g} m away from all obstacles; choose another"
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
            length = self.config.resolution_m * np.hypot(dx, dy)
            costs.append(0.5 * length * (self.weights[a] + self.weights[b]))
        return np.concatenate(starts), np.concatenate(stops), np.concatenate(costs)


def plan_path(
    world: World,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    config: PlanningConfig | None = None,
    blocked: npt.ArrayLike = (),
) -> FloatArray:
    """A short path with clearance, by Dijkstra's algorithm on a grid, then smoothed.

    Args:
        world: The boxes.
        start: (2,) where it begins [m].
        goal: (2,) where it ends [m].
        config: What a good path is.
        blocked: (n, 3) discs to keep out of: x, y and radius [m].

    Returns:
        (k, 2) points about `resolution_m` apart, from the free point nearest to the start to that
        nearest to the goal.

    Raises:
        UsageError: The world has too many cells of `resolution_m`.
        DynrespError: There is no way, or no free ground near the start or the goal.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    config = config or PlanningConfig()
    ends = np.stack([as_point(start, "a start"), as_point(goal, "a goal")])
    grid = _Grid(world, config, np.asarray(blocked, dtype=np.float64).reshape(-1, 3))
    first, last = grid.nearest_free(ends[0], "start"), grid.nearest_free(ends[1], "goal")
    a, b, costs = grid.edges()
    ways = csr_array((costs, (a, b)), shape=(grid.cells, grid.cells))
    _, before = dijkstra(ways, directed=False, indices=[first], return_predecessors=True)
    if first != last and before[0, last] < 0:
        raise DynrespError(
            f"there is no way from ({ends[0, 0]:.2f}, {ends[0, 1]:.2f}) to "
            f"({ends[1, 0]:.2f}, {ends[1, 1]:.2f}) that "
            f"keeps {config.narrow_m:g} m away from all obstacles; choose another goal, or a "
            "smaller narrow_m"
        )
    path = grid.middles[_trace(before[0], last)]
    return _smooth(grid, _with_ends(grid, path, ends), _SMOOTHINGS_PLANNED)


def fit_path(
    world: World,
    sketch: npt.ArrayLike,
    config: PlanningConfig | None = None,
    blocked: npt.ArrayLike = (),
) -> FloatArray:
    """The path with clearance nearest to a sketch, which may touch or cut obstacles.

    The shortest path in the product of the grid and the sketch: a state is a cell and how much of
    the sketch is done. So the sketch is followed from one end to the other, loops included, and a
    part of it behind a wall is no short cut.

    Args:
        world: The boxes.
        sketch: (k, 2) points from start to goal [m].
        config: What a good path is.
        blocked: (n, 3) discs to keep out of: x, y and radius [m].

    Returns:
        (k, 2) as of `plan_path`. If obstacles are too large to go around within four times
        `reach_m`, the path is planned from the sketch's start to its end.

    Raises:
        UsageError: The world has too many cells of `resolution_m`, or the sketch is so long that
            too many cells are within `reach_m` of it, or, if obstacles cut it off, within four
            times that.
        DynrespError: There is no way, or no free ground near the start or the goal.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import cKDTree

    config = config or PlanningConfig()
    discs = np.asarray(blocked, dtype=np.float64).reshape(-1, 3)
    grid = _Grid(world, config, discs)
    points = resampled(sketch, 2.0 * config.resolution_m)
    first, last = grid.nearest_free(points[0], "start"), grid.nearest_free(points[-1], "goal")
    a, b, costs = grid.edges()
    free = np.flatnonzero(grid.free)
    tree = cKDTree(grid.middles[free])
    for reach in (config.reach_m, 4.0 * config.reach_m):
        states = int(np.sum(tree.query_ball_point(points, reach, return_length=True)))
        if states > _MAX_STATES:
            length = np.hypot(*np.diff(points, axis=0).T).sum()
            raise UsageError(
                f"a sketch {length:.1f} m long is too long to search {reach:g} m around it "
                f"in cells of {config.resolution_m:g} m; cut it, draw it around the obstacles, or "
                "choose a smaller reach_m or a larger resolution_m"
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
        way = np.repeat(np.arange(len(a)), repeats)
        within = np.arange(len(way)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        source = order[offsets[a[way]] + within]
        target_key = layer[source] * grid.cells + b[way]
        target = np.searchsorted(keys, target_key)
        found = (target < len(keys)) & (keys[np.minimum(target, len(keys) - 1)] == target_key)
        way, source, target = way[found], source[found], target[found]
        pulled = 1.0 + 0.5 * config.pull * (away[source] ** 2 + away[target] ** 2)
        for one, other in ((source, target), (target, source)):
            rows.append(one)
            columns.append(other)
            weights.append(costs[way] * pulled)
        # To the next point of the sketch, in the same cell.
        next_key = keys + grid.cells
        target = np.searchsorted(keys, next_key)
        found = (target < len(keys)) & (keys[np.minimum(target, len(keys) - 1)] == next_key)
        source, target = np.flatnonzero(found), target[found]
        rows.append(source)
        columns.append(target)
        weights.append(2.0 * config.resolution_m * (1e-3 + config.pull * away[target] ** 2))
        size = (len(keys), len(keys))
        ways = csr_array(
            (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=size
        )
        begin = int(np.searchsorted(keys, first))
        end = int(np.searchsorted(keys, (len(points) - 1) * grid.cells + last))
        _, before = dijkstra(ways, indices=[begin], return_predecessors=True)
        if before[0, end] >= 0:
            path = grid.middles[cell[_trace(before[0], end)]]
            return _smooth(grid, _with_ends(grid, path, points[[0, -1]]), _SMOOTHINGS_FITTED)
    return plan_path(world, points[0], points[-1], config, discs)


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
    free = grid.clearance_at(ends) >= grid.config.narrow_m
    for where, end, is_free in zip((0, -1), ends, free, strict=True):
        if is_free:
            path[where] = end
    return path


def _smooth(grid: _Grid, path: FloatArray, times: int) -> FloatArray:
    """Move points to the middle between their neighbours where that keeps the clearance."""
    path = resampled(path, grid.config.resolution_m)
    clearance = grid.clearance_at(path)
    for _ in range(times):
        moved = path.copy()
        moved[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        there = grid.clearance_at(moved)
        keeps = there >= np.minimum(clearance, grid.config.comfort_m) - 1e-9
        path = np.where(keeps[:, None], moved, path)
        clearance = np.where(keeps, there, clearance)
    return resampled(path, grid.config.resolution_m)
