"""Control by sketch: the avatar walks along a path drawn on the ground (Lee et al. 2002, 5.2)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SPACING, Follower, SketchConfig, SketchedWalk
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
    config: SketchConfig | None = None,
    progress: Progress | None = None,
) -> SketchedWalk:
    """Walk along a sketch, by incremental best-first search: the paper's second way.

    The search looks for a way to `horizon_m` ahead, of which the first `commit_s` are played; from
    there it goes on. In a world the sketch is first bent to keep clear of obstacles, and ways that
    touch one are dropped. Where no way is left, the search begins anew farther back; where that
    does not help, the place is closed and the path planned around it.

    Args:
        graph: Where the avatar walks through.
        start: Where it is. Its path begins there even if the sketch does not.
        sketch: (k, 2) corners of a path on the ground, at most 1 km with the way there [m].
        world: Obstacles; None for open ground.
        config: How it is followed.
        progress: Told how far it is.

    Raises:
        UsageError: The sketch is none or too long, or the start is not in the graph's component.
        DynrespError: There is no way between the obstacles.
    """
    _check_kinds(graph, start, world, config)
    follower = Follower(graph, start, world, config, progress)
    config, root = follower.config, follower.begin
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
    config: SketchConfig | None = None,
    progress: Progress | None = None,
) -> SketchedWalk:
    """Walk to a place: a planned path serves as the sketch.

    Args:
        graph: Where the avatar walks through.
        start: Where it is.
        goal: (2,) the place, at most 1 km away [m].
        world: Obstacles; None for open ground.
        config: How the path is followed.
        progress: Told how far it is.

    Raises:
        UsageError: The goal is none or too far away, or the start is not in the graph's component.
        DynrespError: There is no way between the obstacles.
    """
    _check_kinds(graph, start, world, config)
    follower = Follower(graph, start, world, config, progress)
    config, root = follower.config, follower.begin
    end = as_point(goal, "a goal")
    check_length(np.stack([root, end]), "the straight way to the goal")

    def path_from(closed: FloatArray) -> FloatArray:
        if world is None:
            return np.stack([root, end])
        return plan_path(world, root, end, blocked=closed)

    return follower.walk(path_from)


def _check_kinds(
    graph: SearchGraph, start: AvatarState, world: World | None, config: SketchConfig | None
) -> None:
    """Refuse what is something else.

    Raises:
        UsageError: Something is; the message says how the right one is made.
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
        (config, SketchConfig | None, "the configuration", "a SketchConfig, or None"),
    )
    for given, kind, what, right in expected:
        if not isinstance(given, kind):
            raise UsageError(f"{what} must be {right}, got {type(given).__name__}")
