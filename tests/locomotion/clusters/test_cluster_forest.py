"""Cluster trees and most probable motions are those of the slow twin."""

import itertools

import numpy as np
import pytest

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import default_character
from dynresp.support.errors import UsageError
from tests.locomotion.clusters.forest_samples import random_forest
from tests.locomotion.samples import walking_graph
from tests.oracles import forest as slow

STEPS = 7
SECONDS = STEPS / 15.0


@pytest.fixture(scope="module")
def walking() -> ClusterForest:
    graph = walking_graph(default_character(), sigma=0.3)
    return ClusterForest(graph, Clusters.of(graph))


def ways(graph: MotionGraph) -> set[tuple[int, int]]:
    return set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))


@pytest.mark.parametrize("seed", range(25))
def test_trees_are_the_slow_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    forest = random_forest(rng, jumps=int(rng.integers(1, 9)))
    frame = int(rng.choice(forest.graph.frames))
    tree = forest.tree(frame, SECONDS)
    walks = slow.tree(forest.graph, forest.clusters, tree.root, STEPS)
    assert sorted(tree.frames) == sorted(walks)
    for visit, reached in enumerate(tree.frames.tolist()):
        walk = walks[reached]
        assert tree.steps[visit] == len(walk) - 1
        assert tree.log_probabilities[visit] == pytest.approx(
            np.log(slow.probability(forest.graph, forest.clusters, walk))
        )
        path = tuple(tree.cluster_path(int(tree.nodes[visit])))
        assert path == slow.path_of(walk, forest.clusters)
    paths = [tuple(tree.cluster_path(node)) for node in range(len(tree.node_clusters))]
    assert len(set(paths)) == len(paths)
    assert set(paths) == {slow.path_of(walk, forest.clusters) for walk in walks.values()}


@pytest.mark.parametrize("seed", range(25))
def test_likeliest_motions_are_the_slow_ones(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    forest = random_forest(rng, jumps=int(rng.integers(1, 9)), clusters=int(rng.integers(2, 5)))
    tree = forest.tree(int(rng.choice(forest.graph.frames)), SECONDS)
    for node in range(len(tree.node_clusters)):
        motion = forest.likeliest_motion(tree, node, SECONDS)
        path = tuple(int(c) for c in tree.cluster_path(node))
        best, value = slow.likeliest_motion(forest.graph, forest.clusters, path, tree.root, STEPS)
        assert motion.log_probability == pytest.approx(value, abs=1e-8)
        assert tuple(motion.frames.tolist()) == best


def test_a_bound_in_time_makes_the_motion_shorter(rng: np.random.Generator) -> None:
    shorter = 0
    for _ in range(60):
        forest = random_forest(rng, lengths=(9, 8), jumps=12)
        tree = forest.tree(int(rng.choice(forest.graph.frames)))
        for node in tree.leaves.tolist():
            soonest = int(tree.steps[tree.node_visits[node]])
            bounded = forest.likeliest_motion(tree, node, soonest / 15.0)
            free = forest.likeliest_motion(tree, node)
            assert len(bounded.frames) <= soonest + 1
            assert bounded.log_probability <= free.log_probability + 1e-9
            shorter += len(bounded.frames) < len(free.frames)
    assert shorter > 0


def test_nodes_know_where_they_are_entered(walking: ClusterForest) -> None:
    tree = walking.tree(int(walking.graph.frames[0]))
    assert tree.node_visits[0] == 0
    for node in range(len(tree.node_clusters)):
        way = tree.frames_to(node)
        assert way[0] == tree.root
        assert set(zip(way[:-1].tolist(), way[1:].tolist(), strict=True)) <= ways(walking.graph)
        labels = walking.clusters.labels[way]
        assert labels[-1] == tree.node_clusters[node]
    assert set(tree.leaves) == set(range(len(tree.node_clusters))) - set(tree.node_parents)


def test_places_are_those_of_playing_along(walking: ClusterForest) -> None:
    assert walking.graph.config.coordinates is Coordinates.RELATIVE
    tree = walking.tree(int(walking.graph.frames[5]))
    nodes = np.arange(len(tree.node_clusters))
    places = walking.root_states(tree, nodes)
    for node in nodes.tolist():
        way = tree.frames_to(node)
        clip = placement.IDENTITY
        for left, entered in itertools.pairwise(way):
            move = walking.graph.placements_between([left], [entered])[0]
            clip = placement.compose(clip, move)
        end = placement.compose(clip, walking.graph.database.planar[way[-1]])
        np.testing.assert_allclose(places[node][:3], end[:3], atol=1e-9)
        assert abs(placement.wrapped(places[node, 3] - end[3])) < 1e-9
        along = walking.root_states_along(way, placement.IDENTITY)
        np.testing.assert_allclose(along[-1], places[node], atol=1e-9)
        np.testing.assert_allclose(along[0], walking.graph.database.planar[way[0]], atol=1e-9)


def test_frames_with_one_way_share_the_next_branch(walking: ClusterForest) -> None:
    offsets = walking.graph.offsets
    for frame in walking.graph.frames[::7].tolist():
        lead = walking.frames_to_branch(frame)
        counts = offsets[lead + 1] - offsets[lead]
        assert lead[0] == frame
        assert (counts[:-1] == 1).all()
        assert counts[-1] > 1
        assert walking.tree(frame, 1.0).root == lead[-1]


def test_of_many_alike_jumps_the_best_are_followed(rng: np.random.Generator) -> None:
    forest = random_forest(rng, lengths=(20, 20), jumps=900, clusters=2)
    graph, labels = forest.graph, forest.clusters.labels
    tree = forest.tree(int(graph.frames[0]), 1.0 / 15.0)
    row = slice(graph.offsets[tree.root], graph.offsets[tree.root + 1])
    targets, chances = graph.targets[row], graph.probabilities[row]
    expected = {tree.root, int(graph.database.successors[tree.root])} - {-1}
    for cluster in range(2):
        own = labels[targets] == cluster
        expected |= set(targets[own][np.argsort(-chances[own])[:3]].tolist())
    assert len(targets) > 8
    assert set(tree.frames.tolist()) == expected


def test_a_stay_goes_on_while_the_cluster_is_the_same(walking: ClusterForest) -> None:
    labels = walking.clusters.labels
    for frame in walking.graph.frames[::11].tolist():
        stay = walking.stay(np.array([frame], dtype=np.int32), 30)
        assert stay[0] == frame
        assert len(stay) <= 31
        assert (labels[stay] == labels[frame]).all()
        assert set(zip(stay[:-1].tolist(), stay[1:].tolist(), strict=True)) <= ways(walking.graph)


def test_a_node_that_is_too_far_is_refused(walking: ClusterForest) -> None:
    tree = walking.tree(int(walking.graph.frames[0]))
    last = len(tree.node_clusters) - 1
    with pytest.raises(UsageError, match=f"node {last} after .* later than the time bound of 0 s"):
        walking.likeliest_motion(tree, last, 0.0)


def test_a_frame_outside_the_graph_is_refused(walking: ClusterForest) -> None:
    with pytest.raises(UsageError, match="not in the graph"):
        walking.tree(len(walking.graph.database) - 1 + 10)


def test_clusters_of_other_frames_and_no_time_are_refused(
    walking: ClusterForest, rng: np.random.Generator
) -> None:
    with pytest.raises(UsageError, match="cluster this graph"):
        ClusterForest(walking.graph, random_forest(rng).clusters)
    with pytest.raises(UsageError, match="time_bound_s"):
        ClusterForest(walking.graph, walking.clusters, 0.0)
