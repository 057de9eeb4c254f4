"""Where the feet of whole motions are, and how low they reach."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

# Frames whose bodies are held in memory at a time.
_BLOCK = 8192


@dataclass(frozen=True)
class FootTracks:
    """Hips and feet over some frames.

    Attributes:
        hips: (2, frames, 3) [m].
        ankles: (2, frames, 3) [m].
        feet: (2, frames, 4) orientations.
    """

    hips: FloatArray
    ankles: FloatArray
    feet: FloatArray


def foot_tracks(character: Character, poses: FloatArray) -> FootTracks:
    """Hips and feet of poses (frames, 59), computed block by block to save memory."""
    n = len(poses)
    tracks = FootTracks(np.empty((2, n, 3)), np.empty((2, n, 3)), np.empty((2, n, 4)))
    for start in range(0, n, _BLOCK):
        states = character.kinematics(poses[start : start + _BLOCK])
        block = slice(start, start + len(states.positions))
        for i, side in enumerate(FEET):
            thigh, foot = (character.body(f"{side}_{part}") for part in ("thigh", "foot"))
            tracks.hips[i, block] = states.positions[:, thigh]
            tracks.ankles[i, block] = states.positions[:, foot]
            tracks.feet[i, block] = states.quaternions[:, foot]
    return tracks


def foot_balls(character: Character, side: str) -> FloatArray:
    """Balls whose hull holds a foot.

    Args:
        character: The character.
        side: "left" or "right".

    Returns:
        (n, 4) their centres in the foot's frame, and their radii [m].
    """
    model = character.model
    balls = []
    for geom in np.flatnonzero(model.geom_bodyid == character.body(f"{side}_foot") + 1):
        size, kind = model.geom_size[geom], model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            offsets, radius = (
                np.stack(np.meshgrid(*[(-x, x) for x in size]), -1).reshape(-1, 3),
                0.0,
            )
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            offsets, radius = np.array([[0, 0, -size[1]], [0, 0, size[1]]]), size[0]
        else:
            offsets, radius = np.zeros((1, 3)), size[0]
        centers = model.geom_pos[geom] + rotations.rotate(model.geom_quat[geom], offsets)
        balls += [[*center, radius] for center in centers]
    return np.array(balls)


def lowest_points(tracks: FootTracks, foot: int, balls: FloatArray) -> FloatArray:
    """Height of the lowest point of a foot.

    Args:
        tracks: The feet.
        foot: 0 for the left one, 1 for the right one.
        balls: (n, 4) what it consists of; see `foot_balls`.

    Returns:
        (frames,) [m].
    """
    low = np.full(tracks.ankles.shape[1], np.inf)
    for ball in balls:
        height = rotations.rotate(tracks.feet[foot], ball[:3])[:, 2] - ball[3]
        np.minimum(low, height, out=low)
    return low + tracks.ankles[foot, :, 2]
