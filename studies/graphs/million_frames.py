"""A million frames of a random walk: whether it ever ends, and how fast it is made."""

from __future__ import annotations

import time

import numpy as np

from dynresp.avatar_runs.world_setup import FLAT
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from studies.graphs.graph_study import WORLDS, of_graphs
from studies.study import Study, Target, Value

FITTED = 100_000
"""Most frames whose feet are fitted."""
_STRETCH, _WARM = 25_000, 300


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Make a random walk, play it, and fit its feet on level ground.

    Args:
        graph: The graph.
        character: The character.
        count: Frames, 2 at least.
        seed: Of the walk.
    """
    rng = np.random.default_rng(seed)
    random_walk(graph, _WARM, rng)
    start = time.perf_counter()
    path = random_walk(graph, count, rng)
    walking_s = time.perf_counter() - start
    Playback(graph, int(path[0])).play(path[1:_WARM])
    playing_s, broken = _played(graph, path)
    figures: dict[str, Value] = {
        "frames": count,
        "dead_ends": int(np.count_nonzero(np.diff(graph.offsets)[path] == 0)),
        "frames_off_the_graph": off_the_graph(graph, path),
        "frames_not_finite": broken,
        "frames_of_the_component_met": len(np.unique(path)) / len(graph.frames),
        "jumps": float(np.mean(graph.database.successors[path[:-1]] != path[1:])),
        "walked_per_s": count / walking_s,
        "played_per_s": count / (walking_s + playing_s),
    }
    if graph.database.world == FLAT:
        compose(graph, character, path[:_WARM])
        fitting_s, broken, fitted = 0.0, 0, path[: min(FITTED, count)]
        for at in range(0, len(fitted) - 1, _STRETCH):
            start = time.perf_counter()
            made = compose(graph, character, fitted[at : at + _STRETCH])
            fitting_s += time.perf_counter() - start
            broken += _broken(made.motion.poses)
        figures["fitted_frames"] = len(fitted)
        figures["fitted_not_finite"] = broken
        figures["fitted_per_s"] = len(fitted) / (fitting_s + walking_s * len(fitted) / count)
    return figures


def off_the_graph(graph: MotionGraph, path: IntArray) -> int:
    """How many steps of a walk are not edges of the graph."""
    n = len(graph.database)
    edges = np.sort(graph.sources.astype(np.int64) * n + graph.targets)
    steps = path[:-1].astype(np.int64) * n + path[1:]
    at = np.searchsorted(edges, steps).clip(0, len(edges) - 1)
    return int(np.count_nonzero(edges[at] != steps))


def _played(graph: MotionGraph, path: IntArray) -> tuple[float, int]:
    """The time to play a walk [s], and how many of its frames are not finite."""
    playback = Playback(graph, int(path[0]))
    seconds, broken = 0.0, 0
    for at in range(1, len(path), _STRETCH):
        start = time.perf_counter()
        played = playback.play(path[at : at + _STRETCH])
        seconds += time.perf_counter() - start
        broken += _broken(played.poses)
    return seconds, broken


def _broken(poses: FloatArray) -> int:
    return int(np.count_nonzero(~np.isfinite(poses).all(axis=1)))


STUDY = Study(
    "million-frames",
    "a million frames of a random walk: whether it ever ends, and how fast it is made",
    "2 min",
    of_graphs(measure, WORLDS, 1_000_000, 3_000),
    (
        Target("dead_ends", "0", at_most=0),
        Target("frames_off_the_graph", "0", at_most=0),
        Target("frames_not_finite", "0", at_most=0),
        Target("fitted_not_finite", "0", at_most=0),
        Target("played_per_s", "at least 100,000", at_least=100_000),
        Target("fitted_per_s", "at least 2,000", at_least=2_000),
    ),
    notes=(
        "On one core. played_per_s: random walk and blends; fitted_per_s: feet fitted, too, on "
        "level ground.",
    ),
)
