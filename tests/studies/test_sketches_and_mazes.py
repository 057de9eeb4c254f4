"""The benchmark of walks along sketches and through mazes."""

import json

import numpy as np
import pytest

from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.maze import random_maze
from dynresp.motion.builtin import FLAT, load_builtin
from dynresp.motion.character import Character
from studies.graphs import maze_walks, sketched_paths


@pytest.fixture(scope="module")
def graph(character: Character) -> MotionGraph:
    motions = [load_builtin(name, character) for name in FLAT]
    return MotionGraph.build(motions, GraphConfig(mirrored=True), character)


def test_paths_are_smooth_and_as_long_as_they_say() -> None:
    for seed in range(5):
        path = sketched_paths.smooth_path(np.random.default_rng(seed))
        steps = np.diff(path, axis=0)
        assert np.hypot(*steps.T).sum() == pytest.approx(20.0)
        heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        assert np.abs(np.diff(heading)).max() <= 0.8 * 20.0 / 400 + 1e-9


def test_a_sketch_goes_from_start_to_goal() -> None:
    rng = np.random.default_rng(3)
    maze = random_maze(rng)
    sketch = maze_walks.rough_sketch(rng, maze)
    np.testing.assert_allclose(sketch[[0, -1]], maze.solution[[0, -1]])


@pytest.mark.slow
def test_figures_are_told(graph: MotionGraph, character: Character) -> None:
    for part in (sketched_paths, maze_walks):
        figures = part.measure(graph, character, 2, 0)
        json.dumps(figures, allow_nan=False)
        assert set({target.value for target in part.STUDY.targets}) <= set(figures)
    assert sketched_paths.measure(graph, character, 2, 0)["arrived"] == 2
    # What is measured depends on the seed alone, but for the times.
    again = [sketched_paths.measure(graph, character, 2, 1) for _ in range(2)]
    for name in ("off_path_mean_m", "off_path_farthest_m", "walking_s"):
        assert again[0][name] == again[1][name]
