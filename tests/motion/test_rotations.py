import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from dynresp.motion import rotations as r
from tests.motion.samples import random_quaternions
from tests.oracles import quaternions as slow

number = st.floats(-1.0, 1.0)
direction = (
    st.tuples(number, number, number)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)
quaternion = (
    st.tuples(number, number, number, number)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(r.normalize)
)
# Angles of all sizes: plain ones, and ones very close to 0 and to pi.
tiny = st.floats(-18.0, -1.0).map(lambda power: 10.0**power)
angle = st.one_of(st.floats(0.0, math.pi), tiny, tiny.map(lambda x: math.pi - x))


def scipy(q: r.FloatArray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def assert_same_rotation(a: r.FloatArray, b: r.FloatArray, atol: float = 1e-12) -> None:
    a, b = np.broadcast_arrays(a, b)
    sign = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -1.0, 1.0)
    np.testing.assert_allclose(a, sign * b, atol=atol)


class TestAgainstScipy:
    def test_products_rotations_and_logarithms(self, rng: np.random.Generator) -> None:
        a, b = random_quaternions(rng, 2, 300)
        v = rng.normal(size=(300, 3))
        assert_same_rotation(r.multiply(a, b), (scipy(a) * scipy(b)).as_quat(scalar_first=True))
        assert_same_rotation(r.conjugate(a), scipy(a).inv().as_quat(scalar_first=True))
        np.testing.assert_allclose(r.rotate(a, v), scipy(a).apply(v), atol=1e-12)
        np.testing.assert_allclose(r.to_rotation_vector(a), scipy(a).as_rotvec(), atol=1e-12)
        angles = (scipy(a).inv() * scipy(b)).magnitude()
        np.testing.assert_allclose(r.angle_between(a, b), angles, atol=1e-12)
        expected = Rotation.from_rotvec(v).as_quat(scalar_first=True)
        assert_same_rotation(r.from_rotation_vector(v), expected)

    def test_slerp(self, rng: np.random.Generator) -> None:
        times = np.linspace(0.0, 1.0, 11)
        for a, b in zip(*random_quaternions(rng, 2, 30), strict=True):
            between = Slerp([0.0, 1.0], scipy(np.stack([a, b])))(times)
            assert_same_rotation(r.slerp(a, b, times), between.as_quat(scalar_first=True))

    def test_turns_about_an_axis(self) -> None:
        angles = np.linspace(-7.0, 7.0, 50)
        expected = Rotation.from_euler("Y", angles[:, None]).as_quat(scalar_first=True)
        assert_same_rotation(r.about_axis((0.0, 3.0, 0.0), angles), expected)


class TestAgainstSlowTwins:
    @given(quaternion, quaternion, direction)
    def test_products(self, a: r.FloatArray, b: r.FloatArray, v: r.FloatArray) -> None:
        np.testing.assert_allclose(r.multiply(a, b), slow.multiply(a, b), atol=1e-15)
        np.testing.assert_allclose(r.rotate(a, v), slow.matrix(a) @ v, atol=1e-14)

    @given(direction, st.floats(0.0, 12.0))
    def test_exponential(self, axis: r.FloatArray, size: float) -> None:
        expected = slow.exponential(size * axis)
        np.testing.assert_allclose(r.from_rotation_vector(size * axis), expected, atol=1e-12)
        np.testing.assert_allclose(r.about_axis(axis, size), expected, atol=1e-12)

    @given(quaternion, quaternion, st.floats(0.0, 1.0))
    def test_slerp_and_angle(self, a: r.FloatArray, b: r.FloatArray, t: float) -> None:
        apart = slow.angle(slow.multiply(r.conjugate(a), b))
        assert float(r.angle_between(a, b)) == pytest.approx(apart, abs=1e-6)
        if apart > 1e-3:
            assert_same_rotation(r.slerp(a, b, t), slow.slerp(a, b, t), atol=1e-9)

    @given(quaternion)
    def test_facing(self, q: r.FloatArray) -> None:
        if math.hypot(q[0], q[3]) > 1e-3:
            apart = abs(float(r.yaw_of(q)) - slow.facing(q))
            assert min(apart, 2.0 * math.pi - apart) < 1e-4


