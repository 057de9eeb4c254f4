import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.recorded_terrain import fit_blocks, onto_blocks
from dynresp.locomotion.worlds.terrain import BLOCK_M, LEVEL_M, Terrain
from dynresp.locomotion.worlds.world_contacts import (
    feet_on,
    find_stances,
    heights_above,
    sole_corners,
    standing_soles,
    steady,
)
from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionError, UsageError
from tests.locomotion.worlds.terrain_samples import FPS, block_walk, footprint

LEVELS = np.array([[0, 2, 3, 1], [4, 6, 0, 2], [3, 5, 4, 0], [1, 0, 2, 5]])


def test_height_is_that_of_the_block_below() -> None:
    terrain = Terrain(LEVELS, corner=(1.0, -2.0))
    points = [[1.01, -1.99, 7.0], [1.0 + 1.5 * BLOCK_M, -2.0 + 2.5 * BLOCK_M, 0.0]]
    assert terrain.height(points) == pytest.approx([0.0, 0.0])
    assert terrain.height([1.0 + 1.5 * BLOCK_M, -2.0 + 1.5 * BLOCK_M]) == pytest.approx(6 * LEVEL_M)
    assert terrain.size == pytest.approx((4 * BLOCK_M, 4 * BLOCK_M))


def test_beside_the_grid_there_is_no_ground() -> None:
    terrain = Terrain(LEVELS)
    beside = [[-0.01, 1.0], [1.0, -0.01], [4 * BLOCK_M + 0.01, 1.0], [1e300, 0.0], [np.nan, 1.0]]
    assert np.isnan(terrain.height(beside)).all()
    assert not terrain.supports(footprint(-1.0, 1.0, 0.0), np.zeros(4))


def test_boxes_end_at_the_surface() -> None:
    terrain = Terrain(LEVELS - 2, corner=(0.5, 0.25))
    centers, half = terrain.boxes()
    assert len(centers) == LEVELS.size
    assert centers[:, 2] + half[:, 2] == pytest.approx(terrain.height(centers))
    assert (half > 0).all()
    assert np.ptp(centers[:, 2] - half[:, 2]) < 1e-12


@pytest.mark.parametrize(
    "levels", [np.zeros((0, 3), int), np.zeros(4, int), np.zeros((2, 2)), np.full((2, 2), np.nan)]
)
def test_levels_that_are_no_grid_of_whole_numbers_are_refused(levels: np.ndarray) -> None:
    with pytest.raises(UsageError, match="whole numbers in a grid"):
        Terrain(levels)


def test_wrong_sizes_are_refused() -> None:
    with pytest.raises(UsageError, match="block_m must be above 0"):
        Terrain(LEVELS, block_m=0.0)
    with pytest.raises(UsageError, match="corner of a terrain must be 2 finite numbers"):
        Terrain(LEVELS, corner=(np.nan, 0.0))
    with pytest.raises(UsageError, match="one column and one row"):
        Terrain.random(np.random.default_rng(0), 0, 3)


@pytest.mark.parametrize("steepest", [0, 1, 2, 3])
def test_random_terrain_is_no_steeper_than_its_limit(steepest: int) -> None:
    terrain = Terrain.random(np.random.default_rng(5), 25, 30, highest=6, steepest=steepest)
    levels = terrain.levels
    shifts = [(1, 0), (0, 1), (1, 1), (1, -1)]
    steps = [
        np.abs(levels - np.roll(levels, shift, axis=(0, 1)))[1:, 1:-1].max() for shift in shifts
    ]
    assert max(steps) == steepest
    assert levels.min() >= 0
    assert levels.max() <= 6
    if steepest:
        assert len(np.unique(levels)) == 7


def test_random_terrain_depends_on_the_seed_alone() -> None:
    one, two, three = (Terrain.random(np.random.default_rng(s), 9, 8).levels for s in (1, 1, 2))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, three)


def _stands(terrain: Terrain, sole: np.ndarray, at: np.ndarray, tolerance: float) -> bool:
    """The slow twin of `Terrain.supports`, for one foot."""
    if np.isnan(sole).any():
        return True
    x, y, z, yaw = at
    placed = [
        (
            x + math.cos(yaw) * p[0] - math.sin(yaw) * p[1],
            y + math.sin(yaw) * p[0] + math.cos(yaw) * p[1],
            z + p[2],
        )
        for p in sole
    ]
    middle = [sum(p[k] for p in placed) / len(placed) for k in range(2)]
    least = math.inf
    for p in placed:
        i, j = (
            math.floor((0.5 * (p[k] + middle[k]) - terrain.corner[k]) / terrain.block_m)
            for k in range(2)
        )
        if not (0 <= i < terrain.levels.shape[0] and 0 <= j < terrain.levels.shape[1]):
            return False
        least = min(least, p[2] - terrain.levels[i, j] * terrain.level_m)
    return abs(least) <= tolerance


