"""Walks over rough terrain: to a goal, along a path, or at random, with every stance on a block.

The graph is in `Coordinates.BLOCKS`, of motion recorded over blocks (Lee et al. 2002, sections
4.1.2 and 6). The walk is found by best-first search with eq. 8 as the objective, and
backtracking: any state reached so far may be continued. A step is allowed only if
each standing foot is on a block.

45 s of recorded walking have few of the steps that a terrain needs. So a stance may be higher or
lower than recorded by whole levels, if the one before it is nearly as much, and a foot that would
stick out over an edge may be drawn in. Both cost, and `terrain_fitting` bends the legs accordingly.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.worlds.paths import as_path, as_point, check_length, resampled, window_m
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import LongArray
from dynresp.support.errors import UsageError

# Distance of the points of a path [m].
_SPACING = 0.1
# Most levels by which a stance may be higher or lower than recorded, seen from the last stance of
# the other foot; 0 allows recorded steps only.
_MAX_LEVEL_CHANGE = 2
# Largest distance by which a foot is drawn in from an edge, and distance that soles keep from
# edges [m].
_MAX_DRAW_M, _EDGE_M = 0.08, 0.01
# Largest distance of the root from the end at arrival [m].
_ARRIVAL_M = 0.3
# Most states to continue; then the search starts again, greedier, up to three times: _GREED is the
# weight of eq. 8 against the costs. The second budget is that of the search for a start, and of one
# stretch of a random walk.
_BUDGET, _STRETCH_BUDGET = 100_000, 10_000
_GREED = (1.0, 2.0, 4.0, 8.0)
# Most starts that are tried, and how long a walk from one must be [s].
_STARTS, _MIN_WALK_S = 300, 4.0
# Distance of the next goal of a random walk [m], from and to. The last number is how many goals are
# tried before a stretch is taken back, and how many stretches are taken back at most.
_MIN_GOAL_M, _MAX_GOAL_M, _TRIES = 1.5, 6.0, 20
# Cost of facing away from the wanted direction when a start is chosen [m/rad].
_TURN = 0.3


@dataclass(frozen=True, eq=False)
class TerrainWalk:
    """A walk over blocks. Arrays are read-only.

    Attributes:
        frames: (k,) the walk, beginning with the frame of the start.
        placements: (k, 4) placements of their clips: whole blocks and levels, quarter turns. Where
            steps are not as high as recorded, the height is the mean of the standing feet's levels.
        roots: (k, 4) x, y, z [m] and yaw [rad] of the root, as recorded and placed.
        blocks: (k, 2, 2) column and row of the block on which each foot stands; -1 if it does not
            stand.
        arrived: Whether it reaches the end; if not, no step leads on, or the budget was spent.
        off_goal: Distance of the last root from the goal [m]; NaN without a goal.
        looked: States that the search continued.
        taken_back: Stretches of a random walk that were taken back because they led nowhere.
        planning_s: Time that the search took [s].
    """

    frames: npt.NDArray[np.int32]
    placements: FloatArray
    roots: FloatArray
    blocks: LongArray
    arrived: bool
    off_goal: float
    looked: int
    taken_back: int
    planning_s: float


def start_on_terrain(
    graph: TerrainGraph,
    terrain: Terrain,
    at: npt.ArrayLike,
    toward: npt.ArrayLike,
) -> AvatarState:
    """Find a state to begin from: it stands near a point, faces another, and can walk on.

    Args:
        graph: The prepared graph.
        terrain: The blocks.
        at: (2,) where the root should be [m].
        toward: (2,) what it should face [m].

    Raises:
        UsageError: No frame of the graph stands on the blocks there and can go on.
    """
    graph.check(terrain)
    here, goal = as_point(at, "a start"), as_point(toward, "a point to face")
    frames = graph.graph.frames
    frames = frames[graph.stands[frames].any(axis=1)]
    cells, costs = [], []
    for turns in range(4):
        turn = np.array([0.0, 0.0, 0.0, 0.5 * np.pi * turns])
        roots = placement.compose(turn, graph.graph.database.planar[frames])
        shift = (here - np.array(terrain.corner) - roots[:, :2]) / terrain.block_m
        cells.append(np.round(shift).astype(np.int64))
        off = np.hypot(*(shift - cells[-1]).T) * terrain.block_m
        away = np.arctan2(*(goal - here)[::-1]) - roots[:, 3]
        costs.append(off + _TURN * np.abs(placement.wrapped(away)))
    for k in np.argsort(np.concatenate(costs), kind="stable")[:_STARTS]:
        turns, row = divmod(int(k), len(frames))
        frame = int(frames[row])
        cell_placement = graph.standing(terrain, frame, cells[turns][row], turns)
        if cell_placement is not None:
            state = AvatarState(frame, graph.meters(terrain, cell_placement))
            found = _search(graph, terrain, state, goal[None], _STRETCH_BUDGET)
            if found.arrived or len(found.frames) > _MIN_WALK_S * graph.graph.database.fps:
                return state
    raise UsageError(
        f"no frame of the graph stands on the blocks near {here} and goes on from there; take "
        f"a point inside the grid of {terrain.size[0]:g} x {terrain.size[1]:g} m, away from its "
        "border"
    )


def reach_on_terrain(
    graph: TerrainGraph,
    terrain: Terrain,
    start: AvatarState,
    goal: npt.ArrayLike,
) -> TerrainWalk:
    """Walk to a goal.

    Args:
        graph: The prepared graph.
        terrain: The blocks.
        start: Where it is; see `start_on_terrain`.
        goal: (2,) the goal [m].

    Raises:
        UsageError: The start does not stand on the blocks, or the goal is not on the grid.
    """
    end = as_point(goal, "a goal")
    if np.isnan(terrain.height(end)):
        raise UsageError(
            f"a goal must be x and y inside the grid of {terrain.size[0]:g} x "
            f"{terrain.size[1]:g} m, got {end}"
        )
    return _search(graph, terrain, start, end[None], _BUDGET)


def follow_on_terrain(
    graph: TerrainGraph,
    terrain: Terrain,
    start: AvatarState,
    sketch: npt.ArrayLike,
) -> TerrainWalk:
    """Walk along a sketched path.

    Args:
        graph: The prepared graph.
        terrain: The blocks.
        start: Where it is; see `start_on_terrain`. The path begins there even if the sketch
            does not.
        sketch: (k, 2) corners of a path on the ground [m].

    Raises:
        UsageError: The start does not stand on the blocks, or the sketch is not a path.
    """
    root = start.root(graph.graph)[:2]
    corners = as_path(sketch, "a sketch")
    if np.hypot(*(corners[0] - root)) > 2.0 * _SPACING:
        corners = np.concatenate([root[None], corners])
    check_length(corners, "the sketch, from where the avatar is on,")
    points = resampled(corners, _SPACING)
    return _search(graph, terrain, start, points, _BUDGET)


def wander_on_terrain(
    graph: TerrainGraph,
    terrain: Terrain,
    start: AvatarState,
    frames: int,
    rng: np.random.Generator,
) -> TerrainWalk:
    """Walk from one random goal to the next.

    Drawing step by step, as on level ground, would reach the next block with a stride that does not
    fit, and jump at the last moment. So each stretch is planned to its goal. If no further goal can
    be reached, the last stretch is taken back.

    Args:
        graph: The prepared graph.
        terrain: The blocks.
        start: Where it is; see `start_on_terrain`.
        frames: Number of frames to walk.
        rng: Source of random numbers.

    Returns:
        The walk; shorter, with `arrived` false, if no goal can be reached from the start.

    Raises:
        UsageError: The start does not stand on the blocks, or there is no frame to walk.
    """
    if frames < 1:
        raise UsageError(f"a walk needs at least 1 frame, got {frames}")
    began = time.perf_counter()
    stretches: list[TerrainWalk] = []
    played = looked = taken_back = tried = 0
    while played < frames:
        at = start
        if stretches:
            at = AvatarState(int(stretches[-1].frames[-1]), stretches[-1].placements[-1])
        goal = _random_goal(terrain, at.root(graph.graph)[:2], rng)
        found = _search(graph, terrain, at, goal[None], _STRETCH_BUDGET)
        looked += found.looked
        tried += 1
        if found.arrived:
            stretches.append(found)
            played += len(found.frames) - 1
            tried = 0
        elif tried == _TRIES:
            if not stretches or taken_back == _TRIES:
                break
            played -= len(stretches.pop().frames) - 1
            taken_back += 1
            tried = 0
    walked = np.concatenate([[start.frame], *(stretch.frames[1:] for stretch in stretches)])
    placements = np.concatenate(
        [start.placement[None], *(stretch.placements[1:] for stretch in stretches)]
    )
    return _walk(
        graph, terrain, walked[: frames + 1], placements[: frames + 1],
        played >= frames, np.full(2, np.nan), looked, taken_back, began,
    )  # fmt: skip


def _random_goal(terrain: Terrain, here: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A point on the grid, 1.5 to 6 m away if the grid is large enough."""
    for _ in range(_TRIES):
        goal = terrain.corner + rng.random(2) * terrain.size
        if _MIN_GOAL_M <= np.hypot(*(goal - here)) <= _MAX_GOAL_M:
            break
    return np.asarray(goal)