class TestNormalize:
    @pytest.mark.parametrize("size", [1e-320, 1e-200, 1e-3, 1.0, 1e3, 1e200, 1e308])
    def test_any_size(self, size: float) -> None:
        np.testing.assert_allclose(
            r.normalize(size * np.array([0.0, 1.0, 1.0, 0.0])), [0.0, 0.5**0.5, 0.5**0.5, 0.0]
        )

    def test_zero_becomes_the_identity(self) -> None:
        np.testing.assert_array_equal(r.normalize(np.zeros((2, 4))), r.identity(2))

    def test_twice_is_once_bit_for_bit(self, rng: np.random.Generator) -> None:
        once = r.normalize(rng.normal(size=(100_000, 4)) * 10.0 ** rng.uniform(-9, 9, (100_000, 1)))
        np.testing.assert_array_equal(r.normalize(once), once)
        np.testing.assert_allclose(np.linalg.norm(once, axis=-1), 1.0, atol=1e-15)


class TestExponentialAndLogarithm:
    @given(direction, angle)
    def test_round_trip_of_a_vector(self, axis: r.FloatArray, size: float) -> None:
        v = size * axis
        back = r.to_rotation_vector(r.from_rotation_vector(v))
        # At pi itself v and -v are the same rotation.
        error = np.linalg.norm(back - v)
        if size > math.pi - 1e-9:
            error = min(error, np.linalg.norm(back + v))
        assert error <= 1e-14 + 1e-15 * size

    @given(direction, tiny)
    def test_small_angles_keep_their_digits(self, axis: r.FloatArray, size: float) -> None:
        v = size * axis
        back = r.to_rotation_vector(r.from_rotation_vector(v))
        np.testing.assert_allclose(back, v, rtol=1e-12, atol=1e-14 * size)
        apart = r.angle_between(r.identity(), r.from_rotation_vector(v))
        assert float(apart) == pytest.approx(size, rel=1e-12)

    @given(quaternion)
    def test_round_trip_of_a_quaternion(self, q: r.FloatArray) -> None:
        v = r.to_rotation_vector(q)
        assert np.linalg.norm(v) <= math.pi + 1e-15
        assert_same_rotation(r.from_rotation_vector(v), q, atol=1e-14)
        if q[0] != 0.0:  # half a turn about v is half a turn about -v
            np.testing.assert_allclose(r.to_rotation_vector(-q), v, atol=1e-14)

    def test_nothing_turns_nothing(self) -> None:
        np.testing.assert_array_equal(r.from_rotation_vector(np.zeros(3)), r.identity())
        np.testing.assert_array_equal(r.to_rotation_vector(r.identity(2)), np.zeros((2, 3)))


class TestSlerp:
    @given(quaternion, quaternion)
    def test_ends_and_half(self, a: r.FloatArray, b: r.FloatArray) -> None:
        assert_same_rotation(r.slerp(a, b, 0.0), a, atol=1e-15)
        assert_same_rotation(r.slerp(a, b, 1.0), b, atol=1e-15)
        half = r.slerp(a, b, 0.5)
        assert float(r.angle_between(a, half)) == pytest.approx(
            float(r.angle_between(half, b)), abs=1e-12
        )

    @given(quaternion, quaternion, st.floats(0.0, 1.0))
    def test_signs_do_not_matter(self, a: r.FloatArray, b: r.FloatArray, t: float) -> None:
        if abs(a @ b) > 1e-9:  # 180 degrees apart, both ways round are as short
            assert_same_rotation(r.slerp(-a, b, t), r.slerp(a, b, t))
            assert_same_rotation(r.slerp(a, -b, t), r.slerp(a, b, t))

    @given(quaternion, direction, angle, st.floats(0.0, 1.0))
    def test_turns_evenly(self, a: r.FloatArray, axis: r.FloatArray, size: float, t: float) -> None:
        b = r.multiply(a, r.from_rotation_vector(size * axis))
        travelled = float(r.angle_between(a, r.slerp(a, b, t)))
        assert travelled == pytest.approx(t * size, rel=1e-9, abs=1e-14)

    def test_an_opposite_quaternion_is_the_same_rotation(self) -> None:
        q = r.normalize([1.0, 2.0, 3.0, 4.0])
        np.testing.assert_allclose(r.slerp(q, -q, [0.0, 0.3, 1.0]), np.tile(q, (3, 1)), atol=1e-15)

    def test_exact_at_the_ends(self, rng: np.random.Generator) -> None:
        a, b = r.make_continuous(random_quaternions(rng, 2, 1000))
        np.testing.assert_array_equal(r.slerp(a, b, 0.0), a)
        np.testing.assert_array_equal(r.slerp(a, b, 1.0), b)


