from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs import visible_cluster_file
from dynresp.avatar_runs.visible_cluster_file import FORMAT, VideoModel, load_actions, save_actions
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from dynresp.support.errors import GraphFileError
from tests.locomotion.vision.samples import acting_forest


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    from dynresp.motion.character import default_character

    return acting_forest(default_character()).graph


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def model(
    graph: MotionGraph, character: Character, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> VideoModel:
    monkeypatch.setenv("DYNRESP_CACHE", str(cache))
    return VideoModel.of(graph, character, 2, lambda *_: None, pytest.fail)


def test_the_file_keeps_what_was_learnt(
    model: VideoModel, graph: MotionGraph, character: Character
) -> None:
    again = VideoModel.of(graph, character, 2, lambda *_: pytest.fail("made again"), pytest.fail)
    np.testing.assert_array_equal(again.table.rows, model.table.rows)
    a, b = again.forest.clusters, model.forest.clusters
    for name in ("labels", "log_probabilities", "examples"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    np.testing.assert_array_equal(a.mixture.means, b.mixture.means)
    assert (a.curve, a.spacing, a.bounded) == (b.curve, b.spacing, b.bounded)
    seen = model.table.rows[:20, 3]
    np.testing.assert_array_equal(
        again.recogniser.probabilities(seen), model.recogniser.probabilities(seen)
    )


def test_another_bound_is_another_file(
    model: VideoModel, graph: MotionGraph, character: Character, cache: Path
) -> None:
    stages = []
    VideoModel.of(graph, character, 3, lambda stage, *_: stages.append(stage), pytest.fail)
    assert set(stages) == {"learning to recognise actions"}
    assert len(list((cache / "sight").glob("actions-*.npz"))) == 2


def test_another_version_of_the_clustering_is_another_file(
    model: VideoModel, graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(visible_cluster_file, "CLUSTERING_VERSION", 0)
    stages = []
    VideoModel.of(graph, character, 2, lambda stage, *_: stages.append(stage), pytest.fail)
    assert set(stages) == {"learning to recognise actions"}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("identity", np.array("another"), "another graph"),
        ("labels", np.full(180, 7, dtype="<i4"), "do not fit together"),
        ("labels", np.zeros(179, dtype="<i4"), "do not fit together"),
        ("first_weights", np.zeros((3, 128)), "do not fit together"),
        ("means", np.zeros((2, 39)), "do not fit together"),
        ("last_biases", np.full(2, np.nan), "no sense"),
        ("last_biases", np.full(2, -np.inf), "no sense"),
        ("last_biases", np.array([0.0, np.inf]), "no sense"),
        ("variances", np.zeros(2), "no sense"),
        ("weights", np.array([1.5, -0.5]), "no sense"),
        ("spacing", np.array(0), "no sense"),
        ("curve", np.full((1, 3), np.inf), "no sense"),
        ("first_biases", np.full(128, np.inf), "no sense"),
        ("last_weights", np.full((128, 2), -np.inf), "no sense"),
        ("last_weights", np.full((128, 2), 1e300), "no sense"),
        ("log_probabilities", np.full((180, 2), np.inf, dtype="<f4"), "no sense"),
        ("log_probabilities", np.full((180, 2), -np.inf, dtype="<f4"), "no sense"),
        ("log_probabilities", np.full((180, 2), np.nan, dtype="<f4"), "no sense"),
        ("examples", np.array([20, 999], dtype="<i4"), "does not have"),
        ("ages", np.full(7, -1, dtype="<i4"), "does not have"),
    ],
)
def test_damaged_files_are_refused(
    model: VideoModel,
    graph: MotionGraph,
    tmp_path: Path,
    name: str,
    value: np.ndarray,
    message: str,
) -> None:
    path = tmp_path / "actions.npz"
    save_actions(path, "mine", model.forest.clusters, model.recogniser)
    assert len(load_actions(path, "mine", graph, model.table)[0]) == 2
    with np.load(path, allow_pickle=False) as archive:
        arrays = {key: archive[key] for key in archive.files if key != "format_version"}
    FORMAT.write(path, {**arrays, name: value})
    with pytest.raises(GraphFileError, match=message):
        load_actions(path, "mine", graph, model.table)


def test_infinite_weights_are_refused(
    model: VideoModel, graph: MotionGraph, tmp_path: Path
) -> None:
    path = tmp_path / "actions.npz"
    first, last = model.recogniser.weights
    wrong = replace(model.recogniser, weights=(np.full_like(first, np.inf), last))
    save_actions(path, "mine", model.forest.clusters, wrong)
    with pytest.raises(GraphFileError, match="no sense"):
        load_actions(path, "mine", graph, model.table)
