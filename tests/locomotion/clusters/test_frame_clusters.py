"""Observations of frames, and their clusters."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.clusters.cluster_observations import (
    CLUSTERED_JOINTS,
    decorrelation,
    observations,
    reference_orientation,
)
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import fit_from_means
from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError
from tests.locomotion.graph.graph_samples import made_database, wandering_poses
from tests.locomotion.samples import planned_graph, walking_graph


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3)


@pytest.fixture(scope="module")
def clusters(graph: MotionGraph) -> Clusters:
    return Clusters.of(graph)


def database_of(*clips: FloatArray) -> MotionDatabase:
    ends = np.cumsum([0, *(len(clip) for clip in clips)]).tolist()
    named = tuple(Clip(str(k), ends[k], ends[k + 1], str(k)) for k in range(len(clips)))
    poses = np.concatenate(clips)
    return MotionDatabase(poses, np.zeros((len(poses), 2), dtype=bool), 15.0, named, "")


def test_fixed_observations_are_those_of_the_paper(
    character: Character, rng: np.random.Generator
) -> None:
    database = made_database(rng, (30, 20))
    x = observations(database, Coordinates.FIXED, character)
    assert x.shape == (50, 36)
    np.testing.assert_array_equal(x[:, :3], database.poses[:, :3])
    reference = reference_orientation(database.poses[:, 3:7])
    # A rotation by 2 |v| about v / |v|.
    back = rotations.multiply(reference, rotations.from_rotation_vector(2.0 * x[:, 3:6]))
    np.testing.assert_allclose(
        rotations.angle_between(back, database.poses[:, 3:7]), 0.0, atol=1e-7
    )
    for k, name in enumerate(CLUSTERED_JOINTS):
        at = 7 + 4 * character.joint(name)
        own = rotations.from_rotation_vector(2.0 * x[:, 6 + 3 * k : 9 + 3 * k])
        np.testing.assert_allclose(
            rotations.angle_between(own, database.poses[:, at : at + 4]), 0.0, atol=1e-7
        )


def test_neck_and_ankles_do_not_count(character: Character, rng: np.random.Generator) -> None:
    poses = wandering_poses(rng, 20)
    changed = poses.copy()
    for name in ("neck", "left_ankle", "right_ankle"):
        at = 7 + 4 * character.joint(name)
        changed[:, at : at + 4] = rotations.identity(20)
    for coordinates in Coordinates:
        np.testing.assert_array_equal(
            observations(database_of(poses), coordinates, character),
            observations(database_of(changed), coordinates, character),
        )


@pytest.mark.parametrize("coordinates", [Coordinates.RELATIVE, Coordinates.BLOCKS])
def test_position_and_facing_do_not_count_in_relative_observations(
    coordinates: Coordinates, character: Character, rng: np.random.Generator
) -> None:
    poses = wandering_poses(rng, 40)
    up = 0.0 if coordinates is Coordinates.RELATIVE else 3.0
    moved = move_poses(poses, 2.0, (5.0, -4.0, up))
    a, b = (observations(database_of(p), coordinates, character) for p in (poses, moved))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_relative_observations_contain_speeds(character: Character) -> None:
    frames = np.arange(60) / 15.0
    poses = np.tile(character.rest_pose, (60, 1))
    # A circle to the left, one metre across, at half a radian a second, facing along it.
    poses[:, 0], poses[:, 1] = np.sin(0.5 * frames), 1.0 - np.cos(0.5 * frames)
    poses[:, 3:7] = rotations.from_yaw(0.5 * frames)
    x = observations(database_of(poses), Coordinates.RELATIVE, character)
    inner = x[9:-9]
    np.testing.assert_allclose(inner[:, 0], 0.5, atol=1e-3)
    np.testing.assert_allclose(inner[:, 1], 0.0, atol=1e-3)
    np.testing.assert_allclose(inner[:, 2], character.rest_pose[2])
    np.testing.assert_allclose(inner[:, 3], 0.25, atol=1e-9)


def test_averages_and_speeds_do_not_cross_from_clip_to_clip(
    character: Character, rng: np.random.Generator
) -> None:
    a, b = wandering_poses(rng, 25), wandering_poses(rng, 30)
    both = observations(database_of(a, b), Coordinates.RELATIVE, character)
    each = [observations(database_of(p), Coordinates.RELATIVE, character) for p in (a, b)]
    np.testing.assert_allclose(both, np.concatenate(each), atol=1e-9)


def test_the_reference_orientation_is_the_nearest_to_the_farthest(
    rng: np.random.Generator,
) -> None:
    q = rotations.from_rotation_vector(rng.normal(0.0, 0.8, (60, 3)))
    q *= rng.choice([-1.0, 1.0], (60, 1))
    farthest = [max(rotations.angle_between(a, b) for b in q) for a in q]
    np.testing.assert_array_equal(reference_orientation(q), q[int(np.argmin(farthest))])


def test_frames_decorrelate_after_their_own_time(rng: np.random.Generator) -> None:
    poses = np.tile(wandering_poses(rng, 1), (4000, 1))
    database = database_of(poses[:2000], poses[2000:])
    # Autocorrelation exp(-lag / 6).
    x = np.empty((4000, 5))
    x[0] = rng.normal(size=5)
    for k in range(1, 4000):
        x[k] = np.exp(-1 / 6) * x[k - 1] + np.sqrt(1 - np.exp(-1 / 3)) * rng.normal(size=5)
    assert decorrelation(x, database, longest_s=1.0) in (5, 6, 7, 8)
    assert decorrelation(x, database, longest_s=0.2) == 3
    assert decorrelation(np.zeros((4000, 2)), database, longest_s=1.0) == 15


def test_every_frame_has_its_most_probable_cluster(graph: MotionGraph, clusters: Clusters) -> None:
    n = len(graph.database)
    assert clusters.labels.shape == (n,)
    assert clusters.log_probabilities.shape == (n, len(clusters))
    np.testing.assert_array_equal(clusters.log_probabilities.argmax(axis=1), clusters.labels)
    np.testing.assert_allclose(np.exp(clusters.log_probabilities).sum(axis=1), 1.0, atol=1e-5)
    assert set(clusters.labels[graph.frames]) == set(range(len(clusters)))


def test_examples_are_the_closest_to_the_means(
    graph: MotionGraph, clusters: Clusters, character: Character
) -> None:
    x = observations(graph.database, graph.config.coordinates, character)
    for k, example in enumerate(clusters.examples):
        own = graph.frames[clusters.labels[graph.frames] == k]
        mean = clusters.mixture.means[k]
        nearest = own[np.argmin(np.linalg.norm(x[own] - mean, axis=1))]
        assert example == nearest


def test_the_number_of_clusters_can_be_limited(graph: MotionGraph) -> None:
    clusters = Clusters.of(graph, max_clusters=3)
    assert 1 <= len(clusters) <= 3
    assert clusters.bounded == (len(clusters) == 3)


def test_given_seeds_begin_the_clusters(graph: MotionGraph) -> None:
    seeds = graph.frames[[2, 12, 30]].tolist()
    clusters = Clusters.of(graph, seeds=seeds)
    assert len(clusters) == 3
    assert len(clusters.curve) == 1


def test_seeds_outside_the_graph_are_refused(graph: MotionGraph) -> None:
    with pytest.raises(UsageError, match="no frames of the graph"):
        Clusters.of(graph, seeds=[len(graph.database)])


@pytest.mark.mocap
@pytest.mark.slow
@pytest.mark.parametrize("plan", ["walking", "playground"])
def test_seeds_need_no_hand(plan: str, motions_folder: Path, character: Character) -> None:
    graph = planned_graph(plan, motions_folder, character)
    clusters = Clusters.of(graph)
    x = observations(graph.database, graph.config.coordinates, character)
    x = x[graph.frames[clusters.spacing // 2 :: clusters.spacing]]
    rng = np.random.default_rng(1)
    starts = [rng.choice(len(x), len(clusters), replace=False) for _ in range(20)]
    tried = [fit_from_means(x, x[rows]) for rows in starts]
    own = clusters.mixture
    best = max(m.log_likelihood(x) for m in tried)
    print(
        f"{plan}: {len(clusters)} clusters, log-likelihood of "
        f"{len(x)} observations {own.log_likelihood(x):.0f}, of the best of 20 random starts "
        f"{best:.0f}; BIC {own.bic(x):.0f} and {max(m.bic(x) for m in tried):.0f}"
    )
    assert own.log_likelihood(x) >= best
    assert own.bic(x) >= max(m.bic(x) for m in tried)
