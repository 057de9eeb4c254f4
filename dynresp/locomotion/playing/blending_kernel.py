"""Compiled loop of playing a walk: placements, displacements, poses.

Importing this module imports numba; so import it where it is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_ROW = types.Array(types.float64, 1, "C", readonly=True)
_OUT = types.float64[:, ::1]
_STATE = types.float64[::1]


class Recording(NamedTuple):
    """The frames of a database: poses (n, 59) and velocities (n, 45), rows of `qpos` and `qvel`."""

    poses: Any
    velocities: Any


class Steps(NamedTuple):
    """The frames to play.

    Attributes:
        frames: (k + 1,) the frame played before, then those to play.
        jumps: (k,) whether each is reached by a jump.
        moves: (k, 4) placement of each frame's clip relative to the clip before; read at jumps.
    """

    frames: Any
    jumps: Any
    moves: Any


class BlendTimes(NamedTuple):
    """Frame rate and times of blending.

    Attributes:
        fps: Frame rate [1/s].
        blend_s: Time over which a displacement decays [s].
        rate_s: Time over which the rate of joints decays, at most `blend_s`; the root takes twice
            as long [s].
    """

    fps: float
    blend_s: float
    rate_s: float


class Blend(NamedTuple):
    """What remains of the last jump, after the frame played last.

    Attributes:
        placement: (4,) of the clip.
        offset: (45,) displacement at the last jump: of the root [m], then rotation vectors of the
            root and the joints in their own frames [rad].
        rate: (45,) its rate of change at the last jump [m/s, rad/s].
        age: (1,) time since the last jump [s].
    """

    placement: Any
    offset: Any
    rate: Any
    age: Any


class PlayedRows(NamedTuple):
    """Arrays for what is played: poses (k, 59), placements (k, 4) and velocities (k, 45)."""

    poses: Any
    placements: Any
    velocities: Any


_DISPLACE = types.void(_ROW, _ROW, _ROW, _ROW, _ROW, _STATE, _STATE)
_PLAY = types.void(
    types.NamedUniTuple(_ROWS, 2, Recording),
    types.NamedTuple((types.int32[::1], types.boolean[::1], _OUT), Steps),
    types.NamedUniTuple(types.float64, 3, BlendTimes),
    types.NamedUniTuple(_STATE, 4, Blend),
    types.NamedUniTuple(_OUT, 3, PlayedRows),
)


@helper(inline="always")
def _turn(yaw, q, out):
    """A quaternion turned about the vertical."""
    c, s = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0] = c * w - s * z
    out[1] = c * x - s * y
    out[2] = c * y + s * x
    out[3] = c * z + s * w


@helper(inline="always")
def _turned_by(q, x, y, z, out):
    """The quaternion q times the rotation by |v| about v = (x, y, z)."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-6:
        factor, w = 0.5 - angle * angle / 48.0, 1.0 - angle * angle / 8.0
    else:
        factor, w = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
    x, y, z = factor * x, factor * y, factor * z
    a, b, c, d = q[0], q[1], q[2], q[3]
    out[0] = a * w - b * x - c * y - d * z
    out[1] = a * x + b * w + c * z - d * y
    out[2] = a * y - b * z + c * w + d * x
    out[3] = a * z + b * y - c * x + d * w


@helper(inline="always")
def _turn_between(a, b, out):
    """Rotation vector of inverse(a) times b, the shorter way."""
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    x = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    y = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]
    z = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 if sine < 0.5e-6 else 2.0 * math.atan2(sine, w) / sine
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@helper(inline="always")
def _move(placement, dx, dy, dz, turn):
    """Move a placement (in place) by another, which is relative to it."""
    cosine, sine = math.cos(placement[3]), math.sin(placement[3])
    placement[0] += cosine * dx - sine * dy
    placement[1] += sine * dx + cosine * dy
    placement[2] += dz
    yaw = placement[3] + turn
    placement[3] = yaw - 2.0 * math.pi * math.ceil(yaw / (2.0 * math.pi) - 0.5)


