"""Random mazes: a grid of cells between walls, all connected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.worlds.obstacles import Obstacle, World
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import sparse_graph
from dynresp.support.checks import check_number
from dynresp.support.errors import UsageError

# Distance from the middle of a cell to the middle of the next, and width of the gap to which a
# passage between cells can be narrowed [m].
_CELL_M, _GAP_M = 1.8, 0.62
# Thickness and height of the walls [m].
_WALL_M, _HEIGHT_M = 0.12, 2.0


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


def random_maze(
    rng: np.random.Generator,
    columns: int = 5,
    rows: int = 5,
    loops: float = 0.05,
    narrow: float = 0.0,
) -> Maze:
    """Make a maze of cells of 1.8 m.

    The passages are the edges of a spanning tree of random weights over the grid of cells.

    Args:
        rng: Source of random numbers.
        columns: Cells along x.
        rows: Cells along y.
        loops: Share of the walls that are removed beyond those that connect all cells: 0 makes a
            tree.
        narrow: Share of the passages between cells that are narrowed to a gap of 0.62 m.

    Raises:
        UsageError: There are less than two cells, or a share is not from 0 to 1.
    """
    from scipy.sparse.csgraph import minimum_spanning_tree, shortest_path

    check_number("columns", columns, 1, whole=True)
    check_number("rows", rows, 1, whole=True)
    check_number("loops", loops, 0.0, 1.0)
    check_number("narrow", narrow, 0.0, 1.0)
    if columns * rows < 2:
        raise UsageError(f"a maze needs at least two cells, got {columns} x {rows}")
    cells = np.arange(columns * rows).reshape(columns, rows)
    pairs = np.concatenate(
        [
            np.stack([cells[:-1].ravel(), cells[1:].ravel()], axis=1),
            np.stack([cells[:, :-1].ravel(), cells[:, 1:].ravel()], axis=1),
        ]
    )
    weights = 1.0 + rng.random(len(pairs))
    first, second = pairs.T
    spanning = minimum_spanning_tree(sparse_graph(weights, first, second, cells.size))
    tree = spanning.toarray() > 0
    passages = tree[pairs[:, 0], pairs[:, 1]] | (rng.random(len(pairs)) < loops)
    narrowed = passages & (rng.random(len(pairs)) < narrow)
    edges = sparse_graph(weights[passages], first[passages], second[passages], cells.size)
    _, before = shortest_path(edges, directed=False, indices=0, return_predecessors=True)
    path = [cells.size - 1]
    while path[-1] != 0:
        path.append(int(before[path[-1]]))
    solution = (np.stack(np.divmod(path[::-1], rows), axis=1) + 0.5) * _CELL_M
    obstacles = tuple(_walls(pairs, passages, narrowed, rows))
    bounds = (0.0, 0.0, columns * _CELL_M, rows * _CELL_M)
    return Maze(World(bounds, obstacles), solution)


def _walls(
    pairs: np.ndarray, passages: np.ndarray, narrowed: np.ndarray, rows: int
) -> list[Obstacle]:
    """A box for each wall between two cells, two for each narrowed passage."""
    out = []
    half_wall, length = 0.5 * _WALL_M, _CELL_M + _WALL_M
    for (first, second), is_open, is_narrow in zip(pairs, passages, narrowed, strict=True):
        column, row = divmod(int(first), rows)
        along_y = second - first == rows
        corner = np.array([column + 1, row] if along_y else [column, row + 1]) * _CELL_M
        # A wall begins at this corner of the grid and is one cell long. It is longer by half its
        # thickness at both ends, so that walls that meet close the corner.
        stretches = [] if is_open else [(-half_wall, length - half_wall)]
        if is_narrow:
            stub = 0.5 * (_CELL_M - _GAP_M)
            stretches = [(-half_wall, stub), (_CELL_M - stub, length - half_wall)]
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
