from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs.choice_run import choice_run, describe_action, find_forest, given_answers
from dynresp.locomotion.choice.actions import OfferedAction
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from dynresp.support.errors import UsageError


@pytest.fixture(scope="module")
def forest(graph: MotionGraph, character: Character) -> ClusterForest:
    return find_forest(graph, character)


def action(*corners: tuple[float, float, float]) -> OfferedAction:
    """One whose root goes through corners x, y [m] and yaw [deg], a frame each."""
    path = np.array([[x, y, 0.9, np.radians(yaw)] for x, y, yaw in corners])
    frames = np.arange(len(path) - 1, dtype=np.int32)
    return OfferedAction(0, frames, path, 0, np.zeros(2, np.int32), 0, np.zeros(59), -1.0)


@pytest.mark.parametrize(
    ("corners", "description"),
    [
        (((0, 0, 0), (2, 0, 10)), "goes 2.0 m ahead, in 1.0 s"),
        (((0, 0, 90), (2, 0, 0)), "goes 2.0 m to the right, turns 90 deg right, in 1.0 s"),
        (((0, 0, 0), (-1, 0, 0)), "goes 1.0 m back, in 1.0 s"),
        (((0, 0, 0), (1, 1, 45)), "goes 1.4 m ahead and to the left, turns 45 deg left, in 1.0 s"),
        (((0, 0, 0), (0.1, 0, 0)), "stays, in 1.0 s"),
        (((0, 0, 0), (2, 0, 0), (0.2, 0, 0)), "goes 3.8 m and comes back, in 2.0 s"),
        (((5, 5, 165), (5, 5, -165)), "stays, turns 30 deg left, in 1.0 s"),
    ],
)
def test_an_action_is_described_in_words(
    corners: tuple[tuple[float, float, float], ...], description: str
) -> None:
    assert describe_action(action(*corners), 1.0) == description


@pytest.mark.slow
def test_given_answers(forest: ClusterForest, character: Character, tmp_path: Path) -> None:
    run = choice_run(forest.graph, character, given_answers([1, None, 0]), forest=forest)
    content = run.save(tmp_path, video=False)
    assert [moment["picked"] for moment in content["choices"]] == [1, None, 0]
    assert all(len(moment["offered"]) >= 3 for moment in content["choices"])
    assert (tmp_path / "options.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_no_answers(forest: ClusterForest, character: Character) -> None:
    run = choice_run(forest.graph, character, given_answers([]), forest=forest)
    assert run.about["choices"] == []
    assert run.motion.duration > 1.0


def test_an_answer_that_is_not_offered(forest: ClusterForest, character: Character) -> None:
    for wrong in (8, -1):
        with pytest.raises(UsageError, match=rf"at 0\.0 s \d actions are offered.*got {wrong}"):
            choice_run(forest.graph, character, given_answers([wrong]), forest=forest)


def test_a_function_that_picks(forest: ClusterForest, character: Character) -> None:
    times = []

    def pick(time_s: float, actions: object) -> None:
        times.append(time_s)

    run = choice_run(forest.graph, character, pick, seconds=4.0, forest=forest)
    assert times == [0.0, 2.0]
    assert run.motion.duration == pytest.approx(4.0)
