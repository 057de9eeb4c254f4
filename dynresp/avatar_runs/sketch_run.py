"""An outing along a sketch: from what was asked to what the avatar did."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynresp.avatar_runs.asked import Asked
from dynresp.avatar_runs.avatar_run import Outing
from dynresp.avatar_runs.terrain_run import terrain_outing
from dynresp.avatar_runs.world_setup import TERRAIN, blocks_of
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.playing.composition import compose
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SketchedWalk
from dynresp.locomotion.sketch.sketch_control import follow_sketch, reach
from dynresp.locomotion.worlds.maze import random_maze
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.paths import distances_to
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.progress import Progress
from dynresp.view.story import GroundPath


def sketch_outing(
    graph: MotionGraph,
    character: Character,
    asked: Asked,
    world: World | None = None,
    fps: float = 30.0,
    progress: Progress | None = None,
) -> Outing:
    """Walk along a sketch.

    Args:
        graph: What is walked through.
        character: Whose body it is.
        asked: Where to.
        world: Obstacles.
        fps: Frame rate of the motion [1/s].
        progress: Told the stage, how much is done, and of how much.

    Raises:
        UsageError: What was asked contradicts itself or lacks something.
        DynrespError: There is no way between the obstacles.
    """
    path, goal, start = asked.path, asked.goal, asked.start
    if path is not None and goal is not None:
        raise UsageError("give a path by --points or --path, or a place to reach by --goal")
    if path is not None and len(path) < 2:
        raise UsageError(f"a path needs two corners or more, got {len(path)}")
    if graph.database.world == TERRAIN:
        if asked.maze or world is not None:
            raise UsageError("over rough terrain there are no obstacles; leave out --world, --maze")
        return terrain_outing(graph, character, asked, fps=fps)
    if graph.config.coordinates is Coordinates.FIXED:
        raise UsageError(
            f"the graph holds motion that belongs to places of its world "
            f"({graph.database.world!r}), and a sketch needs motion that can be put anywhere; walk "
            "through this one by `dynresp graph walk --choose`"
        )
    if asked.maze:
        if world is not None:
            raise UsageError("give obstacles by --world or by --maze, not by both")
        maze = random_maze(np.random.default_rng(asked.seed))
        world = maze.world
        if path is None and goal is None:
            goal = (float(maze.solution[-1, 0]), float(maze.solution[-1, 1]))
        if path is None and start is None:
            start = (float(maze.solution[0, 0]), float(maze.solution[0, 1]))
    if path is None and goal is None:
        raise UsageError("give a path by --points or --path, or a place to reach by --goal")
    if start is None:
        start = (0.0, 0.0) if path is None else (float(path[0, 0]), float(path[0, 1]))
    if world is not None:
        _refuse_inside(world, start, "the start")
        if goal is not None:
            _refuse_inside(world, goal, "the goal")
    search = SearchGraph(graph, character)
    state = standing_at(graph, start, path[1] if path is not None else goal)
    if path is not None:
        walk = follow_sketch(search, state, path, world, progress=progress)
    else:
        assert goal is not None
        walk = reach(search, state, goal, world, progress=progress)
    if len(walk.frames) < 2:
        raise DynrespError(
            f"there is no way on from {start[0]:g},{start[1]:g}: every one would touch an obstacle "
            "at once; begin farther from it"
        )
    composition = compose(graph, character, walk.frames, walk.placements[0], fps)
    drawn = [] if path is None else [GroundPath("sketch", path)]
    if path is None or world is not None:
        found = "way to the goal" if world is None else "way between the obstacles"
        drawn.append(GroundPath(found, walk.path))
    mean = float(walk.off_path.mean())
    seconds = (len(walk.frames) - 1) / graph.config.fps
    return Outing.of(
        composition,
        graph,
        title="A walk along a sketch" if path is not None else "A walk to a goal",
        subtitle=f"{'arrived' if walk.arrived else 'did not arrive'}, on average {mean:.2f} m off "
        "the path",
        blocks=blocks_of(world, walk.roots[:, :2]),
        paths=drawn,
        bounds=None if world is None else world.bounds,
        arrived=walk.arrived,
        about={"sketch": _about(walk, path, seconds), "maze": asked.seed if asked.maze else None},
    )


def standing_at(graph: MotionGraph, start: tuple[float, float], towards: Any) -> AvatarState:
    """A state at a place that faces another: a frame in which the avatar stands stillest.

    Args:
        graph: Whose frame.
        start: The place [m].
        towards: (2,) what it faces [m].
    """
    database = graph.database
    frames = graph.frames
    calm = np.abs(database.velocities[frames]).max(axis=1)
    standing = database.contacts[frames, :2].all(axis=1)
    calm = np.where(standing, calm, calm + 100.0)
    frame = int(frames[np.argmin(calm)])
    way = np.asarray(towards) - np.asarray(start)
    return AvatarState.at(graph, frame, *start, float(np.arctan2(way[1], way[0])))


def _refuse_inside(world: World, place: tuple[float, float], what: str) -> None:
    """Refuse a place where nobody can stand.

    Raises:
        UsageError: It is in a box, or beyond the bounds.
    """
    if float(world.distances(np.array(place))) <= 0.0:
        raise UsageError(
            f"{what}, {place[0]:g},{place[1]:g}, is in an obstacle or beyond the bounds "
            f"{world.bounds}; choose another"
        )


def _about(walk: SketchedWalk, sketch: FloatArray | None, seconds: float) -> dict[str, Any]:
    """What `result.json` says of a walk along a sketch.

    The time that planning took is left out: the same command gives the same bytes.
    """
    off_sketch = None
    if sketch is not None:
        off_sketch = float(distances_to(walk.roots[:, :2], sketch).max())
    return {
        "arrived": walk.arrived,
        "off_path_mean_m": float(walk.off_path.mean()),
        "off_path_worst_m": float(walk.off_path.max()),
        # The path walked along is bent around obstacles; this tells how far corners were missed.
        "off_sketch_worst_m": off_sketch,
        "walking_s": seconds,
        "ways_looked_at": walk.looked,
        "ways_dropped_for_collisions": walk.collided,
        "stretches_taken_back": walk.backtracks,
        "places_closed": walk.detours,
    }
