from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.frame_distance import JOINT_WEIGHTS, frame_distances, frame_features
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.motion import rotations
from dynresp.motion.character import VELOCITY_SIZE, Character
from dynresp.support.errors import MotionError
from tests.locomotion.graph.graph_samples import wandering_poses
from tests.oracles import motion_graph as oracle

ALL = [GraphConfig(coordinates=coordinates) for coordinates in Coordinates]
NAMES = tuple(JOINT_WEIGHTS)
each = pytest.mark.parametrize("config", ALL, ids=[c.coordinates.value for c in ALL])


def frames(seed, count=12):
    """Poses in random places facing anywhere, and velocities."""
    rng = np.random.default_rng(seed)
    poses = wandering_poses(rng, count, spread=0.8)
    poses[:, :3] += rng.normal(0.0, 3.0, (count, 3))
    return poses, rng.normal(0.0, 3.0, (count, VELOCITY_SIZE))


def all_distances(poses, velocities, config):
    features = frame_features(poses, velocities, config)
    n = np.arange(len(poses))
    return frame_distances(features, n[:, None], n[None, :])


def moved(poses, velocities, yaw, shift):
    turn = rotations.from_yaw(yaw)
    linear = rotations.rotate(turn, velocities[:, :3])
    velocities = np.concatenate([linear, velocities[:, 3:]], axis=1)
    return placement.place_poses(poses, [*shift, yaw]), velocities


def test_weights_are_in_the_order_of_a_pose(character: Character):
    assert tuple(JOINT_WEIGHTS) == character.joint_names


@each
@given(seed=st.integers(0, 2**32 - 1))
def test_it_equals_its_slow_twin(config, seed):
    poses, velocities = frames(seed, 4)
    expected = oracle.matrix(poses, velocities, NAMES, config)
    np.testing.assert_allclose(all_distances(poses, velocities, config), expected, atol=1e-9)


@each
@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_symmetric_and_zero_to_itself_and_does_not_know_q_from_minus_q(config, seed):
    poses, velocities = frames(seed)
    distances = all_distances(poses, velocities, config)
    np.testing.assert_allclose(distances, distances.T, atol=1e-10)
    assert not np.diagonal(distances).any()
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(poses), 14, 1))
    poses[:, 3:] = (signs * poses[:, 3:].reshape(-1, 14, 4)).reshape(len(poses), -1)
    np.testing.assert_allclose(all_distances(poses, velocities, config), distances, atol=1e-10)


@given(
    seed=st.integers(0, 2**32 - 1),
    yaw=st.floats(-10.0, 10.0),
    x=st.floats(-50.0, 50.0),
    y=st.floats(-50.0, 50.0),
)
def test_relative_distance_does_not_change_with_place_and_facing(seed, yaw, x, y):
    config = GraphConfig(coordinates=Coordinates.RELATIVE)
    poses, velocities = frames(seed)
    others = moved(poses, velocities, yaw, (x, y, 0.0))
    both = [np.concatenate(pair) for pair in zip((poses, velocities), others, strict=True)]
    distances = all_distances(*both, config)
    n = len(poses)
    np.testing.assert_allclose(distances[n:, :n], distances[:n, :n], atol=1e-8)
    np.testing.assert_allclose(distances[n:, n:], distances[:n, :n], atol=1e-8)


@given(
    seed=st.integers(0, 2**32 - 1),
    turns=st.integers(-4, 4),
    blocks=st.tuples(*[st.integers(-20, 20)] * 3),
)
def test_on_blocks_it_does_not_change_with_quarter_turns_and_whole_blocks(seed, turns, blocks):
    config = GraphConfig(coordinates=Coordinates.BLOCKS, block_m=0.5, block_height_m=0.2)
    poses, velocities = frames(seed)
    shift = np.array([0.5, 0.5, 0.2]) * blocks
    others = moved(poses, velocities, 0.5 * np.pi * turns, shift)
    features = frame_features(
        *(np.concatenate(pair) for pair in zip((poses, velocities), others, strict=True)), config
    )
    n = np.arange(len(poses))
    plain = frame_distances(features, n[:, None], n[None, :])
    np.testing.assert_allclose(frame_distances(features, n, n + len(n)), 0.0, atol=1e-9)
    placed = frame_distances(features, n[:, None], n[None, :] + len(n))
    # A residual of half a block, or of an eighth of a turn, has two nearest neighbours.
    np.testing.assert_allclose(placed, plain, atol=1e-7)


