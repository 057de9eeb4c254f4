from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.worlds import terrain_walk
from dynresp.locomotion.worlds.paths import distances_to
from dynresp.locomotion.worlds.recorded_terrain import onto_blocks
from dynresp.locomotion.worlds.terrain import BLOCK_M, LEVEL_M, Terrain
from dynresp.locomotion.worlds.terrain_fitting import (
    compose_on_terrain,
    drawn_in,
    footing,
    walk_blocks,
)
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.locomotion.worlds.terrain_walk import (
    TerrainWalk,
    follow_on_terrain,
    reach_on_terrain,
    start_on_terrain,
    wander_on_terrain,
)
from dynresp.locomotion.worlds.world_contacts import feet_on, sole_corners
from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionError, UsageError
from tests.locomotion.worlds.terrain_samples import block_walk, footprint
from tests.oracles import terrain_walk as slow

BLOCKS = GraphConfig(
    coordinates=Coordinates.BLOCKS,
    block_height_m=LEVEL_M,
    contact_change=False,
    sigma=0.1,
    mirrored=True,
)
# Recorded by our stiff walker: level by level, with a step of one to each side.
LEVELS = np.array([[0, 1, 1, 0], [1, 0, 1, 2], [1, 1, 0, 1], [0, 1, 1, 0]])


def stiff_walk(character: Character, seed: int, steps: int) -> Motion:
    """A walk over LEVELS with its contacts."""
    motion = block_walk(character, np.random.default_rng(seed), LEVELS, steps)
    terrain = Terrain(LEVELS)
    corners = sole_corners(character, character.kinematics(motion.poses))
    contacts = feet_on(terrain.height, corners, motion.fps)
    low = np.where(contacts[..., None], corners[..., 2], np.inf).min()
    poses = np.array(motion.poses)
    poses[:, 2] -= low
    return Motion(poses, motion.fps, motion.name, contacts)


@pytest.fixture(scope="module")
def made(character: Character) -> TerrainGraph:
    """A graph of a made walk."""
    return TerrainGraph(MotionGraph.build([stiff_walk(character, 3, 60)], BLOCKS), character)


def check_walk(graph: TerrainGraph, terrain: Terrain, walk: TerrainWalk, adapt: int) -> None:
    """A walk follows edges of the graph, and all its feet stand on blocks."""
    edges, database = graph.graph, graph.graph.database
    for k in range(1, len(walk.frames)):
        left, entry = walk.frames[k - 1], walk.frames[k]
        row = slice(edges.offsets[left], edges.offsets[left + 1])
        edge = row.start + int(np.flatnonzero(edges.targets[row] == entry)[0])
        there = placement.compose(walk.placements[k - 1], edges.placements[edge])
        off = there - walk.placements[k]
        off[3] = placement.wrapped(off[3])
        assert np.abs(off[[0, 1, 3]]).max() < 1e-9
        both = database.contacts[left, :2] & database.contacts[entry, :2]
        assert (walk.blocks[k - 1, both] == walk.blocks[k, both]).all()
    stands = database.contacts[walk.frames, :2]
    assert (walk.blocks[stands] >= 0).all()
    assert (walk.blocks[~stands] == -1).all()
    own = graph.levels[walk.frames] + np.round(walk.placements[:, None, 2] / terrain.level_m)
    lift = (terrain.levels[tuple(np.moveaxis(walk.blocks, -1, 0))] - own)[stands]
    assert np.abs(lift).max() <= adapt


def test_a_graph_knows_the_blocks_of_its_stances(made: TerrainGraph) -> None:
    recorded = Terrain(LEVELS)
    original = ~np.array([clip.identity.endswith("m") for clip in made.graph.database.clips])
    mine = original[made.graph.database.clip_of][:, None] & made.stands
    cells = made.blocks[mine]
    assert (recorded.levels[tuple(cells.T)] == made.levels[mine]).all()
    soles = sole_corners(made.character, made.character.kinematics(made.graph.database.poses))
    assert (recorded.cells(soles[mine].mean(axis=1)) == cells).all()


def test_cell_placements_convert_to_metres_and_back(
    made: TerrainGraph, rng: np.random.Generator
) -> None:
    terrain = Terrain(LEVELS, corner=(0.3, -7.1))
    for _ in range(20):
        given = rng.integers([-5, -5, -9, 0], [9, 9, 9, 4])
        assert (made.cell_placement(terrain, made.meters(terrain, given)) == given).all()
    with pytest.raises(UsageError, match="whole blocks"):
        made.cell_placement(terrain, np.zeros(4))


