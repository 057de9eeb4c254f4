"""A walk over rough terrain: blocks drawn at random, and a path over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.terrain_fitting import compose_on_terrain, footing, walk_blocks
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.locomotion.worlds.terrain_walk import (
    TerrainWalk,
    follow_on_terrain,
    reach_on_terrain,
    start_on_terrain,
    wander_on_terrain,
)
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.view.story import Block, GroundPath

# Blocks along each side of the terrain. Blocks farther than this from the walk [m] are not shown.
_SIDE = 20
_SHOWN_M = 2.0
# Usual start and goal, as shares of the terrain's sides.
_USUAL_START, _USUAL_GOAL = 0.06, 0.94


def terrain_run(
    graph: MotionGraph,
    character: Character,
    *,
    path: FloatArray | None = None,
    goal: tuple[float, float] | None = None,
    start: tuple[float, float] | None = None,
    seconds: float | None = None,
    seed: int = 0,
    fps: float = 30.0,
) -> AvatarRun:
    """Walk over a terrain that is drawn from the seed, from 0 to 12.2 m along x and y.

    Without `path`, `goal` and `seconds` the avatar goes from corner to corner.

    Args:
        graph: The motion graph, in coordinates of blocks.
        character: The avatar's body.
        path: (k, 2) corners of a path to follow [m].
        goal: Where to go instead (x, y) [m].
        start: Where to begin (x, y) [m]; by default where the path does, else in the corner.
        seconds: Wander this long instead of going somewhere [s].
        seed: Seed of the terrain, and of wandering.
        fps: Frame rate of the motion [1/s].

    Raises:
        UsageError: The path, goal or start is not on the terrain.
        DynrespError: No step leads on.

    Example:
        ::

            graph = dynresp.build_graph("terrain")
            run = terrain_run(graph, default_character(), goal=(10.0, 4.0), seed=3)
            run.save("terrain")
    """
    rng = np.random.default_rng(seed)
    terrain = Terrain.random(rng, _SIDE, _SIDE)
    steps = TerrainGraph(graph, character)
    begin = _start(start, path, terrain)
    end = np.array(terrain.size) * _USUAL_GOAL if goal is None else np.array(goal)
    state = start_on_terrain(steps, terrain, begin, end if path is None else path[1])
    if seconds is not None:
        frames = max(2, round(seconds * graph.config.fps))
        walk = wander_on_terrain(steps, terrain, state, frames, rng)
    elif path is not None:
        walk = follow_on_terrain(steps, terrain, state, path)
    else:
        walk = reach_on_terrain(steps, terrain, state, end)
    composition = compose_on_terrain(steps, terrain, walk, fps)
    motion = composition.motion
    stands = footing(character, terrain, motion, walk_blocks(walk, graph.config.fps, motion))
    off_height = np.abs(stands.off_height[np.isfinite(stands.off_height)])
    outcome = "arrived" if walk.arrived else "did not arrive: no step leads on"
    return AvatarRun.of(
        composition,
        graph,
        character,
        title="A walk over rough terrain",
        subtitle=f"{outcome}; blocks of {terrain.block_m:.2f} m, steps of up to "
        f"{3 * terrain.level_m:.2f} m, seed {seed}",
        blocks=shown_blocks(terrain, motion.root_positions),
        paths=[] if path is None else [GroundPath("sketch", path)],
        arrived=walk.arrived,
        about={"seed": seed, "terrain": _about(walk, off_height)},
    )


def _start(
    start: tuple[float, float] | None, path: FloatArray | None, terrain: Terrain
) -> Sequence[float] | FloatArray:
    """Where to begin (x, y) [m]."""
    if start is not None:
        return start
    if path is not None:
        return np.asarray(path[0])
    return np.array(terrain.size) * _USUAL_START


def shown_blocks(terrain: Terrain, track: FloatArray) -> list[Block]:
    """The blocks near a track (n, 3) [m], as pictures show them."""
    centers, halves = terrain.boxes()
    away = np.linalg.norm(centers[:, None, :2] - track[None, ::5, :2], axis=-1).min(axis=1)
    return [
        Block((float(c[0]), float(c[1]), float(c[2])), (float(h[0]), float(h[1]), float(h[2])))
        for c, h in zip(centers[away < _SHOWN_M], halves[away < _SHOWN_M], strict=True)
    ]


def _about(walk: TerrainWalk, off_height: FloatArray) -> dict[str, object]:
    """What `result.json` says of a walk over blocks."""
    return {
        "arrived": walk.arrived,
        "off_goal_m": float(walk.off_goal) if np.isfinite(walk.off_goal) else None,
        "feet_off_height_worst_m": float(off_height.max()) if len(off_height) else 0.0,
        "states_looked_at": walk.looked,
        "stretches_taken_back": walk.taken_back,
    }
