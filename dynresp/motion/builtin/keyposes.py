"""From anatomical angles over time to poses of the character.

A channel is one number over time, such as "left_hip.flexion" [deg] or "pelvis.height" [m]. Key
poses give a channel's value at some times; a spline carries it from one to the next.

Signs: flexion bends forward (a knee backward), lateral and roll lean to the left, rotation and yaw
of the trunk turn to the left, abduction and rotation of a limb go outward, dorsiflexion raises the
toes. The three angles of a joint are applied about the parent's axes in the order rotation,
lateral or abduction, flexion; those of the pelvis in the order roll, pitch, yaw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.builtin.keypose_spec import BuiltinSpec
from dynresp.motion.builtin.posture_spec import CHANNELS
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.rotations import FloatArray

SMOOTHING = 0.022
"""Standard deviation of the Gaussian that rounds the spline's changes of curvature [s]."""

_TRUNK = ("waist", "back", "neck")
_SIDES = (("left", 1.0), ("right", -1.0))


def frame_times(duration: float, fps: float) -> FloatArray:
    """Times of the frames [s] of a motion of about this duration."""
    return np.arange(round(duration * fps) + 1) / fps


def key_channels(
    spec: BuiltinSpec, character: Character
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Every channel of a file of key poses, frame by frame.

    What the first key leaves out stands at rest there. Between keys a channel follows a monotone
    cubic (PCHIP), which does not overshoot a key; after its last key it holds.

    Args:
        spec: The file, with keys.
        character: Its rest pose gives the height of the pelvis where no key does.

    Returns:
        Times (frames,) [s], and for each channel (frames,) values.
    """
    from scipy.interpolate import PchipInterpolator

    times = frame_times(spec.key[-1].time, spec.fps)
    rest = dict.fromkeys(CHANNELS, 0.0) | {"pelvis.height": float(character.rest_pose[2])}
    points = {name: [(0.0, value)] for name, value in rest.items()}
    for i, key in enumerate(spec.key):
        for name, value in key.channels().items():
            points[name] = [(0.0, value)] if i == 0 else [*points[name], (key.time, value)]
    channels = {}
    for name, pairs in points.items():
        at, values = np.array(pairs).T
        if len(pairs) == 1:
            channels[name] = np.full(len(times), values[0])
        else:
            curve = PchipInterpolator(at, values)(np.minimum(times, at[-1]))
            channels[name] = _smoothed(curve, SMOOTHING * spec.fps)
    add_sway(spec, times, channels)
    return times, channels


def add_sway(spec: BuiltinSpec, times: FloatArray, channels: dict[str, FloatArray]) -> None:
    """Add the oscillations of a file to the channels, in place."""
    for sway in spec.sway:
        phase = times / sway.period + sway.phase
        channels[sway.value] = channels[sway.value] + sway.amplitude * np.sin(2 * np.pi * phase)


def channel_poses(channels: Mapping[str, npt.ArrayLike], character: Character) -> FloatArray:
    """Poses (frames, 59) from channels.

    Args:
        channels: A value for each name of `CHANNELS`, (frames,): [deg], and [m] for the pelvis.
        character: The character.
    """
    values = {name: np.asarray(channels[name], dtype=np.float64) for name in CHANNELS}
    frames = len(values["pelvis.x"])
    poses = np.tile(character.rest_pose, (frames, 1))
    poses[:, ROOT] = np.stack([values[f"pelvis.{x}"] for x in ("x", "y", "height")], axis=1)
    poses[:, ROOT_QUAT] = _turn(
        "zyx", (values["pelvis.yaw"], values["pelvis.pitch"], -values["pelvis.roll"])
    )
    joints = poses[:, 7:].reshape(frames, -1, 4)
    for name in _TRUNK:
        flexion, lateral, rotation = (
            values[f"{name}.{x}"] for x in ("flexion", "lateral", "rotation")
        )
        joints[:, character.joint(name)] = _turn("yxz", (flexion, -lateral, rotation))
    for side, sign in _SIDES:
        for name in (f"{side}_hip", f"{side}_shoulder"):
            flexion, abduction, rotation = (
                values[f"{name}.{x}"] for x in ("flexion", "abduction", "rotation")
            )
            joints[:, character.joint(name)] = _turn(
                "yxz", (-flexion, sign * abduction, sign * rotation)
            )
        joints[:, character.joint(f"{side}_knee")] = _turn("y", (values[f"{side}_knee"],))
        for name in (f"{side}_ankle", f"{side}_elbow"):
            joints[:, character.joint(name)] = _turn("y", (-values[name],))
    poses[:, 7:] = joints.reshape(frames, -1)
    return poses


def _turn(axes: str, degrees: Sequence[FloatArray]) -> FloatArray:
    """Product of rotations about coordinate axes, the first one outermost; (frames, 4)."""
    turns = [
        rotations.about_axis(np.eye(3)["xyz".index(axis)], np.radians(angle))
        for axis, angle in zip(axes, degrees, strict=True)
    ]
    out = turns[0]
    for turn in turns[1:]:
        out = rotations.multiply(out, turn)
    return out


def _smoothed(curve: FloatArray, sigma: float) -> FloatArray:
    """Gaussian smoothing (sigma in frames) that keeps the ends' values and slopes."""
    from scipy.ndimage import gaussian_filter1d

    pad = min(int(np.ceil(4 * sigma)), len(curve) - 1)
    if pad < 1:
        return curve
    # Odd reflection: a curve that arrives with a speed goes on with it.
    before = 2 * curve[0] - curve[pad:0:-1]
    after = 2 * curve[-1] - curve[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, curve, after])
    smooth: FloatArray = gaussian_filter1d(padded, sigma, mode="nearest")
    return smooth[pad : pad + len(curve)]