def test_on_blocks_half_a_block_and_an_eighth_of_a_turn_count():
    config = GraphConfig(coordinates=Coordinates.BLOCKS, block_m=0.6, block_height_m=0.2)
    poses = np.tile(wandering_poses(np.random.default_rng(3), 1), (2, 1))
    poses[:, 3:7] = rotations.identity()
    still = np.zeros((2, VELOCITY_SIZE))
    poses[1, :3] += (0.9, -1.3, 0.45)
    expected = 0.3**2 + 0.1**2 + 0.05**2
    assert all_distances(poses, still, config)[0, 1] == pytest.approx(expected)
    poses[1, :3] = poses[0, :3] = 0.0
    poses[1, 3:7] = rotations.from_yaw(np.pi / 2 + 0.3)
    assert all_distances(poses, still, config)[0, 1] == pytest.approx(0.15**2)


def test_what_counts():
    config = GraphConfig(coordinates=Coordinates.FIXED, velocity_weight=0.25)
    pose = np.concatenate([np.zeros(3), rotations.identity(14).ravel()])
    still = np.zeros(VELOCITY_SIZE)

    def apart(change, speed=None):
        other, its_velocity = pose.copy(), still.copy()
        change(other)
        if speed:
            its_velocity[speed[0]] = speed[1]
        return all_distances(np.stack([pose, other]), np.stack([still, its_velocity]), config)[0, 1]

    def turned(joint):
        def change(other):
            other[7 + 4 * joint : 11 + 4 * joint] = rotations.about_axis((0.6, 0.8, 0.0), 0.4)

        return change

    for index, weight in enumerate(JOINT_WEIGHTS.values()):
        assert apart(turned(index)) == pytest.approx(weight * 0.2**2)
        assert apart(lambda _: None, (6 + 3 * index, 2.0)) == pytest.approx(weight * 0.25)
    assert apart(lambda other: other.__setitem__(1, 0.3)) == pytest.approx(0.09)
    assert apart(lambda _: None, (0, 2.0)) == pytest.approx(0.25 * 4.0)
    assert apart(lambda _: None, (4, 2.0)) == pytest.approx(0.25 * 1.0)


def test_relative_velocity_is_that_of_the_facing_frame():
    config = GraphConfig(coordinates=Coordinates.RELATIVE, velocity_weight=1.0)
    pose = np.concatenate([np.zeros(3), rotations.identity(14).ravel()])
    back = pose.copy()
    back[3:7] = rotations.from_yaw(np.pi)
    velocities = np.zeros((3, VELOCITY_SIZE))
    velocities[:, 0] = 1.0, -1.0, -1.0
    distances = all_distances(np.stack([pose, back, pose]), velocities, config)
    # One walks to +X, one has turned round and walks to -X: the same. The third walks backward.
    assert distances[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert distances[0, 2] == pytest.approx(4.0)


def test_features_are_read_only_and_bad_input_is_refused():
    poses, velocities = frames(0)
    features = frame_features(poses, velocities, ALL[0])
    with pytest.raises(ValueError, match="read-only"):
        features.positions[0, 0] = 1.0
    with pytest.raises(MotionError, match="velocities must be"):
        frame_features(poses, velocities[:-1], ALL[0])
    with pytest.raises(MotionError, match="not finite"):
        frame_features(poses, np.where(velocities > 0, np.nan, velocities), ALL[0])


def test_nu_of_zero_leaves_poses_alone():
    poses, velocities = frames(1)
    config = replace(ALL[0], velocity_weight=0.0)
    with_others = all_distances(poses, velocities[::-1], config)
    np.testing.assert_array_equal(all_distances(poses, velocities, config), with_others)
