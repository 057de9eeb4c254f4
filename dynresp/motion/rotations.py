"""Quaternions in NumPy: w x y z, float64, any leading shape.

Quaternions are unit length unless said otherwise; q and -q are the same rotation, and every
function here treats them so.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]

# Below this angle [rad] series replace quotients such as sin(x)/x.
_SMALL_ANGLE = 1e-6
# A length this close to 1 is 1 but for the rounding of one normalisation.
_UNIT_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)


def identity(*shape: int) -> FloatArray:
    """Identity quaternions of shape (*shape, 4)."""
    q = np.zeros((*shape, 4))
    q[..., 0] = 1.0
    return q


def normalize(q: npt.ArrayLike) -> FloatArray:
    """Scale quaternions of any finite size to unit length; a zero one becomes the identity.

    Those that are of unit length but for rounding stay as they are, bit for bit: normalising
    twice is normalising once.
    """
    q = np.asarray(q, dtype=np.float64)
    # The largest part first: squares of huge or tiny numbers would overflow or vanish.
    largest = np.max(np.abs(q), axis=-1, keepdims=True)
    scaled = np.where(largest > 0, q / np.where(largest > 0, largest, 1.0), identity(*q.shape[:-1]))
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    is_unit = np.abs(np.minimum(largest, 2.0) * length - 1.0) <= _UNIT_ROUNDING
    return np.where(is_unit, q, scaled / length)


def conjugate(q: npt.ArrayLike) -> FloatArray:
    """Inverse rotation of unit quaternions."""
    inverse: FloatArray = np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Hamilton product a b: the rotation b followed by the rotation a. Shapes broadcast."""
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    product = np.empty((*np.broadcast_shapes(aw.shape, bw.shape), 4))
    product[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def rotate(q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
    """Rotate vectors (..., 3) by unit quaternions (..., 4). Shapes broadcast."""
    q = np.asarray(q, dtype=np.float64)
    v = np.asarray(v, dtype=np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    a, b, c = v[..., 0], v[..., 1], v[..., 2]
    # v + w t + u x t with t = 2 u x v, written out: np.cross costs five times as much.
    p = 2.0 * (y * c - z * b)
    s = 2.0 * (z * a - x * c)
    r = 2.0 * (x * b - y * a)
    turned = np.empty((*np.broadcast_shapes(w.shape, a.shape), 3))
    turned[..., 0] = a + w * p + y * r - z * s
    turned[..., 1] = b + w * s + z * p - x * r
    turned[..., 2] = c + w * r + x * s - y * p
    return turned


def from_rotation_vector(v: npt.ArrayLike) -> FloatArray:
    """Quaternion of the rotation by |v| radians about v (exponential map), (..., 3) -> (..., 4)."""
    v = np.asarray(v, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    small = angle < _SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    factor = np.where(small, 0.5 - angle**2 / 48.0, np.sin(0.5 * safe) / safe)
    return np.concatenate([np.cos(0.5 * angle), factor * v], axis=-1)


def to_rotation_vector(q: npt.ArrayLike) -> FloatArray:
    """Rotation vector [rad] of at most pi, the shorter way round, (..., 4) -> (..., 3)."""
    q = np.asarray(q, dtype=np.float64)
    q = np.where(q[..., :1] < 0, -q, q)
    norm = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    small = norm < 0.5 * _SMALL_ANGLE
    safe = np.where(small, 1.0, norm)
    # atan2, not acos: near the identity acos keeps only half of the digits.
    factor = np.where(small, 2.0, 2.0 * np.arctan2(safe, q[..., :1]) / safe)
    return factor * q[..., 1:]


def angle_between(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Angle [rad], 0 to pi, of the rotation from a to b. Shapes broadcast."""
    d = multiply(conjugate(a), b)
    angle: FloatArray = 2.0 * np.arctan2(np.linalg.norm(d[..., 1:], axis=-1), np.abs(d[..., 0]))
    return angle


def about_axis(axis: npt.ArrayLike, angle: npt.ArrayLike) -> FloatArray:
    """Quaternion of a rotation by angle [rad] about an axis (3,); angle of any shape."""
    unit = np.asarray(axis, dtype=np.float64)
    unit = unit / np.linalg.norm(unit)
    half = 0.5 * np.asarray(angle, dtype=np.float64)[..., None]
    return np.concatenate([np.cos(half), np.sin(half) * unit], axis=-1)


def from_yaw(yaw: npt.ArrayLike) -> FloatArray:
    """Quaternion of a turn by yaw [rad] about the vertical (Z), counter-clockwise from above."""
    return about_axis((0.0, 0.0, 1.0), yaw)


def yaw_of(q: npt.ArrayLike) -> FloatArray:
    """Facing [rad]: the twist of q about the vertical, in (-pi, pi].

    Swing-twist decomposition. Unlike the direction in which an axis of the body points on the
    ground, it stays defined when the body lies level; only a body exactly upside down has none,
    and then 0 is returned.
    """
    q = np.asarray(q, dtype=np.float64)
    w, z = q[..., 0], q[..., 3]
    yaw: FloatArray = 2.0 * np.arctan2(np.where(w < 0, -z, z), np.abs(w))
    return np.where(yaw <= -np.pi, yaw + 2.0 * np.pi, yaw)


def between_vectors(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Shortest rotation that turns direction a into direction b; (..., 3), any length but zero.

    For opposite directions any axis perpendicular to a would do; one is chosen.
    """
    start = np.asarray(a, dtype=np.float64)
    stop = np.asarray(b, dtype=np.float64)
    start = start / np.linalg.norm(start, axis=-1, keepdims=True)
    stop = stop / np.linalg.norm(stop, axis=-1, keepdims=True)
    middle, chord = start + stop, stop - start
    # (middle . middle, middle x chord) is twice (1 + a . b, a x b), the textbook's quaternion;
    # it keeps its digits where a and b are nearly opposite and 1 + a . b has none left.
    length = np.linalg.norm(middle, axis=-1, keepdims=True)
    opposite = length < 1e-15
    bisector = middle / np.where(opposite, 1.0, length)
    # The coordinate axis most unlike a, made perpendicular to it.
    other = np.eye(3)[np.argmin(np.abs(start), axis=-1)]
    axis = np.where(opposite, np.cross(start, other), np.cross(bisector, chord))
    return normalize(np.concatenate([np.where(opposite, 0.0, length), axis], axis=-1))


def slerp(a: npt.ArrayLike, b: npt.ArrayLike, t: npt.ArrayLike) -> FloatArray:
    """Spherical interpolation from a (t = 0) to b (t = 1), the shorter way round.

    Args:
        a: Quaternions (..., 4).
        b: Quaternions (..., 4).
        t: Parameter, broadcast against the leading shape of a and b.

    Returns:
        Quaternions (..., 4).
    """
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    t = np.asarray(t, dtype=np.float64)[..., None]
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    # Half the angle from the chord: exact near zero, where acos(cosine) is not.
    angle = 2.0 * np.arctan2(
        np.linalg.norm(b - a, axis=-1, keepdims=True), np.linalg.norm(b + a, axis=-1, keepdims=True)
    )
    sine = np.sin(angle)
    small = sine < _SMALL_ANGLE
    safe = np.where(small, 1.0, sine)
    wa = np.where(small, 1.0 - t, np.sin((1.0 - t) * angle) / safe)
    wb = np.where(small, t, np.sin(t * angle) / safe)
    return normalize(wa * a + wb * b)


def make_continuous(q: npt.ArrayLike) -> FloatArray:
    """Choose signs along the first axis so that neighbours lie in one hemisphere."""
    q = np.array(q, dtype=np.float64)
    if len(q) > 1:
        flips = np.sum(q[1:] * q[:-1], axis=-1) < 0
        sign = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
        q[1:] *= sign[..., None]
    return q


def ease(t: npt.ArrayLike) -> FloatArray:
    """Ease-in/ease-out: 0 to 1 with no speed and no acceleration at both ends; t is clipped.

    The quintic of least jerk, 6 t^5 - 15 t^4 + 10 t^3, by which people move a hand from one place
    to another (Flash & Hogan 1985, J. Neuroscience 5(7), eq. 3). Zordan et al. 2007 (section 6)
    ask for "EIEO" weights without a formula; the usual cubic starts with a jump in acceleration.
    """
    x: FloatArray = np.clip(np.asarray(t, dtype=np.float64), 0.0, 1.0)
    weight: FloatArray = x**3 * (x * (6.0 * x - 15.0) + 10.0)
    return weight
