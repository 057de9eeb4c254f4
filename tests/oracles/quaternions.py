"""Slow, readable twins of `dynresp.motion.rotations`: one quaternion at a time, by definition."""

import math

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


def multiply(a: Vector, b: Vector) -> Vector:
    """Hamilton product from i j = k, j k = i, k i = j, i i = j j = k k = -1."""
    table = {  # (left, right) -> (sign, unit), units 1 i j k numbered 0 to 3
        (1, 1): (-1, 0), (2, 2): (-1, 0), (3, 3): (-1, 0),
        (1, 2): (1, 3), (2, 3): (1, 1), (3, 1): (1, 2),
        (2, 1): (-1, 3), (3, 2): (-1, 1), (1, 3): (-1, 2),
    }  # fmt: skip
    product = np.zeros(4)
    for i in range(4):
        for j in range(4):
            sign, unit = table[i, j] if i and j else (1, i + j)
            product[unit] += sign * a[i] * b[j]
    return product


def matrix(q: Vector) -> Vector:
    """Rotation matrix: its columns are q v q* for the three axes v."""
    inverse = np.array([q[0], -q[1], -q[2], -q[3]])
    columns = [multiply(multiply(q, np.array([0.0, *axis])), inverse)[1:] for axis in np.eye(3)]
    return np.stack(columns, axis=1)


def exponential(v: Vector) -> Vector:
    """Quaternion of a rotation vector: the power series of exp(v / 2)."""
    half = np.array([0.0, *v]) / 2.0
    total = term = np.array([1.0, 0.0, 0.0, 0.0])
    for n in range(1, 60):
        term = multiply(term, half) / n
        total = total + term
    return total


def angle(q: Vector) -> float:
    """Angle of a rotation [rad] from the trace of its matrix (poor near 0 and pi)."""
    return math.acos(min(max((np.trace(matrix(q)) - 1.0) / 2.0, -1.0), 1.0))


def slerp(a: Vector, b: Vector, t: float) -> Vector:
    """Shoemake's formula, the shorter way round (poor where a and b are close)."""
    cosine = float(a @ b)
    if cosine < 0:
        b, cosine = -b, -cosine
    omega = math.acos(min(cosine, 1.0))
    return (math.sin((1.0 - t) * omega) * a + math.sin(t * omega) * b) / math.sin(omega)


def facing(q: Vector, steps: int = 100_000) -> float:
    """The turn about the vertical that comes closest to q [rad], found by trying them."""
    yaw = np.linspace(-math.pi, math.pi, steps, endpoint=False)
    closeness = np.abs(np.cos(yaw / 2) * q[0] + np.sin(yaw / 2) * q[3])
    return float(yaw[np.argmax(closeness)])
