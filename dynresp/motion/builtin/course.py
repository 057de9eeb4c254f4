"""From the plan of a course to poses: balance moves the body, the feet are put where they go.

The centre of mass follows from the centre of pressure. Moments about the latter balance when

    (h) x'' = (g + z'') (x - p)

for the horizontal position x of a body whose centre of mass is h above the ground, p being the
centre of pressure (the table-cart model of Kajita et al. 2003, Biped walking pattern generation by
using preview control of zero-moment point, ICRA). With x at rest over p at both ends
this is a boundary value problem with one solution, a tridiagonal system at the frames. The body
sways over the standing foot, leans into a start and out of a stop, and in the air (z'' = -g) goes
straight on.

What trunk and arms do follows the feet: by how far one is ahead of the other, they turn and swing
as far as the gait curves of `walk.toml` let them. The plan's postures are added.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.builtin.course_feet import foot_track
from dynresp.motion.builtin.course_plan import FULL_STEP, GRAVITY, CoursePlan, plan_course
from dynresp.motion.builtin.footing import FootTargets, Sole, place_feet
from dynresp.motion.builtin.keypose_spec import BuiltinSpec
from dynresp.motion.builtin.keyposes import add_sway, channel_poses, frame_times
from dynresp.motion.builtin.posture_spec import CHANNELS
from dynresp.motion.character import ROOT, Character
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

# Rounds of moving the pelvis so that the centre of mass is where balance wants it.
_ROUNDS = 3
# Standard deviations of the Gaussians that round what the feet and the plan say [s].
_TURN_S, _ARM_S, _LOAD_S, _POSTURE_S = 0.10, 0.08, 0.07, 0.04
# The head turns to where the body will face after this time [s], by at most this [deg].
_LOOK_S, _LOOK_DEG = 0.4, 40.0
# A swinging leg is stretched to this part of its length, and by less than this beyond it; the time
# over which this is eased in after standing, and out before [s].
_EASY, _REST, _REACH_S = 0.985, 0.01, 0.10
# Ordinary walking [m/s], from which the elbows are bent in full.
_SPEED = 1.23
# What the body does all the time [deg].
_UPRIGHT = {
    "pelvis.pitch": 1.5, "waist.flexion": 2.0, "back.flexion": 2.0, "neck.flexion": -1.0,
    "left_shoulder.flexion": 1.0, "right_shoulder.flexion": 1.0,
    "left_shoulder.abduction": 8.0, "right_shoulder.abduction": 8.0,
    "left_elbow": 16.0, "right_elbow": 16.0,
}  # fmt: skip
# What it does [deg] where the right foot is a full step ahead of the left one.
_STRIDE = {
    "pelvis.yaw": 5.0, "waist.rotation": -4.0, "back.rotation": -4.0, "neck.rotation": 3.0,
    "left_shoulder.flexion": 16.0, "right_shoulder.flexion": -16.0,
    "left_elbow": 9.0, "right_elbow": -9.0,
}  # fmt: skip
# What it does where the left foot bears it alone, and where it walks.
_LOADED = {"pelvis.roll": -3.5, "waist.lateral": 3.0}
_WALKING = {
    "left_shoulder.flexion": -5.0, "right_shoulder.flexion": -5.0,
    "left_elbow": 11.0, "right_elbow": 11.0,
}  # fmt: skip


def course_poses(spec: BuiltinSpec, character: Character) -> tuple[FloatArray, list[FootTargets]]:
    """Poses (frames, 59) of a file with a course, and the tracks of its feet."""
    if spec.course is None:
        raise ValueError(f"{spec.name} has no course")
    plan = plan_course(spec.course)
    times = frame_times(plan.duration, spec.fps)
    soles = [Sole.of(character, side) for side in FEET]
    tracks = [foot_track(*each, times) for each in zip(plan.feet, soles, strict=True)]
    heights, lift = _heights(plan, times)
    channels = _channels(plan, tracks, times, spec.fps)
    channels["pelvis.height"] = channels["pelvis.height"] + heights
    add_sway(spec, times, channels)
    _point_knees(channels, tracks)

    pressure = _along(plan.pressure, times)
    # The splines of a fast step may ask for more, but the ground does not pull.
    lift = np.clip(lift, -GRAVITY, GRAVITY)
    offset = np.zeros((len(times), 3))
    offset[:, 2] = 0.07
    for _ in range(_ROUNDS):
        height = channels["pelvis.height"] + offset[:, 2] - pressure[:, 2]
        center = balance(pressure[:, :2], height, lift, spec.fps)
        for axis, name in enumerate(("pelvis.x", "pelvis.y")):
            channels[name] = center[:, axis] - offset[:, axis]
        poses = place_feet(character, channel_poses(channels, character), tracks, spec.fps)
        offset = center_of_mass(character, poses) - poses[:, ROOT]
    reached = [
        _within_reach(character, poses, track, side, spec.fps)
        for side, track in zip(FEET, tracks, strict=True)
    ]
    return place_feet(character, poses, reached, spec.fps), tracks


def balance(pressure: FloatArray, height: FloatArray, lift: FloatArray, fps: float) -> FloatArray:
    """Where the centre of mass is so that the moments about the centre of pressure balance.

    Args:
        pressure: (frames, 2) centre of pressure [m].
        height: (frames,) centre of mass above it [m], > 0.
        lift: (frames,) vertical acceleration [m/s^2], -g in the air.
        fps: Frame rate [1/s].

    Returns:
        (frames, 2) [m], over the centre of pressure in the first and the last frame.
    """
    from scipy.linalg import solve_banded

    stiff = height * fps**2
    bands = np.zeros((3, len(pressure)))
    bands[0, 2:] = bands[2, :-2] = stiff[1:-1]
    bands[1] = -2.0 * stiff - (GRAVITY + lift)
    bands[1, [0, -1]] = 1.0
    wanted = -(GRAVITY + lift)[:, None] * pressure
    wanted[[0, -1]] = pressure[[0, -1]]
    center: FloatArray = solve_banded((1, 1), bands, wanted)
    return center


def center_of_mass(character: Character, poses: FloatArray) -> FloatArray:
    """(frames, 3) [m]."""
    centers = character.kinematics(poses).centers
    out: FloatArray = np.einsum("fbi,b->fi", centers, character.masses / character.masses.sum())
    return out


def _within_reach(
    character: Character, poses: FloatArray, track: FootTargets, side: str, fps: float
) -> FootTargets:
    """The track, moved towards the hip where it swings farther away than a leg reaches well."""
    from scipy.ndimage import distance_transform_edt

    states = character.kinematics(poses)
    hip = states.positions[:, character.body(f"{side}_thigh")]
    bones = [character.body(f"{side}_{bone}") for bone in ("shank", "foot")]
    length = float(np.linalg.norm(character.offsets[bones], axis=1).sum())
    away = track.ankles - hip
    stretch = np.linalg.norm(away, axis=1) / length
    over = np.maximum(stretch - _EASY, 0.0)
    # Beyond that it goes on more and more slowly, and never reaches the leg's whole length.
    least = np.minimum(stretch, _EASY) + _REST * (1.0 - np.exp(-over / _REST))
    near = distance_transform_edt(~track.locked) / fps
    share = rotations.ease(near / _REACH_S) * (least / stretch - 1.0)
    return dataclasses.replace(track, ankles=track.ankles + share[:, None] * away)


def _channels(
    plan: CoursePlan, tracks: Sequence[FootTargets], times: FloatArray, fps: float
) -> dict[str, FloatArray]:
    """What the body does, except where the pelvis is over the ground."""
    channels = {name: np.zeros(len(times)) for name in CHANNELS}

    def add(angles: dict[str, float], share: FloatArray | float) -> None:
        for name, angle in angles.items():
            channels[name] += angle * share

    facing = _smooth(_through(plan.headings, times), _TURN_S * fps)
    forward = np.stack([np.cos(facing), np.sin(facing)], axis=1)
    between = (tracks[1].ankles - tracks[0].ankles)[:, :2]
    ahead = np.clip(_smooth((between * forward).sum(axis=1) / FULL_STEP, _ARM_S * fps), -1.2, 1.2)
    loaded = tracks[0].locked.astype(float) - tracks[1].locked
    middle = 0.5 * (tracks[0].ankles + tracks[1].ankles)[:, :2]
    speed = np.linalg.norm(np.gradient(_smooth(middle, 0.25 * fps), 1.0 / fps, axis=0), axis=1)
    add(_UPRIGHT, 1.0)
    add(_STRIDE, ahead)
    add(_LOADED, _smooth(loaded, _LOAD_S * fps))
    add(_WALKING, np.minimum(speed / _SPEED, 1.0))
    channels["pelvis.yaw"] += np.degrees(facing)
    look = np.interp(times + _LOOK_S, times, facing) - facing
    channels["neck.rotation"] += np.clip(np.degrees(look), -_LOOK_DEG, _LOOK_DEG)
    for name in CHANNELS:
        points = [(time, posture.get(name, 0.0)) for time, posture in plan.postures]
        if any(value for _, value in points):
            channels[name] += _smooth(_through(points, times), _POSTURE_S * fps)
    return channels


def _point_knees(channels: dict[str, FloatArray], tracks: Sequence[FootTargets]) -> None:
    """Turn the legs half-way from the pelvis to where the toes point: the knees bend there."""
    facing = np.radians(channels["pelvis.yaw"])
    for side, outward, track in zip(FEET, (1.0, -1.0), tracks, strict=True):
        toes = rotations.yaw_of(track.quaternions) - facing
        toes = np.degrees(np.arctan2(np.sin(toes), np.cos(toes)))
        channels[f"{side}_hip.rotation"] += 0.5 * outward * toes


def _heights(plan: CoursePlan, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Height of the pelvis (frames,) [m], through the plan's, and its acceleration [m/s^2]."""
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    at, values, speeds = np.array(plan.heights).T
    free = PchipInterpolator(at, values).derivative()(at)
    curve = CubicHermiteSpline(at, values, np.where(np.isnan(speeds), free, speeds))
    return curve(times), curve(times, 2)


def _through(points: Sequence[tuple[float, float]], times: FloatArray) -> FloatArray:
    """A monotone curve through (time, value)."""
    from scipy.interpolate import PchipInterpolator

    at, values = np.array(points).T
    out: FloatArray = PchipInterpolator(at, values)(np.clip(times, at[0], at[-1]))
    return out


def _along(points: Sequence[tuple[float, ...]], times: FloatArray) -> FloatArray:
    """Straight lines through (time, values...)."""
    at, *values = np.array(points).T
    return np.stack([np.interp(times, at, value) for value in values], axis=1)


def _smooth(values: FloatArray, sigma: float) -> FloatArray:
    from scipy.ndimage import gaussian_filter1d

    out: FloatArray = gaussian_filter1d(values, sigma, axis=0, mode="nearest")
    return out
