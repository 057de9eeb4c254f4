"""Frames of a graph on a character's clock."""

import numpy as np
import pytest

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing import composition as composing
from dynresp.locomotion.playing.composition import compose
from dynresp.locomotion.playing.frame_stream import Stream
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionError, UsageError
from tests.locomotion.samples import walking_graph


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3)


def _stream(graph: MotionGraph, character: Character, frame: int, fps: float) -> Stream:
    database = graph.database
    return Stream(
        graph, character, fps, frame, 100, database.poses[frame : frame + 1],
        database.velocities[frame], database.contacts[frame : frame + 1, :2],
    )  # fmt: skip


@pytest.mark.parametrize("fps", [15.0, 20.0, 30.0, 40.0])
def test_pieces_are_what_is_composed(graph: MotionGraph, character: Character, fps: float) -> None:
    """Frame by frame, as far as nothing is blended into its beginning."""
    walk = random_walk(graph, 90, np.random.default_rng(2))
    stream = _stream(graph, character, int(walk[0]), fps)
    for some in np.array_split(walk[1:], 30):
        stream.extend(some)
    first, poses = stream.fitted(100)
    whole = compose(graph, character, walk, fps=fps).motion
    assert stream.end == 100 + len(whole)
    assert first + len(poses) == stream.end
    assert stream.frame == walk[-1]
    np.testing.assert_allclose(poses[:, :2], whole.poses[1:, :2], atol=1e-6)
    for row in (0, 40):
        standing = stream.standing(101 + row)
        assert standing is not None
        np.testing.assert_array_equal(standing, whole.contacts[1 + row])
    assert stream.standing(100) is None
    assert stream.standing(stream.end) is None
    contacts = whole.contacts[1:]
    assert np.percentile(stance_slides(Motion(poses, fps, "", contacts), character), 95) < 0.01


def test_a_clock_slower_than_the_graph_is_refused(graph: MotionGraph, character: Character) -> None:
    with pytest.raises(UsageError, match="a clock of 10 fps is slower than the graph"):
        _stream(graph, character, int(graph.frames[0]), 10.0)


def test_a_walk_that_no_memory_holds_is_refused(
    graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(composing, "MAX_FRAMES", 100)
    walk = random_walk(graph, 60, np.random.default_rng(2))
    with pytest.raises(MotionError, match=r"4 s at 30 fps has 119 frames.*at most 100"):
        compose(graph, character, walk, fps=30.0)
    assert len(compose(graph, character, walk, fps=15.0).motion) == 60