def _search(
    graph: TerrainGraph, terrain: Terrain, start: AvatarState, path: FloatArray, budget: int
) -> TerrainWalk:
    """Search along a path (p, 2), points _SPACING apart or the goal alone [m]."""
    from dynresp.locomotion.worlds import terrain_walk_kernel as kernel

    began = time.perf_counter()
    begin = _begin(graph, terrain, start)
    fps = graph.graph.database.fps
    over = graph.over + _EDGE_M
    over.flags.writeable = False
    feet = kernel.FeetArrays(graph.stands, graph.blocks, graph.levels, over)
    motions = kernel.GraphArrays(
        graph.graph.offsets, graph.graph.targets, graph.graph.distances, graph.moves, graph.planar
    )
    points = np.ascontiguousarray(path - terrain.corner)
    grid = terrain.levels.astype(np.int64)
    looked = 0
    for greed in _GREED:
        settings = kernel.WalkSettings(
            max_level_change=float(_MAX_LEVEL_CHANGE),
            max_draw_m=_MAX_DRAW_M,
            arrival_m=_ARRIVAL_M,
            spacing_m=_SPACING,
            block_m=float(terrain.block_m),
            frame_s=float(1.0 / fps),
            greed=greed,
            window=int(np.ceil(window_m(fps) / _SPACING)),
            budget=budget,
        )
        found = kernel.search_kernel(start.frame, begin, points, settings, motions, feet, grid)
        looked += found.looked
        if found.arrived or found.looked < budget:
            break
    frames = np.concatenate([[start.frame], found.frames])
    placements = np.concatenate([start.placement[None], graph.meters(terrain, found.placements)])
    return _walk(graph, terrain, frames, placements, found.arrived, path[-1], looked, 0, began)


