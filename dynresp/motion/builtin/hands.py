"""Hands that prop the body up: where they have to be while they press on the ground.

The tip of a propping hand stays at one point of the floor; shoulder and elbow follow by two-bone
inverse kinematics, in the plane in which the elbow's own angles bend it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from dynresp.motion import rotations
from dynresp.motion.builtin.keypose_spec import Prop
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

BLEND_TIME = 0.25
"""Time over which a hand passes between propping and following its arm's joint angles [s]."""


@dataclass(frozen=True)
class HandTargets:
    """Where one hand has to be, frame by frame.

    Attributes:
        tips: (frames, 3) middle of the ball in which the hand ends [m], world.
        weights: (frames,) 1 where it props, 0 where it follows the arm's angles.
    """

    tips: FloatArray
    weights: FloatArray


def hand_tip(character: Character, side: str) -> tuple[FloatArray, float]:
    """The ball in which a hand ends: its middle in the forearm's frame, and its radius [m]."""
    model = character.model
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{side}_hand")
    radius, half = model.geom_size[geom][:2]
    return model.geom_pos[geom] - np.array([0.0, 0.0, half]), float(radius)


def hand_tracks(
    props: Sequence[Prop], character: Character, times: FloatArray
) -> tuple[HandTargets, HandTargets]:
    """Where the left and the right hand have to be at some times [s]."""
    tracks = []
    for side in FEET:
        mine = [prop for prop in props if prop.hand == side]
        radius = hand_tip(character, side)[1]
        tips, weights = np.zeros((len(times), 3)), np.zeros(len(times))
        for prop in mine:
            inside = np.minimum(times - prop.start, prop.stop - times)
            weight = rotations.ease(1.0 + inside / BLEND_TIME)
            nearer = weight > weights
            tips[nearer] = [*prop.at, radius]
            weights = np.maximum(weights, weight)
        tracks.append(HandTargets(tips, weights))
    return tracks[0], tracks[1]


def place_hands(
    character: Character, poses: FloatArray, tracks: Sequence[HandTargets]
) -> FloatArray:
    """Bring the hands onto their tracks.

    Args:
        character: The character.
        poses: (frames, 59) with the arms' own angles.
        tracks: Of the left and of the right hand.

    Returns:
        (frames, 59); where an arm is too short its hand is on the line to its target.
    """
    if not any(track.weights.any() for track in tracks):
        return poses
    states = character.kinematics(poses)
    world = states.quaternions.copy()
    for side, track in zip(FEET, tracks, strict=True):
        rows = np.flatnonzero(track.weights > 0.0)
        if not len(rows):
            continue
        upper, forearm = (character.body(f"{side}_{part}") for part in ("upper_arm", "forearm"))
        point, radius = hand_tip(character, side)
        elbow = states.positions[rows, forearm]
        tip = elbow + rotations.rotate(world[rows, forearm], point)
        wanted = tip + track.weights[rows, None] * (track.tips[rows] - tip)
        wanted[:, 2] = np.maximum(wanted[:, 2], radius)
        # An elbow bends forward, a knee backward.
        lateral = rotations.rotate(world[rows, upper], np.array([0.0, -1.0, 0.0]))
        turns = legs.bend_turns(states.positions[rows, upper], elbow, tip, lateral, wanted)
        for body, turn in zip((upper, forearm), turns, strict=True):
            world[rows, body] = rotations.multiply(turn, world[rows, body])
    out = poses.copy()
    out[:, 3:] = character.local_rotations(world).reshape(len(poses), -1)
    return out
