"""A steady walk from curves over the gait cycle.

The curves give the joint angles; the feet then stand exactly where the steps put them, roll from
heel to ball, and pass from one stance to the next along the swing that the angles describe.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.builtin.footing import FootTargets, Sole, place_feet, planted
from dynresp.motion.builtin.keypose_spec import CYCLE_POINTS, BuiltinSpec, Gait
from dynresp.motion.builtin.keyposes import add_sway, channel_poses, frame_times
from dynresp.motion.builtin.posture_spec import CHANNELS
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

# Least height of a swinging foot half way through its swing [m] (Winter 1991: 1 to 2 cm).
_TOE_CLEARANCE = 0.012

_CURVE_OF = {
    "hip.flexion": "hip_flexion",
    "hip.abduction": "hip_abduction",
    "knee": "knee_flexion",
    "ankle": "ankle_dorsiflexion",
    "shoulder.flexion": "shoulder_flexion",
    "elbow": "elbow_flexion",
}


def walk_poses(spec: BuiltinSpec, character: Character) -> tuple[FloatArray, list[FootTargets]]:
    """Poses (frames, 59) of a file with gait curves, and the tracks of its feet.

    The walk goes along +X from near the origin, the left heel touching down at time 0.
    """
    from scipy.interpolate import CubicSpline

    gait, curves = spec.gait, spec.curves
    if gait is None or curves is None:
        raise ValueError(f"{spec.name} has no gait curves")
    shown = frame_times(gait.duration, spec.fps)
    # A cycle more at either end, so that every swing has the stance before it and the one after.
    margin = int(np.ceil(120.0 / gait.cadence * spec.fps))
    times = np.arange(-margin, len(shown) + margin) / spec.fps
    phase = times * gait.cadence / 120.0

    def curve(name: str, shift: float = 0.0) -> FloatArray:
        values = np.array(getattr(curves, name))
        grid = np.arange(CYCLE_POINTS + 1) / CYCLE_POINTS
        spline = CubicSpline(grid, np.append(values, values[0]), bc_type="periodic")
        out: FloatArray = spline((phase + shift) % 1.0)
        return out

    rest = {} if spec.rest is None else spec.rest.channels()
    channels = {name: np.full(len(times), rest.get(name, 0.0)) for name in CHANNELS}
    for part, name in _CURVE_OF.items():
        for side, shift in zip(FEET, (0.0, 0.5), strict=True):
            channels[f"{side}_{part}"] += curve(name, shift)
    for angle in ("pitch", "roll", "yaw"):
        channels[f"pelvis.{angle}"] += curve(f"pelvis_{angle}")
    channels["waist.lateral"] += curve("waist_lateral")
    for joint in ("waist", "back", "neck"):
        channels[f"{joint}.rotation"] += curve(f"{joint}_rotation")
    channels["pelvis.x"] += gait.speed * times + 0.01 * curve("pelvis_forward")
    channels["pelvis.y"] += 0.01 * curve("pelvis_left")
    channels["pelvis.height"] = gait.height + 0.01 * curve("pelvis_up")
    add_sway(spec, times, channels)

    poses = channel_poses(channels, character)
    tracks = _tracks(gait, character, poses, phase, spec.fps)
    placed = place_feet(character, poses, tracks, spec.fps)
    inside = slice(margin, margin + len(shown))
    return placed[inside], [track.between(margin, margin + len(shown)) for track in tracks]


def _tracks(
    gait: Gait, character: Character, poses: FloatArray, phase: FloatArray, fps: float
) -> list[FootTargets]:
    """Where the feet stand and how they swing; all stances are one step apart on a line."""
    from scipy.ndimage import gaussian_filter1d

    states = character.kinematics(poses)
    own = legs.ankle_positions(character, states)
    stride = gait.speed * 120.0 / gait.cadence
    cycles = [phase, phase + 0.5]
    percents = [100.0 * (cycle % 1.0) for cycle in cycles]
    soles = [Sole.of(character, side) for side in FEET]
    turns = [np.radians(gait.toe_out), -np.radians(gait.toe_out)]
    pitches, shifts = [], []
    for i, side in enumerate(FEET):
        foot = states.quaternions[:, character.body(f"{side}_foot")]
        toes = rotations.rotate(foot, np.array([1.0, 0.0, 0.0]))
        pitch = np.arcsin(np.clip(toes[:, 2], -1.0, 1.0)) * _rolling(percents[i], gait)
        rolling, _ = planted(soles[i], (0.0, 0.0), turns[i], pitch)
        # Where the walker's angles put the standing foot, less the strides walked so far.
        start = own[:, i, 0] - rolling[:, 0] - stride * np.floor(cycles[i])
        pitches.append(pitch)
        shifts.append(float(start[percents[i] <= gait.stance].mean()))
    middle = 0.5 * (shifts[0] + shifts[1])
    starts = (middle + 0.25 * stride, middle - 0.25 * stride)

    tracks = []
    for i in range(len(FEET)):
        across = (0.5 - i) * gait.step_width
        places = np.stack(
            [starts[i] + stride * np.floor(cycles[i]), np.full(len(phase), across)], axis=1
        )
        standing, foot = planted(soles[i], places, turns[i], pitches[i])
        locked = percents[i] <= gait.stance + 1e-9
        correction = _across_gaps(standing - own[:, i], locked)
        ankles = np.where(locked[:, None], standing, own[:, i] + correction)
        swing = np.clip((percents[i] - gait.stance) / (100.0 - gait.stance), 0.0, 1.0)
        over = 4.0 * swing * (1.0 - swing)
        least = soles[i].ankle_height(foot)
        # Rounded where the lowest point passes from ball to heel; that only ever raises it.
        least = least + over * (gaussian_filter1d(least, 0.04 * fps) - least)
        floor = least + _TOE_CLEARANCE * over
        # A smooth maximum, whose rounding vanishes where the foot stands.
        above, rounding = ankles[:, 2] - floor, 3.0 * _TOE_CLEARANCE * over
        ankles[:, 2] = floor + 0.5 * (above + np.sqrt(above**2 + rounding**2))
        tracks.append(FootTargets(ankles, foot, np.ones(len(phase)), locked))
    return tracks


def _rolling(percent: FloatArray, gait: Gait) -> FloatArray:
    """1 where the foot follows the leg, 0 while it is flat; over the cycle [%].

    It follows again when the other heel touches down, half a cycle in.
    """
    falling = 1.0 - rotations.ease(percent / gait.foot_flat)
    rising = rotations.ease((percent - gait.heel_off) / (50.0 - gait.heel_off))
    return np.where(percent < gait.heel_off, falling, rising)


def _across_gaps(values: FloatArray, known: npt.NDArray[np.bool_]) -> FloatArray:
    """Carry values (frames, n) across gaps by cubics that keep values and slopes at both edges.

    A gap without an edge on one side holds the other edge's value.
    """
    frames = np.arange(len(values))
    before = np.maximum.accumulate(np.where(known, frames, -1))
    after = np.minimum.accumulate(np.where(known, frames, len(values))[::-1])[::-1]
    before, after = (
        np.where(before < 0, after, before),
        np.where(after >= len(values), before, after),
    )
    start = values[before] - values[np.maximum(before - 1, 0)]
    stop = values[np.minimum(after + 1, len(values) - 1)] - values[after]
    span = np.maximum(after - before, 1)[:, None]
    u = (frames - before)[:, None] / span
    out: FloatArray = (
        (1 + 2 * u) * (1 - u) ** 2 * values[before]
        + u * (1 - u) ** 2 * span * start
        + u**2 * (3 - 2 * u) * values[after]
        - u**2 * (1 - u) * span * stop
    )
    return np.where((before == after)[:, None], values[before], out)