def _begin(graph: TerrainGraph, terrain: Terrain, start: AvatarState) -> LongArray:
    """The state (6,) at which the search begins: a cell placement, and the lifts of both feet."""
    graph.check(terrain)
    check_in_component(graph.graph, start.frame)
    cell_placement = graph.cell_placement(terrain, start.placement)
    lifts = np.zeros(2, dtype=np.int64)
    stands = np.flatnonzero(graph.stands[start.frame])
    blocks = graph.blocks_under(terrain, [start.frame], start.placement[None])[0, stands]
    if (blocks < 0).any():
        raise UsageError("the start stands beside the grid; start_on_terrain gives one that does")
    if len(stands):
        lift = terrain.levels[tuple(blocks.T)] - graph.levels[start.frame, stands]
        lift = lift - cell_placement[2]
        # A foot in the air has the lift of the other one.
        lifts[:] = lift[0]
        lifts[stands] = lift
    return np.concatenate([cell_placement, lifts])


def _walk(
    graph: TerrainGraph,
    terrain: Terrain,
    frames: LongArray,
    placements: FloatArray,
    arrived: bool,
    goal: FloatArray,
    looked: int,
    taken_back: int,
    began: float,
) -> TerrainWalk:
    """A walk from its frames (k,) and placements (k, 4); see `TerrainWalk`."""
    played = frames.astype(np.int32)
    blocks = graph.blocks_under(terrain, played, placements)
    stands = blocks[..., 0] >= 0
    tops = terrain.levels[tuple(np.moveaxis(blocks, -1, 0))] - graph.levels[played]
    feet = stands.sum(axis=1)
    # In the air the height is that of the last stance; a walk begins on the ground.
    last = np.maximum.accumulate(np.where(feet > 0, np.arange(len(played)), 0))
    level = np.round(np.where(stands, tops, 0).sum(axis=1) / np.maximum(feet, 1))[last]
    placements = placements.copy()
    if feet[0] > 0:
        placements[:, 2] = level * terrain.level_m
    roots = placement.compose(placements, graph.graph.database.planar[played])
    for array in (played, placements, roots, blocks):
        array.flags.writeable = False
    off = float(np.hypot(*(roots[-1, :2] - goal)))
    spent = time.perf_counter() - began
    return TerrainWalk(played, placements, roots, blocks, arrived, off, looked, taken_back, spent)