def test_support_equals_its_slow_twin(rng: np.random.Generator) -> None:
    terrain = Terrain.random(rng, 6, 5)
    soles = np.stack(
        [
            footprint(*rng.uniform(0, 3, 2), rng.integers(-3, 4) * LEVEL_M + rng.normal(0, 0.02))
            for _ in range(3000)
        ]
    )
    soles[::50] = np.nan
    at = np.column_stack(
        [
            rng.integers(-1, 3, (3000, 2)) * BLOCK_M,
            rng.integers(-1, 4, 3000) * LEVEL_M,
            rng.integers(0, 4, 3000) * np.pi / 2,
        ]
    )
    found = terrain.supports(soles, at, 0.03)
    assert found.tolist() == [_stands(terrain, s, p, 0.03) for s, p in zip(soles, at, strict=True)]
    assert 100 < np.count_nonzero(found) < 2900
    pairs = terrain.supports(soles.reshape(1500, 2, 4, 3), at[:1500, None], 0.03)
    assert pairs[:, 0].tolist() == terrain.supports(soles[::2], at[:1500], 0.03).tolist()


def test_a_foot_may_stick_out_over_an_edge_but_not_into_a_block() -> None:
    terrain = Terrain(np.array([[0], [3]]))
    low, high = 0.0, 3 * LEVEL_M
    edge = BLOCK_M
    assert terrain.supports(footprint(edge + 0.07, 0.3, high), np.zeros(4))
    assert terrain.supports(footprint(edge - 0.07, 0.3, low), np.zeros(4))
    assert not terrain.supports(footprint(edge - 0.02, 0.3, low), np.zeros(4))
    assert not terrain.supports(footprint(edge + 0.3, 0.3, low), np.zeros(4))
    assert not terrain.supports(footprint(edge - 0.3, 0.3, high), np.zeros(4))


def test_standing_puts_the_lower_foot_on_its_block() -> None:
    terrain = Terrain(LEVELS)
    soles = np.stack([footprint(0.3, 0.3, 5.1), footprint(0.3, 0.3 + BLOCK_M, 5.1 + 2 * LEVEL_M)])
    at = terrain.standing(soles, [0.0, 0.0, 99.0, 0.0])
    assert (at[2] / LEVEL_M) == pytest.approx(round(at[2] / LEVEL_M))
    assert terrain.supports(soles, at, 0.5 * LEVEL_M).all()
    one = soles.copy()
    one[1] = np.nan
    assert terrain.standing(one, np.zeros(4)) == pytest.approx(at)
    for wrong in (np.full_like(soles, np.nan), soles + 9.0):
        with pytest.raises(UsageError, match="do not stand on a block"):
            terrain.standing(wrong, np.zeros(4))


def test_contacts_are_made_steady_as_loops_would(rng: np.random.Generator) -> None:
    for length in (1, 2, 3, 4, 7):
        for _ in range(60):
            flags = rng.random(40) < rng.uniform(0.2, 0.8)
            expected = flags.copy()
            for value in (False, True):
                edges = [0, *(np.flatnonzero(np.diff(expected)) + 1), len(expected)]
                for start, stop in itertools.pairwise(edges):
                    inside = start > 0 and stop < len(expected)
                    if inside and expected[start] == value and stop - start < length:
                        expected[start:stop] = not value
            assert np.array_equal(steady(flags[:, None], 10.0, length / 10.0)[:, 0], expected)


def test_stances_of_a_made_walk(character: Character, rng: np.random.Generator) -> None:
    walk = block_walk(character, rng, LEVELS, steps=12)
    corners = sole_corners(character, character.kinematics(walk.poses))
    stances = find_stances(corners, FPS)
    assert 13 <= len(stances) <= 14
    assert np.diff(stances.starts[stances.feet == 0]).min() > 0
    terrain = Terrain(LEVELS)
    above = heights_above(terrain.height, stances.soles)
    assert np.abs(above).max() < 0.005
    contacts = feet_on(terrain.height, corners, FPS)
    assert contacts.any(axis=1).all()
    assert 0.6 < contacts.mean() < 0.95
    soles = standing_soles(character, walk.poses, contacts)
    assert terrain.supports(soles, np.zeros(4), 0.05).all()
    assert np.array_equal(np.isnan(soles).any(axis=(2, 3)), ~contacts)


@pytest.mark.parametrize("yaw", [0.0, 0.3, -0.6])
def test_the_grid_of_made_walks_is_found(
    character: Character, rng: np.random.Generator, yaw: float
) -> None:
    scale = 1.05
    corner = (0.37, -0.81)
    walks = [
        block_walk(character, rng, LEVELS, steps, yaw, corner, scale).moved(0.0, (0, 0, rise))
        for steps, rise in ((60, 0.2), (20, -0.1))
    ]
    fit = fit_blocks(character, walks, scale)
    assert fit.yaw == pytest.approx(yaw, abs=np.radians(4.0))
    assert fit.scatter < 0.005
    assert fit.base[0] - fit.base[1] == pytest.approx(0.3, abs=0.01)
    seen = fit.stances > 0
    shape = fit.levels.shape
    places = [
        LEVELS[i : i + shape[0], j : j + shape[1]]
        for i in range(5 - shape[0])
        for j in range(5 - shape[1])
    ]
    assert any(np.ptp((fit.levels - there)[seen]) == 0 for there in places)


