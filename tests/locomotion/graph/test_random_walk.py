import numpy as np
import pytest

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.motion.character import default_character
from dynresp.support.errors import UsageError
from tests.locomotion.samples import walking_graph


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3)


def ways(graph: MotionGraph) -> set[tuple[int, int]]:
    return set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))


def test_only_ways_are_walked(graph: MotionGraph) -> None:
    walk = random_walk(graph, 5000, np.random.default_rng(1))
    assert set(zip(walk[:-1].tolist(), walk[1:].tolist(), strict=True)) <= ways(graph)


def test_ways_are_walked_as_often_as_they_are_probable(graph: MotionGraph) -> None:
    walk = random_walk(graph, 1_000_000, np.random.default_rng(2))
    busiest = int(np.argmax(np.diff(graph.offsets)))
    row = slice(graph.offsets[busiest], graph.offsets[busiest + 1])
    after = walk[1:][walk[:-1] == busiest]
    assert len(after) > 500
    for target, probability in zip(graph.targets[row], graph.probabilities[row], strict=True):
        share = np.mean(after == target)
        deviation = np.sqrt(probability * (1 - probability) / len(after))
        assert abs(share - probability) < 5.0 * deviation + 1e-3


def test_the_same_seed_walks_the_same_way(graph: MotionGraph) -> None:
    a, b = (random_walk(graph, 500, np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(a, b)


def test_a_walk_goes_on_from_a_frame(graph: MotionGraph) -> None:
    start = int(graph.frames[0])
    walk = random_walk(graph, 10, np.random.default_rng(9), start)
    assert len(walk) == 10
    assert (start, int(walk[0])) in ways(graph)


def test_what_cannot_be_walked(graph: MotionGraph) -> None:
    with pytest.raises(UsageError, match="at least 1 frame, got 0"):
        random_walk(graph, 0, np.random.default_rng(1))
    outside = sorted(set(range(len(graph.database))) - set(graph.frames.tolist()))
    for frame in (-1, len(graph.database), *outside[:1]):
        with pytest.raises(UsageError, match="not in the graph's component"):
            random_walk(graph, 3, np.random.default_rng(1), frame)
