"""Compiled loop of the features of hits: states of bodies in the slices after contact.

Importing this module compiles it (a second or two) or loads it from numba's cache; import it where
it is used. It goes joint by joint, one hit at a time: a hit takes some microseconds, while NumPy's
calls alone take half a millisecond.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from dynresp.motion.quaternion_kernel import multiply, rotate, row
from dynresp.support.compiling import compiled, helper

_REALS = types.Array(types.float64, 1, "C", readonly=True)
_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_HITS = types.Array(types.float64, 3, "C", readonly=True)
_INTS = types.Array(types.int64, 1, "C", readonly=True)
_SIGNATURE = types.void(
    _HITS, _HITS, _INTS, _INTS, _ROWS, _ROWS, _REALS, _INTS, types.float32[:, ::1]
)

# Below this length of the vector part of a quaternion its angle is twice that length.
_SMALL = 5e-7


@helper
def _write(cosine, sine, vector, features, hit, at):
    """Write a vector, turned to the facing at contact."""
    features[hit, at] = cosine * vector[0] + sine * vector[1]
    features[hit, at + 1] = cosine * vector[1] - sine * vector[0]
    features[hit, at + 2] = vector[2]


@compiled(_SIGNATURE, interpreted_first=True)
def features_kernel(poses, velocities, frames, parents, offsets, centers, shares, chosen, features):
    """Write the features of hits.

    Args:
        poses: (hits, frames, 59) from contact on.
        velocities: (hits, frames, 45) rows of `qvel`.
        frames: (slices,) frames whose states are features.
        parents: (bodies,) -1 for the pelvis; parents before children.
        offsets: (bodies, 3) origin of each in its parent's frame [m].
        centers: (bodies, 3) centre of mass of each in its own frame [m].
        shares: (bodies,) share of each in the whole mass.
        chosen: Indices of the bodies whose states are features.
        features: Out, (hits, features): for each slice 12 for each chosen body, then 6 for the
            centre of mass.
    """
    bodies, width = len(parents), 12 * len(chosen) + 6
    turn, place = np.empty((bodies, 4)), np.empty((bodies, 3))
    rate, speed = np.empty((bodies, 3)), np.empty((bodies, 3))
    middle, moved = np.empty((bodies, 3)), np.empty((bodies, 3))
    whole, drift = np.empty(3), np.empty(3)
    for hit in range(len(poses)):
        # The twist of the pelvis about the vertical, see `rotations.yaw_of`.
        w, z = poses[hit, 0, 3], poses[hit, 0, 6]
        yaw = 2.0 * math.atan2(-z if w < 0.0 else z, abs(w))
        cosine, sine = math.cos(yaw), math.sin(yaw)
        facing = (math.cos(0.5 * yaw), 0.0, 0.0, -math.sin(0.5 * yaw))
        for k in range(len(frames)):
            frame = frames[k]
            for axis in range(3):
                whole[axis] = drift[axis] = 0.0
            for body in range(bodies):
                parent, at = parents[body], 3 + 4 * body
                own = (
                    poses[hit, frame, at], poses[hit, frame, at + 1],
                    poses[hit, frame, at + 2], poses[hit, frame, at + 3],
                )  # fmt: skip
                if parent >= 0:
                    own = multiply(row(turn, parent), own)
                turn[body, 0], turn[body, 1], turn[body, 2], turn[body, 3] = own
                at = 3 + 3 * body
                rate[body, 0], rate[body, 1], rate[body, 2] = rotate(
                    own, velocities[hit, frame, at], velocities[hit, frame, at + 1],
                    velocities[hit, frame, at + 2],
                )  # fmt: skip
                if parent < 0:
                    for axis in range(3):
                        start = poses[hit, 0, axis] if axis < 2 else 0.0
                        place[body, axis] = poses[hit, frame, axis] - start
                        speed[body, axis] = velocities[hit, frame, axis]
                else:
                    x, y, z = rotate(
                        row(turn, parent), offsets[body, 0], offsets[body, 1], offsets[body, 2]
                    )
                    a, b, c = rate[parent, 0], rate[parent, 1], rate[parent, 2]
                    place[body, 0] = place[parent, 0] + x
                    place[body, 1] = place[parent, 1] + y
                    place[body, 2] = place[parent, 2] + z
                    rate[body, 0] += a
                    rate[body, 1] += b
                    rate[body, 2] += c
                    speed[body, 0] = speed[parent, 0] + (b * z - c * y)
                    speed[body, 1] = speed[parent, 1] + (c * x - a * z)
                    speed[body, 2] = speed[parent, 2] + (a * y - b * x)
                x, y, z = rotate(own, centers[body, 0], centers[body, 1], centers[body, 2])
                a, b, c = rate[body, 0], rate[body, 1], rate[body, 2]
                middle[body, 0] = place[body, 0] + x
                middle[body, 1] = place[body, 1] + y
                middle[body, 2] = place[body, 2] + z
                moved[body, 0] = speed[body, 0] + (b * z - c * y)
                moved[body, 1] = speed[body, 1] + (c * x - a * z)
                moved[body, 2] = speed[body, 2] + (a * y - b * x)
                for axis in range(3):
                    whole[axis] += shares[body] * middle[body, axis]
                    drift[axis] += shares[body] * moved[body, axis]
            at = k * width
            for which in range(len(chosen)):
                body = chosen[which]
                _write(
                    cosine,
                    sine,
                    (middle[body, 0], middle[body, 1], middle[body, 2]),
                    features,
                    hit,
                    at,
                )
                seen = multiply(facing, row(turn, body))
                sign = -1.0 if seen[0] < 0.0 else 1.0
                length = math.sqrt(seen[1] * seen[1] + seen[2] * seen[2] + seen[3] * seen[3])
                scale = 2.0 * sign
                if length >= _SMALL:
                    scale *= math.atan2(length, sign * seen[0]) / length
                features[hit, at + 3] = scale * seen[1]
                features[hit, at + 4] = scale * seen[2]
                features[hit, at + 5] = scale * seen[3]
                _write(
                    cosine,
                    sine,
                    (moved[body, 0], moved[body, 1], moved[body, 2]),
                    features,
                    hit,
                    at + 6,
                )
                _write(
                    cosine,
                    sine,
                    (rate[body, 0], rate[body, 1], rate[body, 2]),
                    features,
                    hit,
                    at + 9,
                )
                at += 12
            _write(cosine, sine, (whole[0], whole[1], whole[2]), features, hit, at)
            _write(cosine, sine, (drift[0], drift[1], drift[2]), features, hit, at + 3)
