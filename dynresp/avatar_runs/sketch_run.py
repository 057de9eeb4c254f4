"""A walk along a drawn path, or to a goal, around obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.avatar_runs.terrain_run import terrain_run
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
from dynresp.support.progress import Progress, no_progress
from dynresp.view.story import GroundPath

Point = tuple[float, float]

_EITHER = "give either a path (--points or --path) or a goal (--goal)"


def sketch_run(
    graph: MotionGraph,
    character: Character,
    *,
    path: FloatArray | None = None,
    goal: Point | None = None,
    start: Point | None = None,
    world: World | None = None,
    maze: bool = False,
    seed: int = 0,
    fps: float = 30.0,
    progress: Progress = no_progress,
) -> AvatarRun:
    """Walk along a path, or to a goal; `dynresp graph sketch` does this.

    In a maze without path and goal the avatar goes from corner to corner. With a graph of rough
    terrain it walks as `terrain_run` does.

    Args:
        graph: The motion graph.
        character: The avatar's body.
        path: (k, 2) corners of the path to follow [m].
        goal: Where to go instead (x, y) [m]; the path is then planned.
        start: Where to begin (x, y) [m]; by default where the path does.
        world: Obstacles.
        maze: Whether the obstacles are a random maze, drawn from the seed.
        seed: Seed of the maze, or of the terrain.
        fps: Frame rate of the motion [1/s].
        progress: Called with the stage, how many steps are done, and of how many.

    Raises:
        UsageError: The arguments contradict each other, or path and goal are missing.
        DynrespError: No path leads between the obstacles.

    Example:
        >>> import dynresp
        >>> import numpy as np
        >>> from dynresp.motion.character import default_character
        >>> graph = dynresp.build_graph("builtin")
        >>> path = np.array([[0.0, 0.0], [4.0, 0.0], [6.0, 3.0]])
        >>> run = sketch_run(graph, default_character(), path=path)
        >>> run.arrived
        True
        >>> content = run.save("sketch", video=False)
    """
    if path is not None and goal is not None:
        raise UsageError(f"{_EITHER}, got both")
    if path is not None and len(path) < 2:
        raise UsageError(f"a path needs two corners or more, got {len(path)}")
    if graph.database.world == TERRAIN:
        if maze or world is not None:
            raise UsageError("over rough terrain there are no obstacles; leave out --world, --maze")
        return terrain_run(graph, character, path=path, goal=goal, start=start, seed=seed, fps=fps)
    if graph.config.coordinates is Coordinates.FIXED:
        raise UsageError(
            "to follow a sketch the motion must fit anywhere, and the motion of this graph belongs "
            f"to places of its world ({graph.database.world!r}); use `dynresp graph walk`, or "
            "`choice_run` in Python"
        )
    if maze:
        if world is not None:
            raise UsageError("give obstacles either by --world or by --maze, got both")
        drawn = random_maze(np.random.default_rng(seed))
        world = drawn.world
        if path is None:
            start = _point(drawn.solution[0]) if start is None else start
            goal = _point(drawn.solution[-1]) if goal is None else goal
    if path is None and goal is None:
        raise UsageError(f"{_EITHER}, got none of them")
    if start is None:
        start = (0.0, 0.0) if path is None else _point(path[0])
    walk = _walk(graph, character, path, goal, start, world, progress)
    composition = compose(graph, character, walk.frames, walk.placements[0], fps)
    lines = [] if path is None else [GroundPath("sketch", path)]
    if path is None or world is not None:
        planned = "path to the goal" if world is None else "path between the obstacles"
        lines.append(GroundPath(planned, walk.path))
    outcome = "arrived" if walk.arrived else "did not arrive"
    seconds = (len(walk.frames) - 1) / graph.config.fps
    return AvatarRun.of(
        composition,
        graph,
        character,
        title="A walk along a sketch" if path is not None else "A walk to a goal",
        subtitle=f"{outcome}, on average {float(walk.off_path.mean()):.2f} m off the path",
        blocks=blocks_of(world, walk.roots[:, :2]),
        paths=lines,
        bounds=None if world is None else world.bounds,
        arrived=walk.arrived,
        about={"sketch": _about(walk, path, seconds), "maze": seed if maze else None},
    )


def _walk(
    graph: MotionGraph,
    character: Character,
    path: FloatArray | None,
    goal: Point | None,
    start: Point,
    world: World | None,
    progress: Progress,
) -> SketchedWalk:
    """Search the walk along a path, or to a goal where there is no path."""
    if world is not None:
        _refuse_inside(world, start, "the start")
        if goal is not None:
            _refuse_inside(world, goal, "the goal")
    search = SearchGraph(graph, character)
    if path is not None:
        state = standing_at(graph, start, path[1])
        walk = follow_sketch(search, state, path, world, progress=progress)
    else:
        assert goal is not None
        walk = reach(search, standing_at(graph, start, goal), goal, world, progress=progress)
    if len(walk.frames) < 2:
        raise DynrespError(
            f"no step leads on from {start[0]:g},{start[1]:g}: every one would touch an obstacle; "
            "begin farther from it"
        )
    return walk


def standing_at(graph: MotionGraph, start: Point, facing: Any) -> AvatarState:
    """A state at a place, facing a point, in the frame in which the avatar stands stillest.

    Args:
        graph: The graph of the frame.
        start: The place (x, y) [m].
        facing: (2,) the point that it faces [m].
    """
    database = graph.database
    frames = graph.frames
    speeds = np.abs(database.velocities[frames]).max(axis=1)
    standing = database.contacts[frames, :2].all(axis=1)
    frame = int(frames[np.argmin(np.where(standing, speeds, speeds + 100.0))])
    direction = np.asarray(facing) - np.asarray(start)
    return AvatarState.at(graph, frame, *start, float(np.arctan2(direction[1], direction[0])))


def _point(corner: FloatArray) -> Point:
    return float(corner[0]), float(corner[1])


def _refuse_inside(world: World, point: Point, what: str) -> None:
    """Refuse a point where nobody can stand.

    Raises:
        UsageError: It is in a box, or beyond the bounds.
    """
    if float(world.distances(np.array(point))) <= 0.0:
        raise UsageError(
            f"{what}, {point[0]:g},{point[1]:g}, is in an obstacle or beyond the bounds "
            f"{world.bounds}; choose another"
        )


def _about(walk: SketchedWalk, sketch: FloatArray | None, seconds: float) -> dict[str, Any]:
    """What `result.json` says of a walk along a sketch.

    It leaves out how long planning took: the same command writes the same bytes.
    """
    off_sketch = None
    if sketch is not None:
        off_sketch = float(distances_to(walk.roots[:, :2], sketch).max())
    return {
        "arrived": walk.arrived,
        "off_path_mean_m": float(walk.off_path.mean()),
        "off_path_worst_m": float(walk.off_path.max()),
        # The path that is followed bends around obstacles; this is the distance to the drawn one.
        "off_sketch_worst_m": off_sketch,
        "walking_s": seconds,
        "ways_looked_at": walk.looked,
        "ways_dropped_for_collisions": walk.collided,
        "stretches_taken_back": walk.backtracks,
        "places_closed": walk.detours,
    }