def test_motion_is_moved_onto_the_blocks(character: Character, rng: np.random.Generator) -> None:
    walk = block_walk(character, rng, LEVELS, 60, 0.2, (3.0, 1.0), 1.05)
    fit = fit_blocks(character, [walk], 1.05)
    (moved,), terrain = onto_blocks(character, [walk], fit)
    corners = sole_corners(character, character.kinematics(moved.poses))
    above = heights_above(terrain.height, corners).min(axis=2)
    assert np.abs(above[moved.contacts]).max() < 1e-3
    assert moved.contacts.any(axis=1).all()
    soles = standing_soles(character, moved.poses, moved.contacts)
    assert terrain.supports(soles, np.zeros(4), 0.01).all()
    # The mirror image stands on the mirrored blocks, and those lie on the same grid.
    mirrored = moved.mirrored(character)
    other = Terrain(terrain.levels[:, ::-1], corner=(0.0, -terrain.size[1]))
    soles = standing_soles(character, mirrored.poses, mirrored.contacts)
    assert other.supports(soles, np.zeros(4), 0.01).all()


def test_too_little_motion_is_refused(character: Character, rng: np.random.Generator) -> None:
    walk = block_walk(character, rng, LEVELS, 3)
    with pytest.raises(MotionError, match="too few"):
        fit_blocks(character, [walk])
    still = Motion(np.repeat(character.rest_pose[None], 60, axis=0), 60.0)
    elsewhere = [block_walk(character, rng, LEVELS, 60), still.moved(0.0, (50.0, 0.0, 0.0))]
    with pytest.raises(MotionError, match="give motions of one world"):
        fit_blocks(character, elsewhere)


@pytest.mark.mocap
class TestRecorded:
    """The clips of CMU's subject 3."""

    @pytest.fixture(scope="class")
    @classmethod
    def recorded(
        cls, motions_folder: Path, character: Character
    ) -> tuple[list[Motion], Terrain, list[Motion]]:
        files = sorted((motions_folder / "cmu" / "03").glob("*.amc"))
        motions = [load_motion(f, options=LoadOptions(flat_floor=False)) for f in files]
        moved, terrain = onto_blocks(character, motions)
        return motions, terrain, moved

    def test_they_stood_on_blocks(
        self, recorded: tuple[list[Motion], Terrain, list[Motion]], character: Character
    ) -> None:
        motions, terrain, _ = recorded
        fit = fit_blocks(character, motions)
        assert fit.scatter < 0.012
        assert abs(np.degrees(fit.yaw)) < 5.0
        assert np.abs(fit.misfit).max() < 0.5 * LEVEL_M
        assert np.count_nonzero(fit.stances) >= 19
        assert terrain.levels.shape == (6, 4)
        assert terrain.levels.max() == 6

    def test_they_stand_exactly_and_move_as_before(
        self, recorded: tuple[list[Motion], Terrain, list[Motion]], character: Character
    ) -> None:
        motions, terrain, moved = recorded
        for before, after in zip(motions, moved, strict=True):
            corners = sole_corners(character, character.kinematics(after.poses))
            above = heights_above(terrain.height, corners).min(axis=2)
            assert np.abs(above[after.contacts]).max() < 0.002
            assert after.contacts.any(axis=1).mean() > 0.99
            was, now = (np.abs(m.velocities()[:, 6:]) for m in (before, after))
            assert np.quantile(now, 0.999) < 1.1 * np.quantile(was, 0.999)

    def test_their_graph_jumps_by_whole_blocks(
        self, recorded: tuple[list[Motion], Terrain, list[Motion]]
    ) -> None:
        _, _, moved = recorded
        config = GraphConfig(coordinates=Coordinates.BLOCKS, block_height_m=LEVEL_M, mirrored=True)
        graph = MotionGraph.build(moved, config)
        jumps = graph.distances > 0
        assert graph.counts.component_frames > 0.8 * len(graph.database)
        unit = np.array([BLOCK_M, BLOCK_M, LEVEL_M, 0.5 * np.pi])
        whole = graph.placements[jumps] / unit
        assert np.abs(whole - np.round(whole)).max() < 1e-9
        assert len(np.unique(np.round(whole[:, 2]))) > 6
        state = placement.compose(
            graph.placements[jumps], graph.database.planar[graph.targets[jumps] - 1]
        )
        offset = graph.database.planar[graph.sources[jumps]] - state
        assert np.linalg.norm(offset[:, :2], axis=1).max() < BLOCK_M
