"""A million frames of walks by chance: how long it takes, and how well they hang together."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.support.arrays import IntArray
from studies.graphs.speed_steps import at_jumps, source_limits

pytestmark = pytest.mark.slow

FRAMES, FITTED, STRETCH = 1_000_000, 50_000, 25_000
JOINTS, ROOT, ROOT_TURN = 0, 1, 2


@dataclass(frozen=True)
class Walk:
    """A graph and a walk through it."""

    graph: MotionGraph
    path: IntArray


@pytest.fixture(
    scope="module", params=[pytest.param("walking", marks=pytest.mark.mocap), "builtin"]
)
def walk(request: pytest.FixtureRequest) -> Walk:
    plan = find_graph_spec(request.param)
    folders: list[Path] = []
    if request.param != "builtin":
        folders = [request.getfixturevalue("motions_folder")]
    graph = build_graph(
        read_graph_spec(plan), folders, plan.parent, default_character(), lambda *_: None
    )
    rng = np.random.default_rng(1)
    random_walk(graph, 10, rng)
    path = random_walk(graph, FRAMES, rng)
    return Walk(graph, path)


def test_a_million_frames_follow_the_ways_and_never_end(walk: Walk) -> None:
    graph, path = walk.graph, walk.path
    n = len(graph.database)
    ways = np.sort(graph.sources.astype(np.int64) * n + graph.targets)
    steps = path[:-1].astype(np.int64) * n + path[1:]
    np.testing.assert_array_equal(ways[np.searchsorted(ways, steps)], steps)
    # It comes around: nearly every frame of the component is met.
    assert len(np.unique(path)) > 0.9 * len(graph.frames)
    jumps = np.mean(graph.database.successors[path[:-1]] != path[1:])
    assert 0.05 < jumps < 0.5


def test_a_million_frames_are_played_without_a_flaw(walk: Walk) -> None:
    graph, path = walk.graph, walk.path
    playback = Playback(graph, int(path[0]))
    playback.play(path[1:2])
    before, jumped = graph.database.poses[:0], []
    for at in range(2, FRAMES, STRETCH):
        played = playback.play(path[at : at + STRETCH])
        assert np.isfinite(played.poses).all()
        norms = np.linalg.norm(played.poses[:, 3:].reshape(-1, 14, 4), axis=-1)
        np.testing.assert_allclose(norms, 1.0, atol=1e-6)
        motion = Motion(np.concatenate([before, played.poses]), graph.config.fps, "")
        # Nobody flies off or sinks into the ground.
        assert np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1).max() < 0.5
        heights = motion.root_positions[:, 2]
        assert 0.3 < heights.min() <= heights.max() < 1.3
        jumped.append(at_jumps(motion, np.flatnonzero(played.jumps) + len(before)))
        before = played.poses[-3:]
    below = np.mean(np.concatenate(jumped) <= source_limits(graph), axis=0)
    assert below[JOINTS] > 0.997
    assert below[ROOT] > 0.99
    assert below[ROOT_TURN] > 0.99


def test_feet_are_fitted_and_stand(walk: Walk, character: Character) -> None:
    graph = walk.graph
    compose(graph, character, walk.path[:100])
    jumped, slides, before = [], [], []
    for at in range(0, FITTED, STRETCH):
        made = compose(graph, character, walk.path[at : at + STRETCH])
        assert np.isfinite(made.motion.poses).all()
        jumped.append(at_jumps(made.motion, made.jumps))
        slides += stance_slides(made.motion, character)
        played = Motion(made.unfitted, graph.config.fps, "", made.motion.contacts)
        before += stance_slides(played, character)
    assert np.mean(np.array(before) < 0.01) < 0.1
    assert np.mean(np.array(slides) < 0.01) > 0.99
    assert np.median(slides) < 1e-3
    below = np.mean(np.concatenate(jumped) <= source_limits(graph), axis=0)
    assert below[JOINTS] > 0.99
    assert below[ROOT] > 0.99
    assert below[ROOT_TURN] > 0.99
