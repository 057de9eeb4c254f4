"""Random mazes: a grid of cells between walls, all connected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.worlds.obstacles import Obstacle, World
from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_numbers
from dynresp.support.errors import UsageError

# Thickness and height of the walls [m].
_WALL_M, _HEIGHT_M = 0.12, 2.0


@dataclass(frozen=True)
class MazeConfig:
    """Size and form of a maze.

    Attributes:
        columns: Cells along x.
        rows: Cells along y.
        cell_m: Distance from the middle of a cell to the middle of the next [m].
        loops: Share of the walls that are removed beyond those that connect all cells: 0 makes a
            tree.
        narrow: Share of the passages between cells that are narrowed to a gap.
        gap_m: Width of such a gap [m].

    Raises:
        UsageError: A number is out of range.
    """

    columns: int = 5
    rows: int = 5
    cell_m: float = 1.8
    loops: float = 0.05
    narrow: float = 0.0
    gap_m: float = 0.62

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)
        if min(self.columns, self.rows) < 1 or self.columns * self.rows < 2:
            raise UsageError(f"a maze needs at least two cells, got {self.columns} x {self.rows}")
        if not 0 < self.gap_m < self.cell_m - _WALL_M:
            raise UsageError(
                "gap_m must be above 0 and below cell_m less a wall, "
                f"{self.cell_m - _WALL_M:g}, got {self.gap_m:g}"
            )
        for name in ("loops", "narrow"):
            if not 0 <= getattr(self, name) <= 1:
                raise UsageError(f"{name} must be between 0 and 1, got {getattr(self, name)}")


@dataclass(frozen=True, eq=False)
class Maze:
    """A maze, and the path through it.

    Attributes:
        world: Its walls as boxes.
        solution: (k, 2) middles of the cells of the shortest path from one corner to the opposite
            one [m]; the first is the start, the last the goal.
    """

    world: World
    solution: FloatArray


def random_maze(rng: np.random.Generator, config: MazeConfig | None = None) -> Maze:
    """Make a maze.

    The passages are the edges of a spanning tree of random weights over the grid of cells.

    Args:
        rng: Source of random numbers.
        config: Size and form.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import minimum_spanning_tree, shortest_path

    config = config or MazeConfig()
    cells = np.arange(config.columns * config.rows).reshape(config.columns, config.rows)
    pairs = np.concatenate(
        [
            np.stack([cells[:-1].ravel(), cells[1:].ravel()], axis=1),
            np.stack([cells[:, :-1].ravel(), cells[:, 1:].ravel()], axis=1),
        ]
    )
    size = (cells.size, cells.size)
    weights = 1.0 + rng.random(len(pairs))
    tree = minimum_spanning_tree(csr_array((weights, pairs.T), shape=size)).toarray() > 0
    passages = tree[pairs[:, 0], pairs[:, 1]] | (rng.random(len(pairs)) < config.loops)
    narrow = passages & (rng.random(len(pairs)) < config.narrow)
    edges = csr_array((weights[passages], pairs[passages].T), shape=size)
    _, before = shortest_path(edges, directed=False, indices=0, return_predecessors=True)
    path = [cells.size - 1]
    while path[-1] != 0:
        path.append(int(before[path[-1]]))
    solution = (np.stack(np.divmod(path[::-1], config.rows), axis=1) + 0.5) * config.cell_m
    obstacles = tuple(_walls(pairs, passages, narrow, config))
    bounds = (0.0, 0.0, config.columns * config.cell_m, config.rows * config.cell_m)
    return Maze(World(bounds, obstacles), solution)


def _walls(
    pairs: np.ndarray, passages: np.ndarray, narrow: np.ndarray, config: MazeConfig
) -> list[Obstacle]:
    """A box for each wall between two cells, two for each narrowed passage."""
    out = []
    half_wall, length = 0.5 * _WALL_M, config.cell_m + _WALL_M
    for (first, second), is_open, is_narrow in zip(pairs, passages, narrow, strict=True):
        column, row = divmod(int(first), config.rows)
        along_y = second - first == config.rows
        corner = np.array([column + 1, row] if along_y else [column, row + 1]) * config.cell_m
        # A wall begins at this corner of the grid and is one cell long. It is longer by half its
        # thickness at both ends, so that walls that meet close the corner.
        stretches = [] if is_open else [(-half_wall, length - half_wall)]
        if is_narrow:
            stub = 0.5 * (config.cell_m - config.gap_m)
            stretches = [(-half_wall, stub), (config.cell_m - stub, length - half_wall)]
        for start, stop in stretches:
            middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
            if along_y:
                out.append(
                    Obstacle((corner[0], corner[1] + middle), (half_wall, half), height=_HEIGHT_M)
                )
            else:
                out.append(
                    Obstacle((corner[0] + middle, corner[1]), (half, half_wall), height=_HEIGHT_M)
                )
    return out
