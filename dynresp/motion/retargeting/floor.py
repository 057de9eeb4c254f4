"""Set a motion on the floor: nothing below it, and standing feet on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.feet import legs
from dynresp.motion.ground import clearances, foot_contacts
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing

# Part of the heights that the floor is above: feet that stand higher (on a step, on their toes) are
# more frequent than feet in the floor.
_LOW = 0.25
# Times that bodies are lifted out of the floor once more, and how little [m] is not worth it.
_ROUNDS = 5
_DONE = 1e-3
# In the forearm's frame: where the fingers end (models/ragdoll.xml) [m], and the axis about which
# the elbow flexes.
_FINGERTIPS = np.array([0.0, 0.0, -0.41])
_FLEXION = np.array([0.0, -1.0, 0.0])
# A foot is not pulled farther than to this part of its leg's length: on the last few millimetres a
# knee turns by 10 degrees and more.
_STRAIGHT = 0.995
# Nor is one pulled whose hip and ankle are nearer than this part of it; from twice that on, wholly.
_FOLDED = 0.3


@dataclass(frozen=True)
class FloorConfig:
    """How the feet and the body are set on the floor.

    Attributes:
        standing_speed: A foot slower than this [m/s] counts when the floor is looked for.
        standing_s: Where feet stand for less time than this in all [s], they do not tell the floor.
        pull_down: A standing foot is pulled down to the floor from at most this height [m].
        ramp_s: Time over which a foot is eased onto the floor and off it, or the body lifted [s].
        sink: How deep a body may press into the floor [m]: flesh gives, and so do simulated
            contacts.
    """

    standing_speed: float = 0.25
    standing_s: float = 0.2
    pull_down: float = 0.04
    ramp_s: float = 0.12
    sink: float = 0.01


def find_floor(
    character: Character, poses: FloatArray, fps: float, config: FloorConfig | None = None
) -> float:
    """Height of the floor [m] in a motion's own coordinates: where its slow feet stand.

    Only frames count in which nothing else of the body is lower, since lying, sitting and climbing
    people hold their feet up. Where there are too few, the lowest part of the body has to do.
    """
    config = config or FloorConfig()
    states = character.kinematics(poses)
    low = clearances(character, states)
    soles = low[:, _feet(character)]
    heights = low.min(axis=1)
    standing = soles.min(axis=1) <= heights + config.sink
    if len(poses) > 1:
        ankles = legs.ankle_positions(character, states)
        speeds = np.linalg.norm(np.gradient(ankles, 1.0 / fps, axis=0), axis=-1)
        standing &= speeds[np.arange(len(soles)), soles.argmin(axis=1)] < config.standing_speed
    if np.count_nonzero(standing) < min(config.standing_s * fps, len(poses)):
        return float(np.quantile(heights, _LOW))
    return float(np.quantile(soles.min(axis=1)[standing], _LOW))


def settle(
    character: Character, poses: FloatArray, fps: float, config: FloorConfig | None = None
) -> FloatArray:
    """Put a motion whose floor is at height 0 on it.

    Arms are bent whose hands would be deeper in the floor than they may: the character's wrists are
    stiff, and people lean on theirs. The root is raised, smoothly, where a body other than a foot
    still would be. Then the legs are bent or stretched so that feet that stand touch the floor, as
    far as straight legs reach, and no foot is below it.

    Args:
        character: The character.
        poses: (frames, 59).
        fps: Frame rate [1/s].
        config: How.

    Returns:
        (frames, 59).
    """
    config = config or FloorConfig()
    poses = _raise_hands(character, poses, config)
    states = character.kinematics(poses)
    low = clearances(character, states)
    lift = _lift(character, low, fps, config)
    sole = low[:, _feet(character)] + lift[:, None]
    contacts = foot_contacts(character, states, fps)
    # The root's rise does not concern feet that stand.
    most = (config.pull_down + lift)[:, None]
    ramp = max(1, round(config.ramp_s * fps))
    pull = _ease_away(np.clip(sole, 0.0, most), contacts, ramp)
    pull = np.minimum(pull, _slack(character, states) + lift[:, None])
    settled = _move(character, poses, lift, -np.minimum(sole, pull))
    # Knees that the feet have pushed below the floor; they go on standing where they can.
    for stand in [True] * _ROUNDS + [False]:
        lift = _lift(character, clearances(character, character.kinematics(settled)), fps, config)
        if lift.max() < _DONE:
            break
        kept = lift[:, None] if stand else np.zeros((len(lift), 1))
        settled = _move(character, settled, lift, -np.repeat(kept, 2, axis=1))
    return settled


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


def _raise_hands(character: Character, poses: FloatArray, config: FloorConfig) -> FloatArray:
    """Bend the arms so that the hands are no deeper than they may be, as far as arms reach."""
    states = character.kinematics(poses)
    low = clearances(character, states)
    world = states.quaternions.copy()
    for side in FEET:
        upper, lower = (character.body(f"{side}_{part}") for part in ("upper_arm", "forearm"))
        deep = np.flatnonzero(low[:, lower] < -config.sink)
        elbow, turned = states.positions[deep, lower], world[deep, lower]
        tip = elbow + rotations.rotate(turned, _FINGERTIPS)
        target = tip.copy()
        target[:, 2] -= low[deep, lower] + config.sink
        lateral = rotations.rotate(world[deep, upper], _FLEXION)
        turns = legs.bend_turns(states.positions[deep, upper], elbow, tip, lateral, target)
        world[deep, upper] = rotations.multiply(turns[0], world[deep, upper])
        world[deep, lower] = rotations.multiply(turns[1], turned)
    raised = np.array(poses)
    raised[:, 3:] = character.local_rotations(world).reshape(len(poses), -1)
    return raised


def _feet(character: Character) -> list[int]:
    return [character.body(f"{side}_foot") for side in FEET]


def _lift(character: Character, low: FloatArray, fps: float, config: FloorConfig) -> FloatArray:
    """How far to raise the root in each frame (frames,) [m]."""
    others = np.setdiff1d(np.arange(low.shape[1]), _feet(character))
    need = np.maximum(0.0, -config.sink - low[:, others].min(axis=1))
    return smoothing.cover(need, max(1, round(config.ramp_s * fps)))


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


def _slack(character: Character, states: BodyStates) -> FloatArray:
    """How far each ankle can be lowered before its leg is straight (frames, 2) [m]."""
    columns = []
    for side in FEET:
        hip, knee, ankle = (
            states.positions[:, character.body(f"{side}_{part}")]
            for part in ("thigh", "shank", "foot")
        )
        length = np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)
        across = np.linalg.norm((ankle - hip)[:, :2], axis=1)
        down = np.sqrt(np.maximum((_STRAIGHT * length) ** 2 - across**2, 0.0))
        # Of a leg that is folded, as in a crouch, the knee would swing about.
        bent = np.linalg.norm(hip - ankle, axis=1) / length
        unfolded = np.clip((bent - _FOLDED) / _FOLDED, 0.0, 1.0)
        columns.append(unfolded * np.maximum(down - (hip - ankle)[:, 2], 0.0))
    return np.stack(columns, axis=1)


def _ease_away(values: FloatArray, held: npt.NDArray[np.bool_], ramp: int) -> FloatArray:
    """Values (frames, columns) where they are held; elsewhere eased from the held ones to zero.

    Args:
        values: Not negative.
        held: (frames, columns).
        ramp: Frames that the easing takes.
    """
    out = np.where(held, values, 0.0)
    frames = np.arange(len(values))
    for column, flags in enumerate(held.T):
        for step in (1, -1):
            order = frames[::step]
            last = np.maximum.accumulate(np.where(flags[order], frames, -1))
            away = np.where(last >= 0, frames - last, ramp)
            near = values[order[np.maximum(last, 0)], column]
            eased = near * (1.0 - rotations.ease(away / ramp))
            out[order, column] = np.maximum(out[order, column], eased)
    return out
