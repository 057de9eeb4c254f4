"""Quaternions for compiled code, as tuples w x y z; the same as in `dynresp.motion.rotations`.

Vectors are three numbers, so that nothing is put on the heap.
"""

from __future__ import annotations

import math

from dynresp.support.compiling import helper


@helper
def multiply(a, b):
    """The rotation b followed by the rotation a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@helper
def from_to(a, b):
    """The rotation, in the world, that leads from orientation a to b."""
    return multiply(b, (a[0], -a[1], -a[2], -a[3]))


@helper
def rotate(q, x, y, z):
    """A vector rotated."""
    p = 2.0 * (q[2] * z - q[3] * y)
    s = 2.0 * (q[3] * x - q[1] * z)
    r = 2.0 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * p + q[2] * r - q[3] * s,
        y + q[0] * s + q[3] * p - q[1] * r,
        z + q[0] * r + q[1] * s - q[2] * p,
    )


@helper
def row(rows, k):
    """The quaternion in row k of (n, 4)."""
    return rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]


@helper
def to_vector(q):
    """Rotation vector [rad], the shorter way round."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign
    if sine > 1e-9:
        scale *= math.atan2(sine, sign * q[0]) / sine
    return scale * q[1], scale * q[2], scale * q[3]


@helper
def from_vector(x, y, z):
    """Quaternion of a rotation vector [rad]."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5
    if angle > 1e-9:
        scale = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), scale * x, scale * y, scale * z


@helper
def yaw_of(q):
    """Facing [rad]: the twist about the vertical."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    return 2.0 * math.atan2(sign * q[3], sign * q[0])
