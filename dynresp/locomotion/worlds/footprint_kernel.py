"""The compiled footprint: how far a body reaches over the ground around its root.

Importing this module imports numba; import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.motion.kinematics_kernel import kinematics_kernel
from dynresp.support.compiling import compiled, helper

ROWS = types.Array(types.float64, 2, "C", readonly=True)
INTS = types.Array(types.int64, 1, "C", readonly=True)


class BodyShape(NamedTuple):
    """What the kernels need of a character.

    Attributes:
        parents: (bodies,) as of `Character`.
        offsets: (bodies, 3) as of `Character`.
        owners: (geoms,) the body to which each geom belongs.
        kinds: (geoms,) MuJoCo's number of its shape.
        sizes: (geoms, 3) its sizes [m].
        centers: (geoms, 3) its centre in the body's frame [m].
        turns: (geoms, 4) its orientation there, w x y z.
    """

    parents: Any
    offsets: Any
    owners: Any
    kinds: Any
    sizes: Any
    centers: Any
    turns: Any


BODY = types.BaseTuple.from_types((INTS, ROWS, INTS, INTS, ROWS, ROWS, ROWS), BodyShape)
"""Type of a `BodyShape`."""

SPHERE, CAPSULE, BOX = 2, 3, 6
"""MuJoCo's numbers of the shapes that a body may have."""


@helper(inline="always")
def _level(q, v):
    """Level part (x and y) of a vector that is rotated by a quaternion."""
    p = 2.0 * (q[2] * v[2] - q[3] * v[1])
    s = 2.0 * (q[3] * v[0] - q[1] * v[2])
    r = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return v[0] + q[0] * p + q[2] * r - q[3] * s, v[1] + q[0] * s + q[3] * p - q[1] * r


@helper
def footprint(pose, positions, quaternions, body, out):
    """Write the footprint of one pose.

    Args:
        pose: (59,).
        positions: (bodies, 3) origins of the bodies in that pose.
        quaternions: (bodies, 4) their orientations.
        body: `BodyShape`.
        out: Out, (4,) least x, largest x, least y, largest y in the root's facing frame [m].
    """
    owners, kinds, sizes = body.owners, body.kinds, body.sizes
    # The yaw of `rotations.yaw_of`, by the cosine and sine of its half.
    w, z = (pose[3], pose[6]) if pose[3] >= 0.0 else (-pose[3], -pose[6])
    length = math.sqrt(w * w + z * z)
    half_c, half_s = (w / length, z / length) if length > 0.0 else (1.0, 0.0)
    cosine, sine = half_c * half_c - half_s * half_s, 2.0 * half_c * half_s
    out[0], out[1], out[2], out[3] = math.inf, -math.inf, math.inf, -math.inf
    axis, turn = np.empty(3), np.empty(4)
    for geom in range(len(owners)):
        a, b = quaternions[owners[geom]], body.turns[geom]
        turn[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
        turn[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
        turn[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
        turn[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
        x, y = _level(a, body.centers[geom])
        x += positions[owners[geom], 0] - pose[0]
        y += positions[owners[geom], 1] - pose[1]
        half_x = half_y = 0.0
        if kinds[geom] != BOX:
            half_x = half_y = sizes[geom, 0]
        for side in range(3):
            if kinds[geom] == SPHERE or (kinds[geom] == CAPSULE and side != 2):
                continue
            # A capsule's second size is half of its length, along its z.
            size = sizes[geom, 1] if kinds[geom] == CAPSULE else sizes[geom, side]
            axis[:] = 0.0
            axis[side] = size
            along_x, along_y = _level(turn, axis)
            half_x += abs(cosine * along_x + sine * along_y)
            half_y += abs(cosine * along_y - sine * along_x)
        ahead, aside = cosine * x + sine * y, cosine * y - sine * x
        out[0] = min(out[0], ahead - half_x)
        out[1] = max(out[1], ahead + half_x)
        out[2] = min(out[2], aside - half_y)
        out[3] = max(out[3], aside + half_y)


@compiled(types.void(ROWS, BODY, types.float64[:, ::1]))
def footprints_kernel(poses, body, out):
    """Write the footprints of many poses.

    Args:
        poses: (n, 59).
        body: `BodyShape`.
        out: Out, (n, 4); see `footprint`.
    """
    parents, offsets = body.parents, body.offsets
    states = (1, len(parents))
    positions, centers = np.empty((*states, 3)), np.empty((*states, 3))
    quaternions = np.empty((*states, 4))
    nowhere = np.zeros((len(parents), 3))
    for k in range(len(poses)):
        kinematics_kernel(
            poses[k : k + 1], parents, offsets, nowhere, positions, quaternions, centers
        )
        footprint(poses[k], positions[0], quaternions[0], body, out[k])
