"""The path of each foot along a course: it stands, rolls off the ground, swings and lands.

A swing over level ground has the shape that the published gait curves give (`walk.toml`): how far
the ankle has come, the pitch of the foot and the height of the ankle over a sole that touches, each
at equal times from leaving to touching down of a full stride; shorter ones are scaled. Walking
backward is the same in reverse. A step up, down or over something rises first and then goes on.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.builtin.course_plan import SWING_PITCH, Footfall
from dynresp.motion.builtin.footing import FootTargets, Sole, planted
from dynresp.motion.rotations import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# The same swing: part of the way that the ankle has come, and its height over the ground [m].
_PROGRESS = (0.0, 0.055, 0.139, 0.231, 0.332, 0.451, 0.583, 0.720, 0.850, 0.949, 1.0)
_ANKLE = (0.169, 0.186, 0.189, 0.183, 0.169, 0.146, 0.120, 0.097, 0.092, 0.090, 0.084)
# Height of a swing that goes nowhere, half-way [m].
_LIFT = 0.05
# Parts of a standing foot's pitch, after landing on the heel and before leaving from the ball, and
# the times that they take in that stride [s].
_FALLING, _FALL_S = (1.0, 0.24, 0.0), 0.093
_RISING, _RISE_S = (0.0, 0.035, 0.094, 0.206, 0.384, 0.67, 1.0), 0.28
# After landing on the ball, and before leaving from the heel [s].
_LOWER_S, _TIP_S = 0.20, 0.12
# Parts of its time at which a foot that is raised begins and ends to go on: up, down, and level.
_GOES_ON = {1: (0.15, 0.90), -1: (0.05, 0.75), 0: (0.08, 0.92)}
# In a jump: the part of the path that they travel at a constant speed.
_FLIES = 0.6
# From and to which part of the flight the feet are raised.
_DRAWN_UP = (0.35, 0.60)
# Part of the time in which a foot is raised, and how high its ankle passes before that [m].
_RAISING, _PASSING = 0.30, 0.16


def foot_track(falls: Sequence[Footfall], sole: Sole, times: FloatArray) -> FootTargets:
    """The track of one foot.

    Args:
        falls: Its stances in order of time; the first begins and the last ends with the course.
        sole: Its shape.
        times: (frames,) [s].
    """
    frames = len(times)
    ankles, feet = np.zeros((frames, 3)), rotations.identity(frames)
    locked = np.zeros(frames, dtype=np.bool_)
    pitch = _stance_pitch(falls, times)
    for fall in falls:
        # Rounding: a frame right at the end of a stance belongs to it.
        here = (times >= fall.land - 1e-9) & (times <= fall.leave + 1e-9)
        ankles[here], feet[here] = _planted(sole, fall, pitch[here], "auto")
        locked |= here
    for before, after in itertools.pairwise(falls):
        gap = np.flatnonzero((times > before.leave + 1e-9) & (times < after.land - 1e-9))
        u = (times[gap] - before.leave) / (after.land - before.leave)
        ankles[gap], feet[gap] = _swing(sole, before, after, u)
    return FootTargets(ankles, feet, np.ones(frames), locked)


def _planted(
    sole: Sole, fall: Footfall, pitch: FloatArray, pivot: str
) -> tuple[FloatArray, FloatArray]:
    """`footing.planted` at the place of a footfall."""
    ankles, foot = planted(sole, (fall.place.x, fall.place.y), fall.place.yaw, pitch, pivot)
    ankles[:, 2] += fall.place.z
    return ankles, foot


def _stance_pitch(falls: Sequence[Footfall], times: FloatArray) -> FloatArray:
    """Pitch of a foot while it stands [rad], toes up positive; of no meaning between."""
    from scipy.interpolate import PchipInterpolator

    points: dict[float, float] = {}
    for number, fall in enumerate(falls):
        last = number == len(falls) - 1
        length = times[-1] - fall.land if last else fall.leave - fall.land
        if number and fall.land_pitch > 0:
            for k, part in enumerate(_FALLING):
                points[fall.land + min(_FALL_S, length / 3) * k / 2] = fall.land_pitch * part
        else:
            points[fall.land] = fall.land_pitch
            points[fall.land + min(_LOWER_S, length / 3)] = 0.0
        if last:
            continue
        if fall.leave_pitch < 0:
            rise = min(_RISE_S, length / 2)
            for k, part in enumerate(_RISING):
                share = 1.0 - k / (len(_RISING) - 1)
                points[fall.leave - rise * share] = fall.leave_pitch * part
        else:
            points[fall.leave - min(_TIP_S, length / 2)] = 0.0
            points[fall.leave] = fall.leave_pitch
    at = np.array(sorted(points))
    curve = PchipInterpolator(at, np.radians([points[t] for t in at]))
    pitch: FloatArray = curve(np.clip(times, at[0], at[-1]))
    return pitch


def _swing(
    sole: Sole, before: Footfall, after: Footfall, u: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ankle and orientation of a foot in the air at parts u of its swing."""
    a, b = before.place, after.place
    backward = after.reach < 0 and after.top is None
    pitch = np.radians(_swing_pitch(before.leave_pitch, after.land_pitch, backward, u))
    yaw = rotations.from_yaw(a.yaw + rotations.ease(u) * (b.yaw - a.yaw))
    foot = rotations.multiply(yaw, rotations.about_axis((0.0, 1.0, 0.0), -pitch))
    edges = np.radians([before.leave_pitch, after.land_pitch])
    (start,), _ = _planted(sole, before, edges[:1], "auto")
    (stop,), _ = _planted(sole, after, edges[1:], "auto")
    path = np.empty((len(u), 3))
    if after.top is None:
        full = 1.0 - _curve(_PROGRESS, 1.0 - u) if backward else _curve(_PROGRESS, u)
        share = after.size * full + (1.0 - after.size) * rotations.ease(u)
        path[:, 2] = a.z + _level_height(
            sole, foot, 1.0 - u if backward else u, min(abs(after.reach), 1.0)
        )
    else:
        begin, end = (0.0, 1.0) if after.hop else _GOES_ON[int(np.sign(b.z - a.z))]
        share = rotations.ease((u - begin) / (end - begin))
        if after.hop:
            share = _FLIES * u + (1.0 - _FLIES) * share
        length = float(np.linalg.norm((stop - start)[:2]))
        # When the foot is as far from its landing as where it begins and ends to be raised.
        fine = np.linspace(0.0, 1.0, 101)
        left = length * (1.0 - rotations.ease((fine - begin) / (end - begin)))
        at = np.interp([-min(x, length) for x in after.over], -left, fine)
        if after.hop:
            at = np.array(_DRAWN_UP)
        path[:, 2] = _raised_height(sole, a.z, (start[2], stop[2]), after.top, at, u)
    path[:, :2] = start[:2] + share[:, None] * (stop - start)[:2]
    return path, foot


