import math

import mujoco
import numpy as np
import pytest

from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.footprints import footprints
from dynresp.locomotion.worlds.obstacles import Obstacle, World, body_clearances
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.support.errors import UsageError
from tests.locomotion.graph.graph_samples import wandering_poses
from tests.oracles import search as oracle

BOUNDS = (-3.0, -2.0, 3.0, 2.5)


def made_world(rng: np.random.Generator, count: int = 6) -> World:
    boxes = [
        Obstacle(
            (rng.uniform(-3, 3), rng.uniform(-2, 2)),
            (rng.uniform(0.05, 0.8), rng.uniform(0.05, 0.8)),
            rng.uniform(-4, 4),
            rng.uniform(0.3, 2.0),
        )
        for _ in range(count)
    ]
    return World(BOUNDS, tuple(boxes))


def test_distances_are_those_to_the_nearest_side(rng: np.random.Generator) -> None:
    world = World((-5.0, -5.0, 5.0, 5.0), (Obstacle((1.0, 0.0), (0.5, 0.25), math.pi / 2),))
    points = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (1.25 + 0.3, 0.5 + 0.4), (-4.9, 0.0), (-6.0, 0.0)]
    expected = [0.75, 0.5, -0.25, 0.5, 0.1, -1.0]
    np.testing.assert_allclose(world.distances(points), expected, atol=1e-12)


def test_collisions_equal_the_slow_twin(rng: np.random.Generator) -> None:
    hits = 0
    for _ in range(20):
        world = made_world(rng)
        roots = np.stack(
            [rng.uniform(-3.2, 3.2, 60), rng.uniform(-2.2, 2.7, 60), rng.uniform(-9, 9, 60)], axis=1
        )
        feet = rng.uniform(0.05, 0.6, (60, 4)) * [-1, 1, -1, 1]
        margin = float(rng.uniform(0.0, 0.1))
        found = CollisionGrid.of(world, 1.2).collisions(roots, feet, margin)
        assert found.dtype == bool
        for root, reach, hit in zip(roots, feet, found, strict=True):
            # Outside of the bounds everything collides.
            inside = BOUNDS[0] <= root[0] <= BOUNDS[2] and BOUNDS[1] <= root[1] <= BOUNDS[3]
            assert hit == (not inside or oracle.collides(world, *root, reach, margin))
        hits += int(found.sum())
    assert 300 < hits < 1100


def test_footprints_are_where_mujoco_puts_the_geoms(
    rng: np.random.Generator, character: Character
) -> None:
    poses = np.concatenate([wandering_poses(rng, 15, 0.8), load_builtin("walk", character).poses])
    poses = poses[:: max(1, len(poses) // 30)]
    found = footprints(character, poses)
    for pose, reach in zip(poses, found, strict=True):
        np.testing.assert_allclose(reach, oracle.footprint(character, pose), atol=1e-9)


def test_a_standing_body_covers_half_a_metre_by_a_third(character: Character) -> None:
    back, front, right, left = footprints(character, character.rest_pose)[0]
    assert front - back == pytest.approx(0.30, abs=0.05)
    assert left == pytest.approx(-right, abs=1e-9)
    assert left - right == pytest.approx(0.48, abs=0.05)


def test_clearances_of_a_body_are_exact(character: Character) -> None:
    pose = character.rest_pose.copy()
    # Its right side is at y = -0.236: a shoulder's centre and radius.
    world = World((-9.0, -9.0, 9.0, 9.0), (Obstacle((0.0, -1.0), (0.5, 0.5)),))
    away = body_clearances(world, character, pose)
    assert away == pytest.approx([0.5 - 0.236], abs=1e-4)
    pose[1] = -0.4
    assert body_clearances(world, character, pose)[0] < 0.0
    assert body_clearances(world, character, character.rest_pose, 0.1) == [0.1]
    pose[1] = 5.0
    assert body_clearances(world, character, pose) == [0.5]


def test_no_body_touches_a_box_that_its_footprint_leaves_alone(
    rng: np.random.Generator, character: Character
) -> None:
    poses = load_builtin("walk", character).poses[::5].copy()
    poses[:, :2] = np.stack(
        [rng.uniform(-2, 2, len(poses)), rng.uniform(-1.5, 1.5, len(poses))], axis=1
    )
    world = made_world(rng, 3)
    feet = footprints(character, poses)
    yaw = 2.0 * np.arctan2(poses[:, 6], poses[:, 3])
    roots = np.concatenate([poses[:, :2], yaw[:, None]], axis=1)
    hits = CollisionGrid.of(world, 1.2).collisions(roots, feet)
    away = body_clearances(world, character, poses)
    assert 0 < hits.sum() < len(poses)
    assert (away[~hits] > -mujoco.mjMINVAL).all()


def test_wrong_numbers_are_refused() -> None:
    for box in (((0, math.nan), (1, 1)), ((0, 0), (0, 1)), ((0, 0), (1, math.inf))):
        with pytest.raises(UsageError, match="of an obstacle must be 2 finite numbers"):
            Obstacle(*box)
    with pytest.raises(UsageError, match="height of an obstacle must be above 0"):
        Obstacle((0, 0), (1, 1), height=-1.0)
    with pytest.raises(UsageError, match="bounds must be"):
        World((1.0, 0.0, 0.0, 2.0))


@pytest.mark.parametrize("wrong", ["ab", None, 3.0, (1.0,), (1.0, "x"), [(1.0, 2.0)], (1, 2, 3)])
def test_wrong_types_are_refused(wrong: object) -> None:
    with pytest.raises(UsageError, match="center of an obstacle must be 2 finite numbers, got"):
        Obstacle(wrong, (1.0, 1.0))  # type: ignore[arg-type]
    with pytest.raises(
        UsageError, match="half_sizes of an obstacle must be 2 finite numbers above 0"
    ):
        Obstacle((0.0, 0.0), wrong)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="bounds must be"):
        World(wrong)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="must be"):
        World((0.0, 0.0, 1.0, 1.0), wrong)  # type: ignore[arg-type]