@helper
def _decay(offset, rate, age, blend_s, rate_s):
    """Decay a displacement and its rate (in place) to an age: cubics that end at rest.

    The root takes twice as long as the joints to change its speed: in a shorter time it would jerk,
    and in a longer one joints would swing too far.
    """
    s = min(age / blend_s, 1.0)
    from_offset = (2.0 * s - 3.0) * s * s + 1.0
    slope_of_offset = 6.0 * (s - 1.0) * s / blend_s
    for i in range(45):
        lasts = min(2.0 * rate_s, blend_s) if i < 6 else rate_s
        u = min(age / lasts, 1.0)
        from_rate = ((u - 2.0) * u + 1.0) * u * lasts
        slope_of_rate = (3.0 * u - 4.0) * u + 1.0
        o, r = offset[i], rate[i]
        offset[i] = from_offset * o + from_rate * r
        rate[i] = slope_of_offset * o + slope_of_rate * r


@helper
def _put(pose, placement, offset, out):
    """A recorded pose, placed and displaced."""
    cosine, sine = math.cos(placement[3]), math.sin(placement[3])
    out[0] = placement[0] + cosine * pose[0] - sine * pose[1] + offset[0]
    out[1] = placement[1] + sine * pose[0] + cosine * pose[1] + offset[1]
    out[2] = placement[2] + pose[2] + offset[2]
    _turn(placement[3], pose[3:7], out[3:7])
    for i in range(7, 59):
        out[i] = pose[i]
    for joint in range(14):
        q, at = out[3 + 4 * joint : 7 + 4 * joint], 3 + 3 * joint
        _turned_by(q, offset[at], offset[at + 1], offset[at + 2], q)


@helper
def _jacobian(x, y, z, v, inverse, out):
    """The right Jacobian of rotations at a rotation vector o = (x, y, z), or its inverse, times v.

    It maps the rate of change of o to the angular velocity of the rotation by o, in the turned
    frame: 1 - (1 - cos a) / a^2 [o] + (a - sin a) / a^3 [o]^2, where a = |o|.
    """
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if inverse:
        first = 0.5
        if angle < 1e-3:
            second = 1.0 / 12.0 + square / 720.0
        else:
            second = 1.0 / square - 0.5 / (angle * math.tan(0.5 * angle))
    elif angle < 1e-3:
        first, second = -0.5 + square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        first = -(1.0 - math.cos(angle)) / square
        second = (angle - math.sin(angle)) / (square * angle)
    a, b, c = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    out[0] = v[0] + first * a + second * (y * c - z * b)
    out[1] = v[1] + first * b + second * (z * a - x * c)
    out[2] = v[2] + first * c + second * (x * b - y * a)


