"""Walks through random mazes: along a rough sketch, and with the goal alone given.

A sketch deviates from the path through the maze by about 0.3 m, and may cross its walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import compose
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SketchedWalk
from dynresp.locomotion.sketch.sketch_control import follow_sketch, reach
from dynresp.locomotion.worlds.maze import Maze, random_maze
from dynresp.locomotion.worlds.obstacles import body_clearances
from dynresp.locomotion.worlds.paths import resampled
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from studies.graphs.graph_study import FLAT, of_graphs
from studies.graphs.sketched_paths import real_time_ratios, standing_on, warm_up
from studies.study import Study, Target, Value

# Distance of the points of a sketch [m], and their deviation (standard deviation) [m].
_SPACING_M, _DEVIATION_M = 0.9, 0.3
_CORNERS = 200
# Poses that are measured, per second.
_FPS = 60.0


@dataclass(frozen=True, eq=False)
class Walked:
    """A walk through a maze.

    Attributes:
        maze: The maze.
        walk: The walk.
    """

    maze: Maze
    walk: SketchedWalk


def rough_sketch(rng: np.random.Generator, maze: Maze) -> FloatArray:
    """(k, 2) corners of an inexact line along the solution of a maze [m]."""
    from scipy.interpolate import CubicSpline

    places = resampled(maze.solution, _SPACING_M)
    moved = places + rng.normal(0.0, _DEVIATION_M, places.shape)
    moved[[0, -1]] = places[[0, -1]]
    at = np.linspace(0, len(moved) - 1, _CORNERS)
    return np.asarray(CubicSpline(np.arange(len(moved)), moved)(at))


def walk_mazes(search: SearchGraph, count: int, seed: int, sketched: bool) -> list[Walked]:
    """Walk through random mazes from corner to corner.

    Args:
        search: The graph.
        count: Number of mazes.
        seed: Of mazes and sketches.
        sketched: With a sketch; else with the goal alone.
    """
    out = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        maze = random_maze(rng)
        sketch = rough_sketch(rng, maze)
        start = standing_on(search.graph, maze.solution, 1)
        if sketched:
            walk = follow_sketch(search, start, sketch, maze.world)
        else:
            walk = reach(search, start, maze.solution[-1], maze.world)
        out.append(Walked(maze, walk))
    return out


def clearance(graph: MotionGraph, character: Character, walked: Walked) -> float:
    """Least distance of the body to a wall, feet fitted, sixty times a second [m]."""
    walk = walked.walk
    motion = compose(graph, character, walk.frames, walk.placements[0], _FPS).motion
    return float(body_clearances(walked.maze.world, character, motion.poses).min())


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Walk through random mazes, with a sketch and with the goal alone.

    Args:
        graph: The graph.
        character: The character.
        count: Mazes, each of which is walked through twice.
        seed: Of mazes and sketches.
    """
    search = SearchGraph(graph, character)
    warm_up(search)
    figures: dict[str, Value] = {"mazes": count}
    for name, sketched in (("sketched", True), ("goal_alone", False)):
        walked = walk_mazes(search, count, seed, sketched)
        least = np.array([clearance(graph, character, one) for one in walked])
        ratios = real_time_ratios([one.walk for one in walked], graph.config.fps)
        figures |= {
            f"{name}_arrived": sum(one.walk.arrived for one in walked),
            f"{name}_collided": int(np.count_nonzero(least < 0.0)),
            f"{name}_least_clearance_m": float(least.min()),
            f"{name}_off_path_mean_m": float(np.mean([w.walk.off_path.mean() for w in walked])),
            f"{name}_times_real_time_median": float(np.median(ratios)),
            f"{name}_times_real_time_least": float(ratios.min()),
        }
    return figures


STUDY = Study(
    "mazes",
    "walks through random mazes, along a rough sketch and with the goal alone",
    "2 min",
    of_graphs(measure, FLAT, 20, 2),
    tuple(
        target
        for name in ("sketched", "goal_alone")
        for target in (
            Target(f"{name}_arrived", "all", at_least="mazes"),
            Target(f"{name}_collided", "0", at_most=0),
            Target(f"{name}_times_real_time_least", "at least 10", at_least=10.0),
        )
    ),
    notes=(
        "Mazes of 5 x 5 cells of 1.8 m. The clearance is the exact distance of the body, feet "
        "fitted, to the walls, sixty times a second; below 0 it touches one.",
    ),
)