def test_a_world_must_not_be_too_large_for_grids() -> None:
    World((0.0, 0.0, 400.0, 100.0))
    with pytest.raises(UsageError, match=r"sides of at most 400 m, got 401 x 1 m; cut"):
        World((0.0, 0.0, 401.0, 1.0))
    with pytest.raises(UsageError, match="sides of at most 400 m"):
        World((-1e308, -1e308, 1e308, 1e308))
    with pytest.raises(UsageError, match=r"at most 40000 m2, got 160000 m2"):
        World((0.0, 0.0, 400.0, 400.0))


def test_a_world_must_not_have_too_many_boxes_or_too_large_ones() -> None:
    bounds = (-100.0, -100.0, 100.0, 100.0)
    small = Obstacle((0, 0), (0.5, 0.5))
    assert len(World(bounds, (small,) * 10_000).boxes) == 10_004
    with pytest.raises(UsageError, match=r"at most 10000 boxes, got 10001; leave out"):
        World(bounds, (small,) * 10_001)
    # Only the part of a box inside the bounds counts.
    World(bounds, (Obstacle((0, 0), (1e200, 1e200), 0.3),) * 25)
    with pytest.raises(UsageError, match=r"26 boxes are too large .* adds up to 1040000 m2"):
        World(bounds, (Obstacle((0, 0), (1e200, 1e200), 0.3),) * 26)
    World(bounds, (Obstacle((1e6, 0), (500, 500)),) * 10_000)


def test_grids_must_not_be_too_fine() -> None:
    assert World((0.0, 0.0, 400.0, 100.0)).grid_shape(0.1) == (4000, 1000)
    assert World((0.0, 0.0, 1.01, 0.05)).grid_shape(0.1) == (11, 1)
    world = World((0.0, 0.0, 100.0, 100.0), (Obstacle((0, 0), (1, 1)),) * 300)
    with pytest.raises(UsageError, match=r"100 x 100 m in cells of 0.01 m .* larger cells"):
        CollisionGrid.of(world, 1.2, cell_m=0.01)
    with pytest.raises(UsageError, match="larger cells"):
        world.grid_shape(1e-300)
    with pytest.raises(UsageError, match="side of cells must be above 0 and finite, got 0"):
        world.grid_shape(0.0)


def test_distances_of_a_grid_equal_those_of_its_world(rng: np.random.Generator) -> None:
    for reach in (0.3, 1.2, 20.0):
        world = made_world(rng)
        grid = CollisionGrid.of(world, reach, cell_m=0.17)
        points = rng.uniform(-4.0, 4.0, (300, 2))
        expected = np.minimum(world.distances(points), reach)
        np.testing.assert_allclose(grid.distances(points), expected, atol=1e-12)
        middles = grid.frame[:2] + 0.17 * (np.argwhere(np.isfinite(grid.clearance)) + 0.5)
        near = grid.clearance[np.isfinite(grid.clearance)]
        np.testing.assert_allclose(near, world.distances(middles), atol=1e-6)


def test_lists_of_boxes_must_not_be_too_long() -> None:
    # Every box is near every cell.
    world = World((0.0, 0.0, 40.0, 40.0), (Obstacle((20, 20), (40, 40)),) * 600)
    with pytest.raises(UsageError, match=r"boxes within reach \(1.2 m\) .* leave out"):
        CollisionGrid.of(world, 1.2, cell_m=0.05)
