"""Walk along a drawn path, or to a point: control by sketch (Lee et al. 2002, section 5.2)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SPACING, Follower, SketchedWalk
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.path_planning import fit_path, plan_path
from dynresp.locomotion.worlds.paths import as_path, as_point, check_length, resampled
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError
from dynresp.support.progress import Progress


def follow_sketch(
    graph: SearchGraph,
    start: AvatarState,
    sketch: npt.ArrayLike,
    world: World | None = None,
    stop: bool = False,
    progress: Progress | None = None,
) -> SketchedWalk:
    """Walk along a sketch by incremental best-first search: the paper's second method.

    Each search looks 2.5 m ahead (`HORIZON_M`), and the first second of its result is played
    (`COMMIT_S`). In a world the sketch is first bent to keep clear of obstacles, and edges that
    touch one are dropped. Where a search finds nothing, others start farther back; if they fail as
    well, the place is closed and the path is planned around it.

    Args:
        graph: The graph to walk through.
        start: Where the avatar is. Its path starts there even if the sketch does not.
        sketch: (k, 2) corners of a path on the ground, at most 1 km, from the avatar on [m].
        world: Obstacles; None for open ground.
        stop: Whether the walk must end standing; otherwise the avatar may be walking there.
        progress: Called with the state of the work.

    Raises:
        UsageError: The sketch is no path or too long, or the start is not in the graph's component.
        DynrespError: There is no path between the obstacles.
    """
    _check_kinds(graph, start, world, stop)
    follower = Follower(graph, start, world, stop, progress)
    root = follower.begin
    corners = as_path(sketch, "a sketch")
    if np.hypot(*(corners[0] - root)) > 2.0 * SPACING:
        corners = np.concatenate([root[None], corners])
    check_length(corners, "the sketch, from where the avatar is on,")
    points = resampled(corners, SPACING)

    def path_from(closed: FloatArray) -> FloatArray:
        if world is None:
            return points
        return fit_path(world, points, blocked=closed)

    return follower.walk(path_from)


def reach(
    graph: SearchGraph,
    start: AvatarState,
    goal: npt.ArrayLike,
    world: World | None = None,
    stop: bool = False,
    progress: Progress | None = None,
) -> SketchedWalk:
    """Walk to a point on the ground; a planned path serves as the sketch.

    Args:
        graph: The graph to walk through.
        start: Where the avatar is.
        goal: (2,) x and y of the point, at most 1 km away [m].
        world: Obstacles; None for open ground.
        stop: Whether the walk must end standing; otherwise the avatar may be walking there.
        progress: Called with the state of the work.

    Raises:
        UsageError: The goal is no point or too far away, or the start is not in the graph's
            component.
        DynrespError: There is no path between the obstacles.
    """
    _check_kinds(graph, start, world, stop)
    follower = Follower(graph, start, world, stop, progress)
    root = follower.begin
    end = as_point(goal, "a goal")
    check_length(np.stack([root, end]), "the straight line to the goal")

    def path_from(closed: FloatArray) -> FloatArray:
        if world is None:
            return np.stack([root, end])
        return plan_path(world, root, end, blocked=closed)

    return follower.walk(path_from)


def _check_kinds(graph: SearchGraph, start: AvatarState, world: World | None, stop: bool) -> None:
    """Check the types of the arguments.

    Raises:
        UsageError: One has a wrong type; the message says how to make the right one.
    """
    expected = (
        (graph, SearchGraph, "the graph", "a SearchGraph, made by SearchGraph(graph)"),
        (
            start,
            AvatarState,
            "the start",
            "an AvatarState, made by AvatarState.at(...)",
        ),
        (world, World | None, "the world", "a World of boxes, or None"),
        (stop, bool, "stop", "True or False"),
    )
    for given, kind, what, right in expected:
        if not isinstance(given, kind):
            raise UsageError(f"{what} must be {right}, got {type(given).__name__}")
