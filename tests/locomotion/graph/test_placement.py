import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynresp.locomotion.graph import placement
from dynresp.motion.character import Character
from tests.motion.samples import random_poses

numbers = st.floats(-20.0, 20.0)
placements = st.tuples(numbers, numbers, numbers, st.floats(-np.pi, np.pi)).map(np.array)


@given(placements, placements, placements)
def test_composing_is_associative(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    left = placement.compose(placement.compose(a, b), c)
    right = placement.compose(a, placement.compose(b, c))
    np.testing.assert_allclose(left[:3], right[:3], atol=1e-12)
    assert abs(placement.wrapped(left[3] - right[3])) < 1e-12


@given(placements)
def test_an_inverse_undoes(a: np.ndarray) -> None:
    for both in (
        placement.compose(a, placement.inverse(a)),
        placement.compose(placement.inverse(a), a),
    ):
        np.testing.assert_allclose(both, placement.IDENTITY, atol=1e-12)


@given(st.floats(-50.0, 50.0))
def test_angles_are_wrapped(angle: float) -> None:
    wrapped = float(placement.wrapped(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.isclose(np.cos(wrapped), np.cos(angle))
    assert np.isclose(np.sin(wrapped), np.sin(angle))


@given(placements, st.integers(0, 1000))
def test_a_placed_pose_has_the_composed_placement(a: np.ndarray, seed: int) -> None:
    poses = random_poses(np.random.default_rng(seed), 3)
    placed = placement.of_poses(placement.place_poses(poses, a))
    wanted = placement.compose(a, placement.of_poses(poses))
    np.testing.assert_allclose(placed[:, :3], wanted[:, :3], atol=1e-9)
    turns = placement.wrapped(placed[:, 3] - wanted[:, 3])
    np.testing.assert_allclose(turns, 0.0, atol=1e-6)


def test_a_pose_for_each_placement(character: Character, rng: np.random.Generator) -> None:
    poses = random_poses(rng, 4)
    rows = rng.normal(size=(4, 4))
    together = placement.place_poses(poses, rows)
    for k in range(4):
        one = placement.place_poses(poses[k : k + 1], rows[k])
        np.testing.assert_array_equal(together[k], one[0])