def _swing_pitch(leave: float, land: float, backward: bool, u: FloatArray) -> FloatArray:
    """Pitch [deg] on the way from one to the other, as the full stride's goes."""
    off = tuple(min(x, 0.0) / SWING_PITCH[0] for x in SWING_PITCH)
    on = tuple(max(x, 0.0) / SWING_PITCH[-1] for x in SWING_PITCH)
    if backward:
        off, on = on[::-1], off[::-1]
    return leave * _curve(off, u) + land * _curve(on, u)


def _level_height(sole: Sole, foot: FloatArray, u: FloatArray, size: float) -> FloatArray:
    """Height of the ankle over the ground in a low swing of a part of the full stride's size."""
    flat = rotations.about_axis((0.0, 1.0, 0.0), -np.radians(SWING_PITCH))
    over = _curve(tuple(_ANKLE - sole.ankle_height(flat)), u) * np.sin(np.pi * u) ** 0.5
    lift = (1.0 - size) * _LIFT * 16.0 * u**2 * (1.0 - u) ** 2
    height: FloatArray = sole.ankle_height(foot) + size * np.maximum(over, 0.0) + lift
    return height


def _raised_height(
    sole: Sole, low: float, ends: tuple[float, float], top: float, at: FloatArray, u: FloatArray
) -> FloatArray:
    """Height of the ankle [m] of a foot that is raised to pass over something.

    Args:
        sole: Its shape.
        low: Height of the surface that it leaves [m].
        ends: Heights of the ankle when it leaves and when it lands [m].
        top: Height of the sole while it is raised [m].
        at: Parts of its time from and to which it is.
        u: (n,) parts of its time.
    """
    from scipy.interpolate import PchipInterpolator

    # The toes hang by about this much on the way.
    hanging = rotations.about_axis((0.0, 1.0, 0.0), np.radians([15.0]))
    high = top + float(sole.ankle_height(hanging)[0])
    rise = max(float(at[0]), _RAISING)
    sink = min(max(float(at[1]), rise + 0.1), 0.85)
    knots = [(0.0, ends[0])]
    if rise > 1.5 * _RAISING:
        knots.append((rise - _RAISING, max(low + _PASSING, ends[0])))
    knots += [(rise, max(high, ends[0])), (sink, max(high, ends[1])), (1.0, ends[1])]
    height: FloatArray = PchipInterpolator(*np.array(knots).T)(u)
    return height


def _curve(values: tuple[float, ...], u: FloatArray) -> FloatArray:
    """A smooth curve through values at equal parts of 0 to 1, at u."""
    out: FloatArray = _spline(values)(u)
    return out


@functools.lru_cache(maxsize=32)
def _spline(values: tuple[float, ...]) -> CubicSpline:
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.linspace(0.0, 1.0, len(values)), values)
