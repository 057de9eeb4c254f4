"""The compiled inner loop of playing a walk: placements, displacements, poses.

Importing this module compiles it or loads it from numba's cache; import it where it is used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from dynresp.support.compiling import compiled

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_ROW = types.Array(types.float64, 1, "C", readonly=True)
_FRAMES = types.Array(types.int32, 1, "C", readonly=True)
_FLAGS = types.Array(types.boolean, 1, "C", readonly=True)
_OUT = types.float64[:, ::1]
_STATE = types.float64[::1]
_DISPLACE = types.void(_ROW, _ROW, _ROW, _ROW, _ROW, _STATE, _STATE)
_PLAY = types.void(
    _ROWS, _ROWS, _FRAMES, _FLAGS, _ROWS, types.float64, types.float64, types.float64,
    _STATE, _STATE, _STATE, _STATE, _OUT, _OUT, _OUT,
)  # fmt: skip


@njit(inline="always")
def _turn(yaw, q, out):
    """A quaternion turned about the vertical."""
    c, s = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0] = c * w - s * z
    out[1] = c * x - s * y
    out[2] = c * y + s * x
    out[3] = c * z + s * w


@njit(inline="always")
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


@njit(inline="always")
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


@njit(inline="always")
def _move(place, dx, dy, dz, turn):
    """A placement followed by one that is seen from it."""
    cosine, sine = math.cos(place[3]), math.sin(place[3])
    place[0] += cosine * dx - sine * dy
    place[1] += sine * dx + cosine * dy
    place[2] += dz
    yaw = place[3] + turn
    place[3] = yaw - 2.0 * math.pi * math.ceil(yaw / (2.0 * math.pi) - 0.5)


@njit
def _decay(offset, rate, age, blend_s, rate_s):
    """Bring a displacement and its rate to what they are at an age: cubics that end at rest.

    The root takes twice as long as joints to change its speed: with as short a time it would jerk,
    while joints would swing too far with a longer one.
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


@njit
def _put(pose, place, offset, out):
    """A recorded pose, placed and displaced."""
    cosine, sine = math.cos(place[3]), math.sin(place[3])
    out[0] = place[0] + cosine * pose[0] - sine * pose[1] + offset[0]
    out[1] = place[1] + sine * pose[0] + cosine * pose[1] + offset[1]
    out[2] = place[2] + pose[2] + offset[2]
    _turn(place[3], pose[3:7], out[3:7])
    for i in range(7, 59):
        out[i] = pose[i]
    for joint in range(14):
        q, at = out[3 + 4 * joint : 7 + 4 * joint], 3 + 3 * joint
        _turned_by(q, offset[at], offset[at + 1], offset[at + 2], q)


@njit
def _jacobian(x, y, z, v, inverse, out):
    """The right Jacobian of rotations at a rotation vector o = (x, y, z), or its inverse, times v.

    It takes the rate of change of o to the angular velocity of the rotation by o, in the turned
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


@njit
def _turned_back(x, y, z, v, out):
    """A vector v seen from a frame that is turned by a rotation vector (x, y, z)."""
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


@njit
def _carry_on(velocity, place, offset, rate, out):
    """How a recorded frame moves that is placed and displaced."""
    cosine, sine = math.cos(place[3]), math.sin(place[3])
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


@njit
def _displace(pose, velocity, place, recorded, its_velocity, offset, rate):
    """What to displace a placed frame by, for it to be a pose that moves with a velocity."""
    cosine, sine = math.cos(place[3]), math.sin(place[3])
    offset[0] = pose[0] - (place[0] + cosine * recorded[0] - sine * recorded[1])
    offset[1] = pose[1] - (place[1] + sine * recorded[0] + cosine * recorded[1])
    offset[2] = pose[2] - (place[2] + recorded[2])
    rate[0] = velocity[0] - (cosine * its_velocity[0] - sine * its_velocity[1])
    rate[1] = velocity[1] - (sine * its_velocity[0] + cosine * its_velocity[1])
    rate[2] = velocity[2] - its_velocity[2]
    turned, beyond = np.empty(4), np.empty(3)
    for joint in range(14):
        q, at = 3 + 4 * joint, 3 + 3 * joint
        for i in range(4):
            turned[i] = recorded[q + i]
        if joint == 0:
            _turn(place[3], turned, turned)
        _turn_between(turned, pose[q : q + 4], offset[at : at + 3])
        x, y, z = offset[at], offset[at + 1], offset[at + 2]
        _turned_back(x, y, z, its_velocity[at : at + 3], beyond)
        for i in range(3):
            beyond[i] = velocity[at + i] - beyond[i]
        _jacobian(x, y, z, beyond, True, rate[at : at + 3])


@compiled(_DISPLACE)
def displacement_kernel(pose, velocity, place, recorded, its_velocity, offset, rate):
    """Write what a placed frame is displaced by for it to be a pose that moves with a velocity.

    Args:
        pose: (59,) the pose.
        velocity: (45,) how it moves.
        place: (4,) where the frame is put.
        recorded: (59,) the frame.
        its_velocity: (45,) how that moves, in its own world.
        offset: Out, (45,) displacement of the root [m], then rotation vectors of the root and the
            joints in their own frames [rad].
        rate: Out, (45,) its rate of change [1/s].
    """
    _displace(pose, velocity, place, recorded, its_velocity, offset, rate)


@compiled(_PLAY)
def play_kernel(
    poses, velocities, frames, jumps, moves, fps, blend_s, rate_s,
    place, offset, rate, age, played, placements, moving,
):  # fmt: skip
    """Write the poses of a walk; the state goes on from one call to the next.

    Args:
        poses: (n, 59) of the database.
        velocities: (n, 45) of the database.
        frames: (k + 1,) the frame played before, then those to play.
        jumps: (k,) whether each is reached by a jump.
        moves: (k, 4) where the clip of each is put, seen from the clip before; read at jumps.
        fps: Frame rate.
        blend_s: Time over which a displacement decays [s].
        rate_s: Time over which the rate of joints does, at most as long; the root's takes twice it.
        place: In and out, (4,) where the clip is put.
        offset: In and out, (45,) displacement at the last jump; see `displacement_kernel`.
        rate: In and out, (45,) its rate of change then.
        age: In and out, (1,) time since then [s].
        played: Out, (k, 59).
        placements: Out, (k, 4) where the clip of each frame was put.
        moving: Out, (k, 45) how each pose moves.
    """
    pose, velocity = np.empty(59), np.empty(45)
    now, its_rate = np.empty(45), np.empty(45)
    for k in range(len(jumps)):
        frame = frames[k + 1]
        if jumps[k]:
            # The pose and velocity at the frame left as they were played: what is still displaced
            # there counts, so that blends overlap.
            left = frames[k]
            now[:], its_rate[:] = offset, rate
            _decay(now, its_rate, age[0], blend_s, rate_s)
            _put(poses[left], place, now, pose)
            _carry_on(velocities[left], place, now, its_rate, velocity)
            _move(place, moves[k, 0], moves[k, 1], moves[k, 2], moves[k, 3])
            _displace(pose, velocity, place, poses[frame - 1], velocities[frame - 1], offset, rate)
            age[0] = 0.0
        age[0] += 1.0 / fps
        if age[0] < blend_s:
            now[:], its_rate[:] = offset, rate
            _decay(now, its_rate, age[0], blend_s, rate_s)
        else:
            now[:], its_rate[:] = 0.0, 0.0
        _put(poses[frame], place, now, played[k])
        _carry_on(velocities[frame], place, now, its_rate, moving[k])
        for i in range(4):
            placements[k, i] = place[i]
