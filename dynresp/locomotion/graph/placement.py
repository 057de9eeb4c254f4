"""Placements: where a clip is put in the world, turned about the vertical, then shifted.

A placement is a row (x, y, z, yaw) [m, m, m, rad]. It takes a point p of the clip's own world to
R(yaw) p + (x, y, z). The planar state of a pose (its root's position and yaw) is a placement, too:
the one that takes a root at the origin that faces +X to the root of the pose.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.rotations import FloatArray

IDENTITY: FloatArray = np.zeros(4)
IDENTITY.flags.writeable = False


def of_poses(poses: FloatArray) -> FloatArray:
    """(n, 4) position and yaw of the roots of poses (n, 59)."""
    return np.concatenate([poses[:, ROOT], rotations.yaw_of(poses[:, ROOT_QUAT])[:, None]], axis=1)


def compose(outer: npt.ArrayLike, inner: npt.ArrayLike) -> FloatArray:
    """The placement `inner` followed by `outer`, (..., 4) each; shapes broadcast.

    The yaw is in (-pi, pi].
    """
    a, b = np.asarray(outer, dtype=np.float64), np.asarray(inner, dtype=np.float64)
    cosine, sine = np.cos(a[..., 3]), np.sin(a[..., 3])
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 0] + cosine * b[..., 0] - sine * b[..., 1]
    out[..., 1] = a[..., 1] + sine * b[..., 0] + cosine * b[..., 1]
    out[..., 2] = a[..., 2] + b[..., 2]
    out[..., 3] = wrapped(a[..., 3] + b[..., 3])
    return out


def inverse(placement: npt.ArrayLike) -> FloatArray:
    """The placement that undoes another, (..., 4)."""
    a = np.asarray(placement, dtype=np.float64)
    cosine, sine = np.cos(a[..., 3]), np.sin(a[..., 3])
    out = np.empty_like(a)
    out[..., 0] = -cosine * a[..., 0] - sine * a[..., 1]
    out[..., 1] = sine * a[..., 0] - cosine * a[..., 1]
    out[..., 2] = -a[..., 2]
    out[..., 3] = wrapped(-a[..., 3])
    return out


def place_poses(poses: FloatArray, placements: npt.ArrayLike) -> FloatArray:
    """Poses (n, 59) put where placements say: one (4,) for all, or one for each (n, 4)."""
    at = np.broadcast_to(np.asarray(placements, dtype=np.float64), (len(poses), 4))
    turns = rotations.from_yaw(at[:, 3])
    placed = np.array(poses)
    placed[:, ROOT] = rotations.rotate(turns, poses[:, ROOT]) + at[:, :3]
    placed[:, ROOT_QUAT] = rotations.multiply(turns, poses[:, ROOT_QUAT])
    return placed


def place_velocities(velocities: FloatArray, placements: npt.ArrayLike) -> FloatArray:
    """Rows of `qvel` (n, 45) of placed poses: the root's linear velocity is turned."""
    at = np.broadcast_to(np.asarray(placements, dtype=np.float64), (len(velocities), 4))
    placed = np.array(velocities)
    placed[:, ROOT] = rotations.rotate(rotations.from_yaw(at[:, 3]), velocities[:, ROOT])
    return placed


def wrapped(angle: npt.ArrayLike) -> FloatArray:
    """Angles [rad] brought into (-pi, pi]."""
    a = np.asarray(angle, dtype=np.float64)
    return np.pi - np.mod(np.pi - a, 2.0 * np.pi)
