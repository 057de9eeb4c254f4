"""The compiled features of hits: states of bodies in the slices, from where contact was.

Importing this module compiles it (a second or two) or loads it from numba's cache; import it where
it is used. Written out joint by joint for one character at a time: a hit alone takes some
microseconds, where NumPy takes half a millisecond for its calls.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from dynresp.support.compiling import compiled

_REALS = types.Array(types.float64, 1, "C", readonly=True)
_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_HITS = types.Array(types.float64, 3, "C", readonly=True)
_INTS = types.Array(types.int64, 1, "C", readonly=True)
_SIGNATURE = types.void(
    _HITS, _HITS, _INTS, _INTS, _ROWS, _ROWS, _REALS, _INTS, types.float32[:, ::1]
)

# Below this length of the vector part of a quaternion its angle is twice that length.
_SMALL = 5e-7


@njit(inline="always")
def _multiply(a, b, out):
    """Hamilton product a b of quaternions w x y z."""
    w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@njit(inline="always")
def _rotate(q, v, out):
    """A vector turned by a quaternion."""
    p = 2.0 * (q[2] * v[2] - q[3] * v[1])
    s = 2.0 * (q[3] * v[0] - q[1] * v[2])
    r = 2.0 * (q[1] * v[1] - q[2] * v[0])
    x = v[0] + q[0] * p + q[2] * r - q[3] * s
    y = v[1] + q[0] * s + q[3] * p - q[1] * r
    z = v[2] + q[0] * r + q[1] * s - q[2] * p
    out[0], out[1], out[2] = x, y, z


@njit(inline="always")
def _write(cosine, sine, v, out, at):
    """A vector as seen from the facing at contact."""
    out[at] = cosine * v[0] + sine * v[1]
    out[at + 1] = cosine * v[1] - sine * v[0]
    out[at + 2] = v[2]


@compiled(_SIGNATURE)
def features_kernel(poses, velocities, frames, parents, offsets, centers, shares, chosen, features):
    """Write the features of hits.

    Args:
        poses: (hits, frames, 59) from contact on.
        velocities: (hits, frames, 45) rows of `qvel`.
        frames: (slices,) frames to tell the state of.
        parents: (bodies,) -1 for the pelvis; parents before children.
        offsets: (bodies, 3) origin of each in its parent's frame [m].
        centers: (bodies, 3) centre of mass of each in its own frame [m].
        shares: (bodies,) of the whole mass.
        chosen: Bodies whose states are told.
        features: Out, (hits, slices x (12 per body and 6 of the centre of mass)).
    """
    bodies, width = len(parents), 12 * len(chosen) + 6
    turn, place = np.empty((bodies, 4)), np.empty((bodies, 3))
    rate, speed = np.empty((bodies, 3)), np.empty((bodies, 3))
    middle, moved = np.empty((bodies, 3)), np.empty((bodies, 3))
    arm, seen, facing = np.empty(3), np.empty(4), np.zeros(4)
    whole, drift = np.empty(3), np.empty(3)
    for hit in range(len(poses)):
        first = poses[hit, 0]
        # The twist of the pelvis about the vertical, see `rotations.yaw_of`.
        yaw = 2.0 * math.atan2(-first[6] if first[3] < 0.0 else first[6], abs(first[3]))
        cosine, sine = math.cos(yaw), math.sin(yaw)
        facing[0], facing[3] = math.cos(0.5 * yaw), -math.sin(0.5 * yaw)
        for k in range(len(frames)):
            pose, qvel = poses[hit, frames[k]], velocities[hit, frames[k]]
            whole[:] = 0.0
            drift[:] = 0.0
            for body in range(bodies):
                own = pose[3 + 4 * body : 7 + 4 * body]
                parent = parents[body]
                if parent < 0:
                    turn[body] = own
                    for axis in range(3):
                        place[body, axis] = pose[axis] - (first[axis] if axis < 2 else 0.0)
                        speed[body, axis] = qvel[axis]
                    _rotate(turn[body], qvel[3 + 3 * body : 6 + 3 * body], rate[body])
                else:
                    _multiply(turn[parent], own, turn[body])
                    _rotate(turn[parent], offsets[body], arm)
                    _rotate(turn[body], qvel[3 + 3 * body : 6 + 3 * body], rate[body])
                    about = rate[parent]
                    for axis in range(3):
                        after, last = (axis + 1) % 3, (axis + 2) % 3
                        place[body, axis] = place[parent, axis] + arm[axis]
                        rate[body, axis] += about[axis]
                        across = about[after] * arm[last] - about[last] * arm[after]
                        speed[body, axis] = speed[parent, axis] + across
                _rotate(turn[body], centers[body], arm)
                about = rate[body]
                for axis in range(3):
                    after, last = (axis + 1) % 3, (axis + 2) % 3
                    across = about[after] * arm[last] - about[last] * arm[after]
                    middle[body, axis] = place[body, axis] + arm[axis]
                    moved[body, axis] = speed[body, axis] + across
                    whole[axis] += shares[body] * middle[body, axis]
                    drift[axis] += shares[body] * moved[body, axis]
            row, at = features[hit], k * width
            for which in range(len(chosen)):
                body = chosen[which]
                _write(cosine, sine, middle[body], row, at)
                _multiply(facing, turn[body], seen)
                sign = -1.0 if seen[0] < 0.0 else 1.0
                length = math.sqrt(seen[1] ** 2 + seen[2] ** 2 + seen[3] ** 2)
                scale = 2.0 * sign
                if length >= _SMALL:
                    scale *= math.atan2(length, sign * seen[0]) / length
                for axis in range(3):
                    row[at + 3 + axis] = scale * seen[1 + axis]
                _write(cosine, sine, moved[body], row, at + 6)
                _write(cosine, sine, rate[body], row, at + 9)
                at += 12
            _write(cosine, sine, whole, row, at)
            _write(cosine, sine, drift, row, at + 3)
