"""Compiled loop of the features of hits: states of bodies in the slices after contact.

It goes joint by joint, one hit at a time: a hit takes some microseconds, while NumPy's calls alone
take half a millisecond. Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.motion.quaternion_kernel import multiply, rotate, row
from dynresp.support.compiling import compiled, helper

_HITS = types.Array(types.float64, 3, "C", readonly=True)
_INTS = types.Array(types.int64, 1, "C", readonly=True)


class Body(NamedTuple):
    """What the features need of a character.

    Attributes:
        parents: (bodies,) -1 for the pelvis; parents before children.
        offsets: (bodies, 3) origin of each in its parent's frame [m].
        centers: (bodies, 3) centre of mass of each in its own frame [m].
        shares: (bodies,) share of each in the whole mass.
        chosen: Indices of the bodies whose states are features.
    """

    parents: Any
    offsets: Any
    centers: Any
    shares: Any
    chosen: Any


class _State(NamedTuple):
    """Bodies in the world.

    Attributes:
        turn: (bodies, 4) orientations.
        place: (bodies, 3) origins [m].
        speed: (bodies, 3) velocities of the origins [m/s].
        rate: (bodies, 3) angular velocities [rad/s].
    """

    turn: Any
    place: Any
    speed: Any
    rate: Any


_INTEGERS, _NUMBERS, _TABLE = types.int64[::1], types.float64[::1], types.float64[:, ::1]
_BODY = types.BaseTuple.from_types((_INTEGERS, _TABLE, _TABLE, _NUMBERS, _INTEGERS), Body)
_SIGNATURE = types.void(_HITS, _HITS, _INTS, _BODY, types.float32[:, ::1])

# Below this length of the vector part of a quaternion its angle is twice that length.
_SMALL = 5e-7


@helper
def _write(cosine, sine, vector, features, hit, at):
    """Write a vector, turned to the facing at contact."""
    features[hit, at] = cosine * vector[0] + sine * vector[1]
    features[hit, at + 1] = cosine * vector[1] - sine * vector[0]
    features[hit, at + 2] = vector[2]


@helper
def _vector(rows, k):
    """Row k of an array of vectors."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


@helper
def _set(rows, k, vector):
    """Write row k of an array of vectors."""
    rows[k, 0], rows[k, 1], rows[k, 2] = vector


@helper
def _point(state, body, arms, k):
    """Position and velocity of the point `arms[k]` of a body, given in the body's frame."""
    x, y, z = rotate(row(state.turn, body), arms[k, 0], arms[k, 1], arms[k, 2])
    a, b, c = _vector(state.rate, body)
    place, speed = _vector(state.place, body), _vector(state.speed, body)
    return (
        (place[0] + x, place[1] + y, place[2] + z),
        (speed[0] + (b * z - c * y), speed[1] + (c * x - a * z), speed[2] + (a * y - b * x)),
    )


@helper
def _move(pose, velocity, start, body, state):
    """Write the states of all bodies in a frame.

    Args:
        pose: (59,) of the frame.
        velocity: (45,) row of `qvel`.
        start: Position of the pelvis over the ground at contact, x and y [m].
        body: `Body`.
        state: Out, `_State`; positions count from `start`.
    """
    for k in range(len(body.parents)):
        parent, at = body.parents[k], 3 + 4 * k
        own = (pose[at], pose[at + 1], pose[at + 2], pose[at + 3])
        if parent >= 0:
            own = multiply(row(state.turn, parent), own)
        state.turn[k, 0], state.turn[k, 1], state.turn[k, 2], state.turn[k, 3] = own
        at = 3 + 3 * k
        rate = rotate(own, velocity[at], velocity[at + 1], velocity[at + 2])
        if parent < 0:
            _set(state.place, k, (pose[0] - start[0], pose[1] - start[1], pose[2]))
            _set(state.speed, k, (velocity[0], velocity[1], velocity[2]))
            _set(state.rate, k, rate)
        else:
            place, speed = _point(state, parent, body.offsets, k)
            a, b, c = _vector(state.rate, parent)
            _set(state.place, k, place)
            _set(state.speed, k, speed)
            _set(state.rate, k, (rate[0] + a, rate[1] + b, rate[2] + c))


@helper
def _rotation_vector(q):
    """The rotation vector of a unit quaternion, at most half a turn."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    length = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign
    if length >= _SMALL:
        scale *= math.atan2(length, sign * q[0]) / length
    return scale * q[1], scale * q[2], scale * q[3]


@compiled(_SIGNATURE, interpreted_first=True)
def features_kernel(poses, velocities, frames, body, features):
    """Write the features of hits.

    Args:
        poses: (hits, frames, 59) from contact on.
        velocities: (hits, frames, 45) rows of `qvel`.
        frames: (slices,) frames whose states are features.
        body: `Body`.
        features: Out, (hits, features): for each slice 12 for each chosen body, then 6 for the
            centre of mass.
    """
    bodies, width = len(body.parents), 12 * len(body.chosen) + 6
    state = _State(
        np.empty((bodies, 4)), np.empty((bodies, 3)), np.empty((bodies, 3)), np.empty((bodies, 3))
    )
    middle, moved = np.empty((bodies, 3)), np.empty((bodies, 3))
    whole, drift = np.empty((1, 3)), np.empty((1, 3))
    for hit in range(len(poses)):
        # The twist of the pelvis about the vertical, see `rotations.yaw_of`.
        w, z = poses[hit, 0, 3], poses[hit, 0, 6]
        yaw = 2.0 * math.atan2(-z if w < 0.0 else z, abs(w))
        cosine, sine = math.cos(yaw), math.sin(yaw)
        facing = (math.cos(0.5 * yaw), 0.0, 0.0, -math.sin(0.5 * yaw))
        start = (poses[hit, 0, 0], poses[hit, 0, 1])
        for slice_ in range(len(frames)):
            frame = frames[slice_]
            _move(poses[hit, frame], velocities[hit, frame], start, body, state)
            _set(whole, 0, (0.0, 0.0, 0.0))
            _set(drift, 0, (0.0, 0.0, 0.0))
            for k in range(bodies):
                place, speed = _point(state, k, body.centers, k)
                _set(middle, k, place)
                _set(moved, k, speed)
                for axis in range(3):
                    whole[0, axis] += body.shares[k] * middle[k, axis]
                    drift[0, axis] += body.shares[k] * moved[k, axis]
            at = slice_ * width
            for k in body.chosen:
                _write(cosine, sine, _vector(middle, k), features, hit, at)
                seen = _rotation_vector(multiply(facing, row(state.turn, k)))
                features[hit, at + 3], features[hit, at + 4], features[hit, at + 5] = seen
                _write(cosine, sine, _vector(moved, k), features, hit, at + 6)
                _write(cosine, sine, _vector(state.rate, k), features, hit, at + 9)
                at += 12
            _write(cosine, sine, _vector(whole, 0), features, hit, at)
            _write(cosine, sine, _vector(drift, 0), features, hit, at + 3)
