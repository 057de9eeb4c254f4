"""Set a motion on the floor: nothing below it, and standing feet on it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.feet import legs
from dynresp.motion.ground import clearances, foot_contacts
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing

PULL_DOWN = 0.04
"""A standing foot is pulled down to the floor from at most this height [m]."""
RAMP_S = 0.12
"""Time in which a foot is eased onto the floor and off it, or the body lifted [s]."""
SINK = 0.01
"""How deep a body may press into the floor [m]: flesh gives, and so do simulated contacts."""

# A foot slower than this [m/s] counts when the floor is searched. Where feet stand for less than
# this time in all [s], they do not show where it is.
_STANDING_SPEED = 0.25
_STANDING_S = 0.2
# This part of the heights is below the floor: feet that stand higher (on a step, on their toes) are
# more frequent than feet in the floor.
_LOW = 0.25
# How often bodies are lifted out of the floor once more, and below which height [m] they are not.
_ROUNDS = 5
_DONE = 1e-3
# In the forearm's frame: where the fingers end (models/ragdoll.xml) [m], and the axis about which
# the elbow flexes.
_FINGERTIPS = np.array([0.0, 0.0, -0.41])
_FLEXION = np.array([0.0, -1.0, 0.0])
# A foot is pulled to at most this part of its leg's length: on the last few millimetres a knee
# turns by 10 degrees and more.
_STRAIGHT = 0.995
# A foot whose hip and ankle are nearer than this part of it is not pulled; from twice that on, it
# is pulled fully.
_FOLDED = 0.3


def find_floor(character: Character, poses: FloatArray, fps: float) -> float:
    """Height of the floor [m] in a motion's own coordinates: where its slow feet stand.

    Only frames count in which no other part of the body is lower, since people who lie, sit or
    climb hold their feet up. If these are too few, the lowest part of the body counts.
    """
    states = character.kinematics(poses)
    low = clearances(character, states)
    soles = low[:, _feet(character)]
    heights = low.min(axis=1)
    standing = soles.min(axis=1) <= heights + SINK
    if len(poses) > 1:
        ankles = legs.ankle_positions(character, states)
        speeds = np.linalg.norm(np.gradient(ankles, 1.0 / fps, axis=0), axis=-1)
        standing &= speeds[np.arange(len(soles)), soles.argmin(axis=1)] < _STANDING_SPEED
    if np.count_nonzero(standing) < min(_STANDING_S * fps, len(poses)):
        return float(np.quantile(heights, _LOW))
    return float(np.quantile(soles.min(axis=1)[standing], _LOW))


def settle(character: Character, poses: FloatArray, fps: float) -> FloatArray:
    """Put a motion whose floor is at height 0 on it.

    An arm is bent if its hand would be deeper in the floor than `SINK`: the character's wrists are
    stiff, and people lean on theirs. The root is raised, smoothly, where a body other than a foot
    would still be deeper. Then the legs are bent or stretched so that standing feet touch the
    floor, as far as straight legs reach, and no foot is below it.

    Args:
        character: The character.
        poses: (frames, 59).
        fps: Frame rate [1/s].

    Returns:
        (frames, 59).
    """
    poses = _raise_hands(character, poses)
    states = character.kinematics(poses)
    low = clearances(character, states)
    lift = _lift(character, low, fps)
    sole = low[:, _feet(character)] + lift[:, None]
    contacts = foot_contacts(character, states, fps)
    # The root's rise does not concern feet that stand.
    most = (PULL_DOWN + lift)[:, None]
    ramp = max(1, round(RAMP_S * fps))
    pull = _ease_away(np.clip(sole, 0.0, most), contacts, ramp)
    pull = np.minimum(pull, _slack(character, states) + lift[:, None])
    settled = _move(character, poses, lift, -np.minimum(sole, pull))
    # Knees that the feet have pushed below the floor; they go on standing where they can.
    for stand in [True] * _ROUNDS + [False]:
        lift = _lift(character, clearances(character, character.kinematics(settled)), fps)
        if lift.max() < _DONE:
            break
        kept = lift[:, None] if stand else np.zeros((len(lift), 1))
        settled = _move(character, settled, lift, -np.repeat(kept, 2, axis=1))
    return settled


def raise_above(character: Character, poses: FloatArray, fps: float) -> FloatArray:
    """Lift what is below the floor out of it; all else stays.

    Args:
        character: The character.
        poses: (frames, 59).
        fps: Frame rate [1/s].

    Returns:
        (frames, 59). Frames that are clear of the floor, and not near one that is not, are the
        same.
    """
    low = clearances(character, character.kinematics(poses))
    lift = _lift(character, low, fps)
    sole = low[:, _feet(character)] + lift[:, None]
    return _move(character, poses, lift, np.maximum(-SINK - sole, 0.0))


def _raise_hands(character: Character, poses: FloatArray) -> FloatArray:
    """Bend the arms so that no hand is deeper than `SINK`, as far as arms reach."""
    states = character.kinematics(poses)
    low = clearances(character, states)
    world = states.quaternions.copy()
    for side in FEET:
        upper, lower = (character.body(f"{side}_{part}") for part in ("upper_arm", "forearm"))
        deep = np.flatnonzero(low[:, lower] < -SINK)
        elbow, turned = states.positions[deep, lower], world[deep, lower]
        tip = elbow + rotations.rotate(turned, _FINGERTIPS)
        target = tip.copy()
        target[:, 2] -= low[deep, lower] + SINK
        lateral = rotations.rotate(world[deep, upper], _FLEXION)
        turns = legs.bend_turns(states.positions[deep, upper], elbow, tip, lateral, target)
        world[deep, upper] = rotations.multiply(turns[0], world[deep, upper])
        world[deep, lower] = rotations.multiply(turns[1], turned)
    raised = np.array(poses)
    raised[:, 3:] = character.local_rotations(world).reshape(len(poses), -1)
    return raised


def _feet(character: Character) -> list[int]:
    return [character.body(f"{side}_foot") for side in FEET]


def _lift(character: Character, low: FloatArray, fps: float) -> FloatArray:
    """How far to raise the root in each frame (frames,) [m]."""
    others = np.setdiff1d(np.arange(low.shape[1]), _feet(character))
    need = np.maximum(0.0, -SINK - low[:, others].min(axis=1))
    return smoothing.cover(need, max(1, round(RAMP_S * fps)))


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
    """Values (frames, columns) in held frames; elsewhere eased from the nearest held ones to zero.

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
