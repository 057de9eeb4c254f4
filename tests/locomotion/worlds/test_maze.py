import numpy as np
import pytest

from dynresp.locomotion.worlds.maze import random_maze
from dynresp.locomotion.worlds.paths import resampled
from dynresp.support.errors import UsageError


@pytest.mark.parametrize("narrow", [0.0, 0.5])
def test_its_solution_stays_clear_of_its_walls(narrow: float) -> None:
    for seed in range(10):
        maze = random_maze(np.random.default_rng(seed), columns=6, rows=4, narrow=narrow)
        steps = np.abs(np.diff(maze.solution, axis=0))
        np.testing.assert_allclose(np.sort(steps, axis=1), [[0.0, 1.8]] * len(steps), atol=1e-9)
        np.testing.assert_allclose(maze.solution[[0, -1]], [[0.9, 0.9], [9.9, 6.3]])
        away = maze.world.distances(resampled(maze.solution, 0.02))
        assert away.min() > (0.29 if narrow else 0.8)


def test_without_loops_it_is_a_tree() -> None:
    maze = random_maze(np.random.default_rng(3), columns=7, rows=5, loops=0.0)
    pairs = 6 * 5 + 7 * 4
    assert len(maze.world.obstacles) == pairs - (7 * 5 - 1)
    assert maze.world.bounds == pytest.approx((0.0, 0.0, 7 * 1.8, 5 * 1.8))
    # Between middles of neighbour cells there is a wall, or there is none.
    every = random_maze(np.random.default_rng(3), columns=7, rows=5, loops=1.0)
    assert every.world.obstacles == ()


def test_a_seed_makes_one_maze() -> None:
    one, same, other = (random_maze(np.random.default_rng(seed), narrow=0.3) for seed in (1, 1, 2))
    assert one.world == same.world
    assert one.world != other.world


def test_wrong_numbers_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(UsageError, match="two cells, got 1 x 1"):
        random_maze(rng, columns=1, rows=1)
    with pytest.raises(UsageError, match="columns must be 1 or more"):
        random_maze(rng, columns=0)
    with pytest.raises(UsageError, match=r"loops must be from 0 to 1, got 1\.5"):
        random_maze(rng, loops=1.5)
    with pytest.raises(UsageError, match="narrow must be from 0 to 1"):
        random_maze(rng, narrow=-0.1)
