"""Set a motion on the floor: nothing below it, and standing feet on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import legs
from dynresp.motion.character import Character
from dynresp.motion.ground import clearances, foot_contacts
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray


@dataclass(frozen=True)
class FloorConfig:
    """How the feet and the body are set on the floor.

    Attributes:
        standing_speed: A foot slower than this [m/s] counts when the floor is looked for.
        pull_down: A standing foot is pulled down to the floor from at most this height [m].
        ramp_s: Time over which a foot is eased onto the floor and off it, or the body lifted [s].
        sink: How deep a body may press into the floor [m]: flesh gives, and so do simulated
            contacts.
    """

    standing_speed: float = 0.25
    pull_down: float = 0.04
    ramp_s: float = 0.12
    sink: float = 0.01


def find_floor(
    character: Character, poses: FloatArray, fps: float, config: FloorConfig | None = None
) -> float:
    """Height of the floor [m] in a motion's own coordinates: where its slow feet stand."""
    config = config or FloorConfig()
    states = character.kinematics(poses)
    soles = clearances(character, states)[:, _feet(character)]
    heights = soles.min(axis=1)
    if len(poses) < 2:
        return float(heights[0])
    ankles = legs.ankle_positions(character, states)
    speed = np.linalg.norm(np.gradient(ankles, 1.0 / fps, axis=0), axis=-1)
    slow = speed[np.arange(len(soles)), soles.argmin(axis=1)] < config.standing_speed
    if not slow.any():
        return float(np.quantile(heights, 0.05))
    # Lying and sitting people hold their feet up: only the lower half of the footings counts.
    standing = heights[slow]
    return float(np.median(standing[standing <= np.median(standing) + 1e-9]))


def settle(
    character: Character, poses: FloatArray, fps: float, config: FloorConfig | None = None
) -> FloatArray:
    """Put a motion whose floor is at height 0 on it.

    The root is raised, smoothly, where a body other than a foot would be deeper in the floor than
    it may; then the legs are bent or stretched so that feet that stand touch the floor and no foot
    is below it.

    Args:
        character: The character.
        poses: (frames, 59).
        fps: Frame rate [1/s].
        config: How.

    Returns:
        (frames, 59).
    """
    config = config or FloorConfig()
    states = character.kinematics(poses)
    low = clearances(character, states)
    lift = _lift(character, low, fps, config)
    sole = low[:, _feet(character)] + lift[:, None]
    contacts = foot_contacts(character, states, fps).astype(np.float64)
    weight = np.stack([_smooth_cover(c, fps, config) for c in contacts.T], axis=1)
    # The root's rise does not concern feet that stand.
    pull = weight * np.maximum(-np.maximum(sole, 0.0), -(config.pull_down + lift[:, None]))
    return _move(character, poses, lift, np.where(sole < 0.0, -sole, pull))


def raise_above(
    character: Character, poses: FloatArray, fps: float, config: FloorConfig | None = None
) -> FloatArray:
    """Lift out of the floor what is below it, and leave all else as it is.

    Args:
        character: The character.
        poses: (frames, 59).
        fps: Frame rate [1/s].
        config: How.

    Returns:
        (frames, 59). Frames that are clear of the floor, and not near one that is not, are the
        same.
    """
    config = config or FloorConfig()
    low = clearances(character, character.kinematics(poses))
    lift = _lift(character, low, fps, config)
    sole = low[:, _feet(character)] + lift[:, None]
    return _move(character, poses, lift, np.maximum(-config.sink - sole, 0.0))


def _feet(character: Character) -> list[int]:
    return [character.body(f"{side}_foot") for side in FEET]


def _lift(character: Character, low: FloatArray, fps: float, config: FloorConfig) -> FloatArray:
    """How far to raise the root in each frame (frames,) [m]."""
    others = np.setdiff1d(np.arange(low.shape[1]), _feet(character))
    return _smooth_cover(np.maximum(0.0, -config.sink - low[:, others].min(axis=1)), fps, config)


def _move(
    character: Character, poses: FloatArray, lift: FloatArray, shift: FloatArray
) -> FloatArray:
    """Raise the root by `lift` (frames,) and then the ankles by `shift` (frames, 2)."""
    moved = np.array(poses)
    moved[:, 2] += lift
    touched = np.flatnonzero((shift != 0.0).any(axis=1))
    if len(touched):
        ankles = legs.ankle_positions(character, character.kinematics(moved[touched]))
        ankles[..., 2] += shift[touched]
        moved[touched] = legs.place_ankles(character, moved[touched], ankles)
    return moved


def _smooth_cover(values: FloatArray, fps: float, config: FloorConfig) -> FloatArray:
    """A smooth curve on or above the values: the highest within the ramp, then averaged over it."""
    half = max(1, round(config.ramp_s * fps))
    padded = np.pad(values, 2 * half, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).max(axis=1)
    kernel = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(highest, kernel / kernel.sum(), mode="valid")
