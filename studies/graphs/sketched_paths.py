"""Walks along sketches: distance to random smooth paths, and planning time.

The paths are 20 m long, on open ground, with random bends of more than a metre's radius. Every
other walk has to end standing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.avatar_runs.sketch_run import standing_at
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SketchedWalk
from dynresp.locomotion.sketch.sketch_control import follow_sketch
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from studies.graphs.graph_study import FLAT, of_graphs
from studies.study import Study, Target, Value

LENGTH_M, BEND_PER_M = 20.0, 0.8
"""How long the paths are [m], and how much they bend at most [1/m]."""
# Corners of a path, and over how many of them bends are smoothed (standard deviation).
_CORNERS, _SMOOTH = 400, 30
# How far along a path the avatar faces at first [corners]: a quarter of a metre.
_FACED_CORNER = 5


@dataclass(frozen=True, eq=False)
class Followed:
    """A walk along a path.

    Attributes:
        path: (k, 2) its corners [m].
        stop: Whether the walk has to end standing.
        walk: The walk.
    """

    path: FloatArray
    stop: bool
    walk: SketchedWalk


def smooth_path(rng: np.random.Generator) -> FloatArray:
    """(k, 2) corners of a random smooth path that begins at the origin [m]."""
    from scipy.ndimage import gaussian_filter1d

    # Both ends are cut off: the filter has no data beyond them.
    rim, step = 100, LENGTH_M / _CORNERS
    bend = gaussian_filter1d(rng.normal(0.0, 1.0, _CORNERS + 2 * rim), _SMOOTH)[rim:-rim]
    bend *= BEND_PER_M * rng.random() / np.abs(bend).max()
    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(bend) * step
    steps = step * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)])


def follow_smooth_paths(search: SearchGraph, count: int, seed: int) -> list[Followed]:
    """Walk along random smooth paths.

    Args:
        search: The graph.
        count: Number of paths.
        seed: Of the paths.
    """
    out = []
    for k in range(count):
        path, stop = smooth_path(np.random.default_rng([seed, k])), k % 2 == 1
        start = standing_on(search.graph, path, _FACED_CORNER)
        out.append(Followed(path, stop, follow_sketch(search, start, path, stop=stop)))
    return out


def standing_on(graph: MotionGraph, path: FloatArray, faced: int) -> AvatarState:
    """Standing at the beginning of a path (k, 2), and facing a later corner of it."""
    return standing_at(graph, (float(path[0, 0]), float(path[0, 1])), path[faced])


def real_time_ratios(walks: list[SketchedWalk], fps: float) -> FloatArray:
    """How many times faster than it is walked each walk was planned."""
    return np.array([(len(walk.frames) - 1) / fps / walk.planning_s for walk in walks])


def warm_up(search: SearchGraph) -> None:
    """Compile what is compiled, so that it is not timed."""
    path = np.array([(0.0, 0.0), (1.0, 0.0)])
    follow_sketch(search, standing_on(search.graph, path, 1), path)


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Walk along random smooth paths.

    Args:
        graph: The graph.
        character: The character.
        count: Paths.
        seed: Of the paths.
    """
    search = SearchGraph(graph, character)
    warm_up(search)
    followed = follow_smooth_paths(search, count, seed)
    walks = [one.walk for one in followed]
    means = np.array([walk.off_path.mean() for walk in walks])
    ratios = real_time_ratios(walks, graph.config.fps)
    return {
        "paths": count,
        "arrived": sum(walk.arrived for walk in walks),
        "off_path_mean_m": float(means.mean()),
        "off_path_mean_of_the_worst_path_m": float(means.max()),
        "off_path_farthest_m": float(max(walk.off_path.max() for walk in walks)),
        "walking_s": float(sum(len(walk.frames) - 1 for walk in walks)) / graph.config.fps,
        "planning_s": float(sum(walk.planning_s for walk in walks)),
        "times_real_time_median": float(np.median(ratios)),
        "times_real_time_least": float(ratios.min()),
    }


STUDY = Study(
    "sketches",
    "walks along random smooth paths: how near they keep to them, and how fast they are planned",
    "1 min",
    of_graphs(measure, FLAT, 50, 2),
    (
        Target("arrived", "all", at_least="paths"),
        Target("off_path_mean_of_the_worst_path_m", "under 0.25 m", at_most=0.25),
        Target("times_real_time_least", "at least 10", at_least=10.0),
    ),
    notes=(
        "Smooth paths of 20 m on open ground. The distance is that of the root, in every frame, to "
        "the nearest point of the path.",
    ),
)
