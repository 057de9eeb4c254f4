import dataclasses

import numpy as np
import pytest

from dynresp.locomotion.clusters import frame_clusters
from dynresp.locomotion.clusters.gaussian_mixture import Mixture, MixtureFit
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.visible_clusters import find_visible_clusters, visible_observations
from dynresp.motion import rotations
from dynresp.motion.motion import Motion
from tests.locomotion.vision.samples import STEPPING, WAVING, stepping


def test_it_finds_the_two_actions(forest) -> None:
    clusters = find_visible_clusters(forest.graph, max_clusters=2)
    assert len(clusters) == 2
    assert len(np.unique(clusters.labels[:90])) == len(np.unique(clusters.labels[90:])) == 1
    assert clusters.labels[0] != clusters.labels[90]
    assert {int(forest.clusters.labels[k]) for k in clusters.examples} == {STEPPING, WAVING}


def test_a_cluster_without_frames_is_dropped(forest, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = find_visible_clusters(forest.graph, max_clusters=2)
    fit_mixture = frame_clusters.fit_mixture

    def with_an_empty_cluster(*args: object) -> MixtureFit:
        fit = fit_mixture(*args)
        own, far = fit.mixture, 1e6 + fit.mixture.means[:1]
        mixture = Mixture(
            np.append(0.5 * own.weights, 0.5),
            np.vstack([own.means, far]),
            np.append(own.variances, 1.0),
        )
        return dataclasses.replace(fit, mixture=mixture)

    monkeypatch.setattr(frame_clusters, "fit_mixture", with_an_empty_cluster)
    clusters = find_visible_clusters(forest.graph, max_clusters=2)
    assert len(clusters) == len(clusters.mixture) == 2
    np.testing.assert_array_equal(clusters.examples, plain.examples)
    np.testing.assert_array_equal(clusters.labels, plain.labels)
    assert clusters.log_probabilities.shape == (180, 2)
    np.testing.assert_allclose(clusters.mixture.weights, plain.mixture.weights)


def test_position_facing_and_the_twist_of_a_straight_arm_do_not_count(character) -> None:
    poses = stepping(character, 60)
    plain = visible_observations(
        MotionDatabase.from_motions([Motion(poses, 15.0)], character), character
    )
    assert plain.shape == (60, 40)
    moved = Motion(poses, 15.0).placed(3.0, -2.0, 2.5)
    twisted = moved.poses.copy()
    column = 7 + 4 * character.joint("left_shoulder")
    twisted[:, column : column + 4] = rotations.about_axis((0.0, 0.0, 1.0), np.full(60, 0.8))
    other = MotionDatabase.from_motions([Motion(twisted, 15.0)], character)
    np.testing.assert_allclose(visible_observations(other, character), plain, atol=1e-9)


def test_the_persons_speed_is_observed(character) -> None:
    poses = np.tile(character.rest_pose, (60, 1))
    poses[:, 1] += 1.2 * np.arange(60) / 15.0
    seen = visible_observations(
        MotionDatabase.from_motions([Motion(poses, 15.0)], character), character
    )
    # 1.2 m/s to the left, with a weight of 0.7.
    np.testing.assert_allclose(seen[:, -3:], [[0.0, 0.84, 0.0]] * 60, atol=1e-9)
