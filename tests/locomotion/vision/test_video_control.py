import itertools

import numpy as np
import pytest

from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.video_control import (
    VideoControl,
    open_paths,
    warped_costs,
)
from dynresp.support.errors import UsageError
from tests.locomotion.clusters.forest_samples import random_forest
from tests.locomotion.vision.samples import STEPPING, WAVING


@pytest.mark.parametrize("seed", range(20))
def test_open_paths_go_along_the_graph(seed: int) -> None:
    forest = random_forest(np.random.default_rng(seed), (20, 14), jumps=9)
    graph = forest.graph
    edges = set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    for frame in graph.frames[::5].tolist():
        paths = open_paths(forest, frame, 1.0)
        assert paths
        for path in paths:
            along = [frame, *path.frames.tolist()]
            assert 2 <= len(along) <= 16
            assert set(itertools.pairwise(along)) <= edges
            assert path.cluster in forest.clusters.labels[path.frames]


def test_the_recogniser_knows_what_it_has_learnt(forest, table, recogniser) -> None:
    assert recogniser.probabilities(table.rows[20:40, 3]).argmax() == STEPPING
    assert recogniser.probabilities(table.rows[120:140, 3]).argmax() == WAVING
    # A single row is enough, and probabilities add up.
    assert recogniser.probabilities(table.rows[130:131, 7]).sum() == pytest.approx(1.0)
    again = Recogniser.trained(forest.graph.database, table, forest.clusters.labels)
    np.testing.assert_array_equal(again.weights[0], recogniser.weights[0])


def test_clusters_without_frames_are_never_recognised(forest, table) -> None:
    labels = np.where(forest.clusters.labels == WAVING, 3, 1).astype(np.int32)
    recogniser = Recogniser.trained(forest.graph.database, table, labels)
    shares = recogniser.probabilities(table.rows[120:140, 3])
    assert shares.argmax() == 3
    assert shares[0] == shares[2] == 0.0


def test_the_path_that_was_seen_costs_nothing(forest, table) -> None:
    paths = open_paths(forest, 20, 2.0)
    seen = table.rows[paths[0].frames[:12], 6]
    costs = warped_costs(seen, table, forest, 20, paths)
    assert costs.shape == (len(paths), 18)
    assert costs[0, 6] == pytest.approx(0.0, abs=1e-5)
    assert costs.min() >= 0.0


@pytest.mark.parametrize(("action", "start"), [(WAVING, 20), (STEPPING, 130)])
def test_the_avatar_comes_to_do_what_is_seen(forest, table, recogniser, action, start) -> None:
    control = VideoControl(forest, table, recogniser)
    frame = start
    for k in range(30):
        control.see(table.rows[90 * action + 10 + k, 2])
        chosen = control.choose(frame)
        frame = int(chosen.frames[0])
    assert chosen.cluster == action
    assert forest.clusters.labels[frame] == action


def test_wrong_requests_are_refused(forest, table, recogniser, rng) -> None:
    control = VideoControl(forest, table, recogniser)
    with pytest.raises(UsageError, match="nobody"):
        control.choose(20)
    other = random_forest(rng, clusters=3)
    with pytest.raises(UsageError, match="clusters"):
        VideoControl(other, table, recogniser)
