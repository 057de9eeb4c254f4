import math

import numpy as np
import pytest

from dynresp.locomotion.worlds import maze as mazes
from dynresp.locomotion.worlds import path_planning as planning
from dynresp.locomotion.worlds.maze import random_maze
from dynresp.locomotion.worlds.obstacles import Obstacle, World
from dynresp.locomotion.worlds.path_planning import fit_path, plan_path
from dynresp.locomotion.worlds.paths import resampled
from dynresp.support.errors import DynrespError, UsageError

OPEN = World((-1.0, -3.0, 9.0, 3.0))
WALL = World((-1.0, -3.0, 9.0, 3.0), (Obstacle((4.0, -1.0), (0.1, 2.0)),))


def length(path: np.ndarray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def test_in_the_open_it_is_straight() -> None:
    path = plan_path(OPEN, (0.0, 0.0), (8.0, 1.0))
    np.testing.assert_allclose(path[[0, -1]], [(0.0, 0.0), (8.0, 1.0)])
    assert length(path) < 1.03 * math.hypot(8.0, 1.0)
    assert np.hypot(*np.diff(path, axis=0).T).max() < 0.11


def test_it_goes_around_with_room_to_spare() -> None:
    path = plan_path(WALL, (0.0, 0.0), (8.0, 0.0))
    away = WALL.distances(path)
    assert away.min() > 0.45
    assert length(path) < 9.5


def test_a_narrow_gap_is_used_only_where_it_saves_much(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = (Obstacle((4.0, -1.85), (0.1, 1.55)), Obstacle((4.0, 1.3), (0.1, 1.0)))
    world = World((-1.0, -3.4, 9.0, 3.4), boxes)
    # The gap between y = -0.3 and y = 0.3, or around by y = 2.8.
    paths = []
    for cost in (1.0, 100.0):
        with monkeypatch.context() as patch:
            patch.setattr(planning, "_NEAR_COST", cost)
            paths.append(plan_path(world, (0.0, 0.0), (8.0, 0.0)))
    short, patient = paths
    assert np.abs(short[:, 1]).max() < 0.5
    assert patient[:, 1].max() > 2.3
    closed = plan_path(world, (0.0, 0.0), (8.0, 0.0), blocked=[(4.0, 0.0, 0.3)])
    assert closed[:, 1].max() > 2.3


def test_a_sketch_on_free_ground_is_kept() -> None:
    angle = np.linspace(0.0, 3.0 * math.pi, 90)
    # One and a half turns: it crosses its own beginning.
    sketch = np.stack([4.0 + 1.5 * np.cos(angle), 1.5 * np.sin(angle)], axis=1)
    path = fit_path(OPEN, sketch)
    assert length(path) == pytest.approx(length(sketch), rel=0.06)
    away = np.abs(np.hypot(path[:, 0] - 4.0, path[:, 1]) - 1.5)
    assert away.max() < 0.15
    np.testing.assert_allclose(path[[0, -1]], sketch[[0, -1]], atol=1e-9)


def test_a_sketch_that_cuts_a_wall_goes_around_its_end() -> None:
    path = fit_path(WALL, [(0.0, 0.5), (8.0, 0.5)])
    assert WALL.distances(path).min() > 0.2
    # The path around lies beyond the first reach.
    path = fit_path(WALL, [(0.0, -1.5), (8.0, -1.5)])
    assert WALL.distances(path).min() > 0.2
    assert path[:, 1].max() > 1.2


def test_walls_across_a_sketch_do_not_mislead_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mazes, "_CELL_M", 1.4)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        maze = random_maze(rng, loops=0.0)
        corners = maze.solution + rng.normal(0.0, 0.3, maze.solution.shape)
        path = fit_path(maze.world, corners)
        assert maze.world.distances(path).min() > 0.19
        assert length(path) < 1.25 * length(maze.solution)
        assert np.hypot(*(path[-1] - maze.solution[-1])) < 1.0


def test_there_may_be_no_path() -> None:
    boxes = (Obstacle((4.0, 0.0), (0.1, 3.0)),)
    world = World((-1.0, -3.0, 9.0, 3.0), boxes)
    with pytest.raises(DynrespError, match=r"no path from \(0.00, 0.00\) to \(8.00, 0.00\)"):
        plan_path(world, (0.0, 0.0), (8.0, 0.0))
    with pytest.raises(DynrespError, match="no path"):
        fit_path(world, [(0.0, 0.0), (8.0, 0.0)])
    with pytest.raises(DynrespError, match=r"the goal .* is not within 2 m"):
        plan_path(world, (0.0, 0.0), (18.0, 0.0))


def test_grids_that_would_be_too_large_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World((-100.0, -100.0, 100.0, 100.0))
    monkeypatch.setattr(planning, "_CELL_M", 0.01)
    with pytest.raises(UsageError, match=r"200 x 200 m in cells of 0.01 m"):
        plan_path(world, (0.0, 0.0), (8.0, 0.0))
    monkeypatch.setattr(planning, "_CELL_M", 0.04)
    discs = np.zeros((20_000, 3))
    with pytest.raises(UsageError, match="20000 discs in 37500 cells"):
        plan_path(WALL, (0.0, 0.0), (8.0, 0.0), discs)


def test_the_search_around_a_sketch_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    # Enough for the first search; the second is four times as wide.
    monkeypatch.setattr(planning, "_MAX_STATES", 20_000)
    assert WALL.distances(fit_path(WALL, [(0.0, 0.5), (8.0, 0.5)])).min() > 0.2
    with pytest.raises(UsageError, match=r"8\.0 m long is too long to search 4 m around"):
        fit_path(WALL, [(0.0, -1.5), (8.0, -1.5)])
    monkeypatch.setattr(planning, "_MAX_STATES", 2_000)
    with pytest.raises(UsageError, match=r"too long to search 1 m around .* cut it"):
        fit_path(WALL, [(0.0, 0.5), (8.0, 0.5)])


def test_points_along_a_path() -> None:
    path = resampled([(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (1.0, 2.0)], 0.5)
    np.testing.assert_allclose(
        path, [(0, 0), (0.5, 0), (1, 0), (1, 0.5), (1, 1), (1, 1.5), (1, 2)], atol=1e-12
    )
    np.testing.assert_array_equal(resampled([(1.0, 2.0), (1.0, 2.0)], 0.1), [(1.0, 2.0)])
    with pytest.raises(UsageError, match=r"points \(k, 2\), got \(0,\)"):
        resampled([], 0.1)
    with pytest.raises(UsageError, match="finite"):
        resampled([(0.0, math.inf)], 0.1)