@pytest.mark.slow
def test_other_coordinates_blocks_and_places_are_refused(
    made: TerrainGraph, character: Character
) -> None:
    motion = stiff_walk(character, 3, 60)
    flat = MotionGraph.build([motion], GraphConfig(contact_change=False, sigma=0.1))
    with pytest.raises(UsageError, match="blocks coordinates"):
        TerrainGraph(flat, character)
    poses = np.array(motion.poses)
    poses[:, 2] += 0.4 * LEVEL_M
    hovering = Motion(poses, motion.fps, "hovering", motion.contacts)
    with pytest.raises(MotionError, match="off whole levels"):
        TerrainGraph(MotionGraph.build([hovering], BLOCKS), character)
    with pytest.raises(UsageError, match="must be the same"):
        start_on_terrain(made, Terrain(LEVELS, level_m=0.1), [1, 1], [2, 2])
    terrain = Terrain(np.zeros((8, 8), dtype=np.int64))
    start = start_on_terrain(made, terrain, [2.4, 2.4], [4.0, 2.4])
    with pytest.raises(UsageError, match="inside the grid"):
        reach_on_terrain(made, terrain, start, [50.0, 1.0])
    with pytest.raises(UsageError, match="at least 1 frame"):
        wander_on_terrain(made, terrain, start, 0, np.random.default_rng(0))
    far = AvatarState(start.frame, start.placement + np.array([20 * BLOCK_M, 0.0, 0.0, 0.0]))
    with pytest.raises(UsageError, match="beside the grid"):
        reach_on_terrain(made, terrain, far, [1.0, 1.0])
    with pytest.raises(UsageError, match="no frame of the graph stands"):
        start_on_terrain(made, terrain, [-9.0, -9.0], [0.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_search_reaches_a_goal_exactly_if_its_slow_twin_does(
    made: TerrainGraph, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The slow twin takes recorded steps alone, and draws no foot in.
    monkeypatch.setattr(terrain_walk, "_MAX_LEVEL_CHANGE", 0)
    monkeypatch.setattr(terrain_walk, "_MAX_DRAW_M", 10.0)
    monkeypatch.setattr(terrain_walk, "_ARRIVAL_M", 0.15)
    rng = np.random.default_rng(seed)
    terrain = Terrain(rng.integers(0, 3, size=(5, 5)), corner=(-1.0, 2.0))
    middle = np.array(terrain.corner) + 2.5 * BLOCK_M
    states = []
    for frame in made.graph.frames[:: len(made.graph.frames) // 40]:
        for turns in range(4):
            cell = rng.integers(-2, 3, size=2)
            found = made.standing(terrain, int(frame), cell, turns)
            if found is not None and made.stands[frame].any():
                states.append(AvatarState(int(frame), made.meters(terrain, found)))
    assert states
    state = states[rng.integers(len(states))]
    roots = np.array(slow.reachable(made, terrain, state))
    for goal in middle + rng.uniform(-1.4, 1.4, size=(8, 2)):
        nearest = np.hypot(*(roots[:, :2] - goal).T).min()
        walk = reach_on_terrain(made, terrain, state, goal)
        assert walk.arrived == (nearest <= 0.15)
        check_walk(made, terrain, walk, adapt=0)
        if walk.arrived:
            assert walk.off_goal <= 0.15


@pytest.mark.slow
def test_walks_stand_on_blocks_and_end_at_the_goal(made: TerrainGraph) -> None:
    terrain = Terrain.random(np.random.default_rng(4), 12, 12, highest=3, steepest=1)
    start = start_on_terrain(made, terrain, [2.0, 2.0], [5.0, 5.0])
    assert np.hypot(*(start.root(made.graph)[:2] - 2.0)) < 0.6
    walk = reach_on_terrain(made, terrain, start, [5.0, 5.0])
    assert walk.arrived
    check_walk(made, terrain, walk, adapt=2)
    assert not walk.frames.flags.writeable
    again = reach_on_terrain(made, terrain, start, [5.0, 5.0])
    assert (again.frames == walk.frames).all()
    path = [[2.0, 2.0], [5.0, 2.5], [5.0, 5.0]]
    along = follow_on_terrain(made, terrain, start, path)
    assert along.arrived
    check_walk(made, terrain, along, adapt=2)
    corners = np.array(path)
    assert (
        distances_to(corners, along.roots[:, :2]).mean()
        < distances_to(corners, walk.roots[:, :2]).mean()
    )


def test_a_random_walk_goes_on_or_reports_that_it_is_stuck(made: TerrainGraph) -> None:
    terrain = Terrain.random(np.random.default_rng(4), 12, 12, highest=3, steepest=1)
    start = start_on_terrain(made, terrain, [2.0, 2.0], [5.0, 5.0])
    walk = wander_on_terrain(made, terrain, start, 400, np.random.default_rng(1))
    assert walk.arrived
    assert len(walk.frames) == 401
    check_walk(made, terrain, walk, adapt=2)
    other = wander_on_terrain(made, terrain, start, 400, np.random.default_rng(2))
    assert not np.array_equal(walk.frames, other.frames)
    # One block and the one beside it are left of the world.
    levels = np.full((12, 12), 90)
    cells = np.unique(walk.blocks[:8][walk.blocks[:8, :, 0] >= 0], axis=0)
    levels[tuple(cells.T)] = terrain.levels[tuple(cells.T)]
    island = Terrain(levels)
    stuck = wander_on_terrain(made, island, start, 400, np.random.default_rng(1))
    assert not stuck.arrived
    assert len(stuck.frames) < 401


def test_soles_are_drawn_in_only_where_the_height_changes() -> None:
    terrain = Terrain(np.array([[0, 0, 2], [0, 0, 0], [0, 0, 0]]))
    block = np.array([1, 1])
    inside = footprint(1.5 * BLOCK_M, 1.5 * BLOCK_M, 0.0)
    level = footprint(1.5 * BLOCK_M, 2.0 * BLOCK_M, 0.0)
    across = footprint(1.02 * BLOCK_M, 1.95 * BLOCK_M, 0.0)
    assert not drawn_in(terrain, block, inside, 0.01).any()
    assert not drawn_in(terrain, block, level, 0.01).any()
    shift = drawn_in(terrain, block, across, 0.01)
    # The corner block alone is higher: the shorter shift is enough.
    assert np.count_nonzero(shift) == 1
    assert shift[1] == pytest.approx(2.0 * BLOCK_M - 0.01 - across[:, 1].max())
    step = Terrain(np.array([[0, 0, 0], [0, 0, 3], [0, 0, 0]]))
    assert drawn_in(step, block, level, 0.01) == pytest.approx([0.0, -0.05])


def test_feet_of_the_motion_stand_on_the_blocks(made: TerrainGraph) -> None:
    terrain = Terrain.random(np.random.default_rng(4), 12, 12, highest=3, steepest=1)
    start = start_on_terrain(made, terrain, [2.0, 2.0], [5.0, 5.0])
    walk = reach_on_terrain(made, terrain, start, [5.0, 5.0])
    for fps in (15.0, 60.0):
        composed = compose_on_terrain(made, terrain, walk, fps)
        blocks = walk_blocks(walk, 15.0, composed.motion)
        assert (blocks[composed.motion.contacts] >= 0).all()
        feet = footing(made.character, terrain, composed.motion, blocks)
        assert feet.off_height.max() < 0.01
        assert feet.overhang.max() < 0.01
        assert np.median(feet.slide) < 0.01
        assert np.percentile(feet.sunk, 99) < 0.02


def test_footing_measures_height_overhang_and_depth(character: Character) -> None:
    """A figure beside its block, over the edge, and in the next one."""
    poses = np.repeat(character.rest_pose[None], 3, axis=0)
    low = sole_corners(character, character.kinematics(poses))[..., 2].min()
    poses[:, :3] += [0.5 * BLOCK_M, 0.5 * BLOCK_M, 0.03 - low]
    contacts = np.ones((3, 2), dtype=bool)
    motion = Motion(poses, 15.0, "stands", contacts)
    blocks = np.zeros((3, 2, 2), dtype=np.int64)
    feet = footing(character, Terrain(np.array([[0]])), motion, blocks)
    assert feet.off_height == pytest.approx([0.03, 0.03])
    assert not np.concatenate([feet.overhang, feet.sunk, feet.slide]).any()
    poses[:, 0] += 0.4 * BLOCK_M
    beyond = sole_corners(character, character.kinematics(poses))[0, 0, :, 0].max() - BLOCK_M
    motion = Motion(poses, 15.0, "over", contacts)
    feet = footing(character, Terrain(np.array([[0], [-2]])), motion, blocks)
    assert feet.overhang == pytest.approx([beyond, beyond], abs=1e-6)
    feet = footing(character, Terrain(np.array([[0], [3]])), motion, blocks)
    assert not feet.overhang.any()
    assert feet.sunk == pytest.approx(np.full(3, min(beyond, 3 * LEVEL_M - 0.03)), abs=1e-6)


@pytest.mark.mocap
@pytest.mark.slow
def test_recorded_steps_lead_over_random_terrain(
    motions_folder: Path, character: Character
) -> None:
    files = sorted((motions_folder / "cmu" / "03").glob("*.amc"))
    motions = [load_motion(file, options=LoadOptions(flat_floor=False)) for file in files]
    moved, _ = onto_blocks(character, motions)
    graph = TerrainGraph(MotionGraph.build(moved, BLOCKS), character)
    stances = slid = 0
    for seed in range(20):
        terrain = Terrain.random(np.random.default_rng(seed), 20, 20)
        goal = np.array(terrain.size) - 1.2
        start = start_on_terrain(graph, terrain, [1.2, 1.2], goal)
        walk = reach_on_terrain(graph, terrain, start, goal)
        assert walk.arrived
        assert walk.planning_s < 10.0
        check_walk(graph, terrain, walk, adapt=2)
        composed = compose_on_terrain(graph, terrain, walk, 60.0)
        blocks = walk_blocks(walk, 15.0, composed.motion)
        feet = footing(character, terrain, composed.motion, blocks)
        assert feet.off_height.max() < 0.01
        assert feet.overhang.max() < 0.01
        assert feet.sunk.max() < 0.03
        stances += len(feet.slide)
        slid += np.count_nonzero(feet.slide > 0.01)
    assert slid < 0.04 * stances
