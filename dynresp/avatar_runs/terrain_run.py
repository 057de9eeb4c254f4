"""An outing over rough terrain: blocks drawn at random, and a way over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynresp.avatar_runs.asked import Asked
from dynresp.avatar_runs.avatar_run import Outing
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

# Blocks along a side of the terrain. Those farther from the way than this [m] are not shown.
_SIDE = 20
_SHOWN_M = 2.0
# Where a walk begins that is told no place, in shares of the terrain's sides.
_CORNER, _OPPOSITE = 0.06, 0.94


def terrain_outing(
    graph: MotionGraph,
    character: Character,
    asked: Asked,
    seconds: float | None = None,
    fps: float = 30.0,
) -> Outing:
    """Walk over a terrain drawn from the seed.

    Args:
        graph: What is walked through, in coordinates of blocks.
        character: Whose body it is.
        asked: Where to, on the terrain, which reaches from 0 to 12.2 m along x and y; without path
            and goal from corner to corner.
        seconds: How long to wander, instead of going somewhere.
        fps: Frame rate of the motion [1/s].

    Raises:
        UsageError: What was asked lies beside the terrain.
        DynrespError: There is no way.
    """
    rng = np.random.default_rng(asked.seed)
    terrain = Terrain.random(rng, _SIDE, _SIDE)
    ways = TerrainGraph(graph, character)
    path, goal = asked.path, asked.goal
    at = _first(asked, terrain)
    end = np.array(terrain.size) * _OPPOSITE if goal is None else np.array(goal)
    toward = end if path is None else path[1]
    start = start_on_terrain(ways, terrain, at, toward)
    if seconds is not None:
        frames = max(2, round(seconds * graph.config.fps))
        walk = wander_on_terrain(ways, terrain, start, frames, rng)
    elif path is not None:
        walk = follow_on_terrain(ways, terrain, start, path)
    else:
        walk = reach_on_terrain(ways, terrain, start, end)
    composition = compose_on_terrain(ways, terrain, walk, fps)
    motion = composition.motion
    stands = footing(character, terrain, motion, walk_blocks(walk, graph.config.fps, motion))
    off = np.abs(stands.off_height[np.isfinite(stands.off_height)])
    told = "as far as asked" if walk.arrived else "not as far as asked: there is no way on"
    return Outing.of(
        composition,
        graph,
        title="A walk over rough terrain",
        subtitle=f"{told}; blocks of {terrain.block_m:.2f} m, steps of up to "
        f"{3 * terrain.level_m:.2f} m, seed {asked.seed}",
        blocks=shown_blocks(terrain, motion.root_positions),
        paths=[] if path is None else [GroundPath("sketch", path)],
        arrived=walk.arrived,
        about={
            "seed": asked.seed,
            "terrain": _about(walk, off),
        },
    )


def _first(asked: Asked, terrain: Terrain) -> Sequence[float] | FloatArray:
    """Where to begin [m]."""
    if asked.start is not None:
        return asked.start
    if asked.path is not None:
        return np.asarray(asked.path[0])
    return np.array(terrain.size) * _CORNER


def shown_blocks(terrain: Terrain, track: FloatArray) -> list[Block]:
    """The blocks near a way (n, 3), as they are shown."""
    centers, halves = terrain.boxes()
    away = np.linalg.norm(centers[:, None, :2] - track[None, ::5, :2], axis=-1).min(axis=1)
    return [
        Block((float(c[0]), float(c[1]), float(c[2])), (float(h[0]), float(h[1]), float(h[2])))
        for c, h in zip(centers[away < _SHOWN_M], halves[away < _SHOWN_M], strict=True)
    ]


def _about(walk: TerrainWalk, off: FloatArray) -> dict[str, object]:
    """What `result.json` says of a walk over blocks."""
    return {
        "arrived": walk.arrived,
        "off_goal_m": float(walk.off_goal) if np.isfinite(walk.off_goal) else None,
        "feet_off_height_worst_m": float(off.max()) if len(off) else 0.0,
        "states_looked_at": walk.looked,
        "stretches_taken_back": walk.taken_back,
    }
