import numpy as np
import pytest

from dynresp.locomotion.worlds.maze import MazeConfig, random_maze
from dynresp.locomotion.worlds.paths import resampled
from dynresp.support.errors import UsageError


@pytest.mark.parametrize("narrow", [0.0, 0.5])
def test_its_solution_stays_clear_of_its_walls(narrow: float) -> None:
    config = MazeConfig(columns=6, rows=4, narrow=narrow, gap_m=0.6)
    for seed in range(10):
        maze = random_maze(np.random.default_rng(seed), config)
        steps = np.abs(np.diff(maze.solution, axis=0))
        np.testing.assert_allclose(np.sort(steps, axis=1), [[0.0, 1.8]] * len(steps), atol=1e-9)
        np.testing.assert_allclose(maze.solution[[0, -1]], [[0.9, 0.9], [9.9, 6.3]])
        away = maze.world.distances(resampled(maze.solution, 0.02))
        assert away.min() > (0.29 if narrow else 0.8)


def test_without_loops_it_is_a_tree() -> None:
    config = MazeConfig(columns=7, rows=5, loops=0.0)
    maze = random_maze(np.random.default_rng(3), config)
    ways = 6 * 5 + 7 * 4
    assert len(maze.world.obstacles) == ways - (7 * 5 - 1)
    assert maze.world.bounds == pytest.approx((0.0, 0.0, 7 * 1.8, 5 * 1.8))
    # Between middles of neighbour cells there is a wall, or there is none.
    every = random_maze(np.random.default_rng(3), MazeConfig(columns=7, rows=5, loops=1.0))
    assert every.world.obstacles == ()


def test_a_seed_makes_one_maze() -> None:
    one, same, other = (
        random_maze(np.random.default_rng(seed), MazeConfig(narrow=0.3)) for seed in (1, 1, 2)
    )
    assert one.world == same.world
    assert one.world != other.world


def test_what_is_no_maze() -> None:
    with pytest.raises(UsageError, match="two cells, got 1 x 1"):
        MazeConfig(columns=1, rows=1)
    with pytest.raises(UsageError, match="gap_m"):
        MazeConfig(gap_m=2.0)
    with pytest.raises(UsageError, match="loops"):
        MazeConfig(loops=1.5)
