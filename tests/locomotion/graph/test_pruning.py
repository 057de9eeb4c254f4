from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.locomotion.graph import pruning
from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.locomotion.graph.frame_distance import JOINT_WEIGHTS, frame_distances, frame_features
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.pruning import find_jumps, step_groups
from tests.locomotion.graph.graph_samples import made_database, wandering_poses
from tests.oracles import motion_graph as oracle

NAMES = tuple(JOINT_WEIGHTS)


def between_distances(distances, config, share):
    """The configuration with a threshold that keeps a share of pairs and lies on none of them."""
    levels = np.unique(distances[np.triu_indices(len(distances), 1)])
    at = int(share * (len(levels) - 2))
    gap = int(np.argmax(np.diff(levels[at : at + 10])))
    max_distance = 0.5 * (levels[at + gap] + levels[at + gap + 1])
    return replace(config, sigma=max_distance / -np.log(config.least_probability))


@pytest.mark.parametrize("coordinates", list(Coordinates))
@pytest.mark.parametrize("contact_change", [True, False])
@pytest.mark.parametrize("local_maxima", [True, False])
@settings(max_examples=4)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.95))
def test_it_finds_what_its_slow_twin_finds(coordinates, contact_change, local_maxima, seed, share):
    rng = np.random.default_rng(seed)
    database = made_database(rng, (13, 3, 10), columns=int(rng.choice([2, 4])))
    config = GraphConfig(
        coordinates=coordinates, contact_change=contact_change, local_maxima=local_maxima,
        stutter_s=float(rng.choice([0.0, 0.2, 0.25])), velocity_weight=0.005,
    )  # fmt: skip
    distances = oracle.matrix(database.poses, database.velocities, NAMES, config)
    distances = np.maximum(distances, distances.T)
    config = between_distances(distances, config, share)
    jumps, counts = oracle.transitions(distances, database.contacts, database.clip_of, config)
    found = find_jumps(database, config)
    assert list(zip(found.sources, found.targets, strict=True)) == jumps
    expected = [found.contact, found.likelihood]
    expected += [found.similarity] if local_maxima else []
    assert expected == counts
    assert (found.similarity is None) == (not local_maxima)
    np.testing.assert_allclose(
        found.distances, distances[found.sources, found.targets - 1], rtol=2e-5, atol=2e-6
    )


def test_of_equal_neighbours_the_first_stays():
    rng = np.random.default_rng(5)
    poses = wandering_poses(rng, 12)
    # The same clip twice, its pose held still over some frames: whole plains of equal distances.
    poses[4:9] = poses[4]
    clips = (Clip("a", 0, 12, "a"), Clip("b", 12, 24, "b"))
    database = MotionDatabase(np.tile(poses, (2, 1)), np.ones((24, 2), bool), 15.0, clips, "")
    config = GraphConfig(
        coordinates=Coordinates.FIXED, contact_change=False, velocity_weight=0.0, sigma=0.5,
        stutter_s=0.2,
    )  # fmt: skip
    features = frame_features(database.poses, database.velocities, config)
    n = np.arange(24)
    distances = frame_distances(features, n[:, None], n[None, :])
    jumps, counts = oracle.transitions(distances, database.contacts, database.clip_of, config)
    found = find_jumps(database, config)
    assert list(zip(found.sources, found.targets, strict=True)) == jumps
    assert [found.contact, found.likelihood, found.similarity] == counts
    # Along the twins' diagonal all distances are zero, and it makes one jump each way.
    alike = [(i, j) for i, j in jumps if abs(j - 1 - i) == 12]
    assert alike == [(0, 13), (12, 1)]


@pytest.mark.parametrize("coordinates", list(Coordinates))
@pytest.mark.parametrize("contact_change", [True, False])
def test_threads_and_lots_change_no_bit(coordinates, contact_change, monkeypatch):
    database = made_database(np.random.default_rng(9), (400, 2, 350, 301), alike=0.1)
    config = GraphConfig(coordinates=coordinates, contact_change=contact_change, sigma=0.4)
    found = [find_jumps(database, config, threads) for threads in (1, 2, 5)]
    monkeypatch.setattr(pruning, "_MAX_ROWS", 37)
    found.append(find_jumps(database, config, 3))
    assert len(found[0].sources) > 50
    for other in found[1:]:
        for name in ("sources", "targets", "distances"):
            np.testing.assert_array_equal(getattr(other, name), getattr(found[0], name))
        assert (other.contact, other.likelihood) == (found[0].contact, found[0].likelihood)
        assert other.similarity == found[0].similarity


@pytest.mark.parametrize("coordinates", list(Coordinates))
def test_distances_are_those_of_the_reference(coordinates):
    # Far from the origin, where single precision has few digits left.
    database = made_database(np.random.default_rng(2), (300, 300), alike=0.1)
    poses = database.poses + np.r_[3000.0, -8000.0, 20.0, np.zeros(56)]
    database = replace(database, poses=poses)
    config = GraphConfig(coordinates=coordinates, contact_change=False, sigma=1.0)
    found = find_jumps(database, config)
    features = frame_features(database.poses, database.velocities, config)
    expected = frame_distances(features, found.sources, found.targets - 1)
    np.testing.assert_allclose(found.distances, expected, rtol=2e-5, atol=2e-6)


def test_rotations_of_half_a_turn_are_found_whatever_the_sign():
    rng = np.random.default_rng(4)
    poses = np.repeat(wandering_poses(rng, 1), 40, axis=0)
    angles = np.pi + rng.normal(0.0, 0.05, 40)
    poses[:, 7:11] = np.stack([np.cos(angles / 2), np.sin(angles / 2), 0 * angles, 0 * angles], 1)
    poses[:, 7:11] *= rng.choice([-1.0, 1.0], (40, 1))
    clips = tuple(Clip(str(k), 4 * k, 4 * k + 4, str(k)) for k in range(10))
    database = MotionDatabase(poses, np.ones((40, 2), bool), 15.0, clips, "")
    config = GraphConfig(contact_change=False, local_maxima=False, sigma=0.1, velocity_weight=0.0)
    found = find_jumps(database, config)
    # Three steps of ten clips, each with those of the other nine.
    assert found.likelihood == found.contact == len(found.sources) == 30 * 27


def test_the_contact_rule():
    states = np.array([3, 3, 1, 1, 3, 3, 1, 2], dtype=np.uint8)
    successors = np.array([1, 2, 3, 4, 5, 6, -1, -1], dtype=np.int32)
    loose = step_groups(states, successors, contact_change=False)
    assert loose.tolist() == [771, 769, 257, 259, 771, 769, -1, -1]
    strict = step_groups(states, successors, contact_change=True)
    assert strict.tolist() == [-1, 769, -1, 259, -1, 769, -1, -1]


def test_a_threshold_below_every_distance_leaves_nothing():
    database = made_database(np.random.default_rng(0), (30, 30))
    found = find_jumps(database, GraphConfig(sigma=1e-9, contact_change=False))
    assert found.contact > 0
    assert (found.likelihood, found.similarity, len(found.sources)) == (0, 0, 0)


def test_without_a_contact_change_there_is_no_strict_jump():
    database = replace(
        made_database(np.random.default_rng(0), (30, 30)), contacts=np.ones((60, 2), bool)
    )
    found = find_jumps(database, GraphConfig(sigma=10.0))
    assert (found.contact, found.likelihood, found.similarity) == (0, 0, None)
    assert len(found.sources) == 0