@helper
def _turned_back(x, y, z, v, out):
    """A vector v in the axes of a frame that is turned by a rotation vector (x, y, z)."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-3:
        first, second = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    a, b, c = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    out[0] = v[0] - first * a + second * (y * c - z * b)
    out[1] = v[1] - first * b + second * (z * a - x * c)
    out[2] = v[2] - first * c + second * (x * b - y * a)


@helper
def _put_velocity(velocity, placement, offset, rate, out):
    """The velocity of a recorded frame, placed and displaced."""
    cosine, sine = math.cos(placement[3]), math.sin(placement[3])
    out[0] = cosine * velocity[0] - sine * velocity[1] + rate[0]
    out[1] = sine * velocity[0] + cosine * velocity[1] + rate[1]
    out[2] = velocity[2] + rate[2]
    turning = np.empty(3)
    for at in range(3, 45, 3):
        x, y, z = offset[at], offset[at + 1], offset[at + 2]
        _turned_back(x, y, z, velocity[at : at + 3], out[at : at + 3])
        _jacobian(x, y, z, rate[at : at + 3], False, turning)
        for i in range(3):
            out[at + i] += turning[i]


@helper
def _displace(pose, velocity, placement, recorded, its_velocity, offset, rate):
    """The displacement that turns a placed frame into a given pose with a given velocity."""
    cosine, sine = math.cos(placement[3]), math.sin(placement[3])
    offset[0] = pose[0] - (placement[0] + cosine * recorded[0] - sine * recorded[1])
    offset[1] = pose[1] - (placement[1] + sine * recorded[0] + cosine * recorded[1])
    offset[2] = pose[2] - (placement[2] + recorded[2])
    rate[0] = velocity[0] - (cosine * its_velocity[0] - sine * its_velocity[1])
    rate[1] = velocity[1] - (sine * its_velocity[0] + cosine * its_velocity[1])
    rate[2] = velocity[2] - its_velocity[2]
    turned, beyond = np.empty(4), np.empty(3)
    for joint in range(14):
        q, at = 3 + 4 * joint, 3 + 3 * joint
        for i in range(4):
            turned[i] = recorded[q + i]
        if joint == 0:
            _turn(placement[3], turned, turned)
        _turn_between(turned, pose[q : q + 4], offset[at : at + 3])
        x, y, z = offset[at], offset[at + 1], offset[at + 2]
        _turned_back(x, y, z, its_velocity[at : at + 3], beyond)
        for i in range(3):
            beyond[i] = velocity[at + i] - beyond[i]
        _jacobian(x, y, z, beyond, True, rate[at : at + 3])


@compiled(_DISPLACE)
def displacement_kernel(pose, velocity, placement, recorded, its_velocity, offset, rate):
    """Write the displacement that turns a placed frame into a given pose with a given velocity.

    Args:
        pose: (59,) the pose.
        velocity: (45,) its velocity.
        placement: (4,) placement of the frame.
        recorded: (59,) the frame, in its own world.
        its_velocity: (45,) velocity of the frame, in its own world.
        offset: Out, (45,) see `Blend`.
        rate: Out, (45,) see `Blend`.
    """
    _displace(pose, velocity, placement, recorded, its_velocity, offset, rate)


@compiled(_PLAY)
def play_kernel(recording, steps, times, blend, played):
    """Play frames of a walk.

    Args:
        recording: The `Recording`.
        steps: The `Steps`.
        times: The `BlendTimes`.
        blend: In and out, the `Blend`; the next call continues from it.
        played: Out, the `PlayedRows`.
    """
    poses, velocities = recording
    frames, jumps, moves = steps
    placement, offset, rate, age = blend
    pose, velocity = np.empty(59), np.empty(45)
    now, its_rate = np.empty(45), np.empty(45)
    for k in range(len(jumps)):
        frame = frames[k + 1]
        if jumps[k]:
            # Pose and velocity as played at the frame left, with what remains of earlier
            # displacements: so blends overlap.
            left = frames[k]
            now[:], its_rate[:] = offset, rate
            _decay(now, its_rate, age[0], times.blend_s, times.rate_s)
            _put(poses[left], placement, now, pose)
            _put_velocity(velocities[left], placement, now, its_rate, velocity)
            _move(placement, moves[k, 0], moves[k, 1], moves[k, 2], moves[k, 3])
            _displace(
                pose, velocity, placement, poses[frame - 1], velocities[frame - 1], offset, rate
            )
            age[0] = 0.0
        age[0] += 1.0 / times.fps
        if age[0] < times.blend_s:
            now[:], its_rate[:] = offset, rate
            _decay(now, its_rate, age[0], times.blend_s, times.rate_s)
        else:
            now[:], its_rate[:] = 0.0, 0.0
        _put(poses[frame], placement, now, played.poses[k])
        _put_velocity(velocities[frame], placement, now, its_rate, played.velocities[k])
        for i in range(4):
            played.placements[k, i] = placement[i]