class TestFacing:
    @given(st.floats(-math.pi + 1e-9, math.pi), number, st.floats(0.0, 2.0 * math.pi))
    def test_yaw_of_a_yaw_after_a_swing(self, yaw: float, tilt: float, heading: float) -> None:
        axis = np.array([math.cos(heading), math.sin(heading), 0.0])
        swing = r.about_axis(axis, 0.99 * math.pi * tilt)
        found = float(r.yaw_of(r.multiply(r.from_yaw(yaw), swing)))
        apart = abs(found - yaw)
        assert min(apart, abs(apart - 2.0 * math.pi)) < 1e-12
        # The swing may come first as well: the decomposition is the same from both sides.
        assert float(r.yaw_of(r.multiply(swing, r.from_yaw(yaw)))) == pytest.approx(found, abs=1e-9)

    @given(quaternion)
    def test_one_number_for_both_signs_within_half_a_turn(self, q: r.FloatArray) -> None:
        yaw = float(r.yaw_of(q))
        assert -math.pi < yaw <= math.pi
        assert float(r.yaw_of(-q)) == pytest.approx(yaw, abs=1e-15)

    def test_upside_down_faces_nowhere(self) -> None:
        assert float(r.yaw_of([0.0, 1.0, 0.0, 0.0])) == 0.0

    def test_half_a_turn_is_positive(self) -> None:
        assert float(r.yaw_of([0.0, 0.0, 0.0, 1.0])) == math.pi
        assert float(r.yaw_of([0.0, 0.0, 0.0, -1.0])) == math.pi


class TestBetweenVectors:
    @given(direction, direction, st.floats(0.01, 100.0))
    def test_turns_one_into_the_other(self, a: r.FloatArray, b: r.FloatArray, size: float) -> None:
        q = r.between_vectors(a, size * b)
        np.testing.assert_allclose(r.rotate(q, a), b, atol=1e-14)
        shortest = math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)
        assert float(r.angle_between(r.identity(), q)) == pytest.approx(shortest, abs=1e-9)

    @given(direction, direction, tiny)
    def test_nearly_opposite(self, a: r.FloatArray, other: r.FloatArray, size: float) -> None:
        b = -a + size * other
        b /= np.linalg.norm(b)
        np.testing.assert_allclose(r.rotate(r.between_vectors(a, b), a), b, atol=1e-14)

    @given(direction)
    def test_opposite_and_equal(self, a: r.FloatArray) -> None:
        np.testing.assert_allclose(r.rotate(r.between_vectors(a, -a), a), -a, atol=1e-14)
        np.testing.assert_allclose(r.between_vectors(a, a), r.identity(), atol=1e-15)

    def test_many_at_once(self, rng: np.random.Generator) -> None:
        a, b = rng.normal(size=(2, 5, 7, 3))
        turned = r.rotate(r.between_vectors(a, b), a / np.linalg.norm(a, axis=-1, keepdims=True))
        np.testing.assert_allclose(
            turned, b / np.linalg.norm(b, axis=-1, keepdims=True), atol=1e-14
        )


class TestMakeContinuous:
    def test_neighbours_share_a_hemisphere(self, rng: np.random.Generator) -> None:
        q = random_quaternions(rng, 50, 3)
        smooth = r.make_continuous(q)
        assert (np.sum(smooth[1:] * smooth[:-1], axis=-1) >= 0).all()
        np.testing.assert_array_equal(np.abs(smooth), np.abs(q))
        np.testing.assert_array_equal(smooth[0], q[0])

    def test_a_single_frame_stays(self) -> None:
        np.testing.assert_array_equal(r.make_continuous(-r.identity(1, 2)), -r.identity(1, 2))


def test_ease_starts_and_ends_gently() -> None:
    np.testing.assert_allclose(r.ease([-1.0, 0.0, 0.5, 1.0, 2.0]), [0.0, 0.0, 0.5, 1.0, 1.0])
    h = 1e-6
    assert float(r.ease(h)) / h < 1e-5
    assert (1.0 - float(r.ease(1.0 - h))) / h < 1e-5
    assert (np.diff(r.ease(np.linspace(0.0, 1.0, 100))) > 0).all()
