"""Two-bone inverse kinematics of the legs: put the ankles where they should be.

Hip, knee and ankle form a triangle whose third side is given: the knee bends as far as the law of
cosines asks, and the whole leg then turns about the hip. The foot keeps its orientation in the
world. Exact within reach; an ankle out of reach ends on the line towards its target.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character, as_poses
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

# A leg is stretched to at most this part of its length, so that the knee keeps its bending plane.
MAX_STRETCH = 0.9995
# Sine of the forward bend, about the thigh's lateral axis, from which on a knee keeps the plane in
# which it bends. One that is straighter, or bent backward, bends about that axis instead.
_BENT = 0.05


def ankle_positions(character: Character, states: BodyStates) -> FloatArray:
    """(frames, 2, 3) ankle joints [m], left and right."""
    return states.positions[:, [character.body(f"{side}_foot") for side in FEET]]


def place_ankles(
    character: Character,
    poses: npt.ArrayLike,
    ankles: npt.ArrayLike,
    feet: npt.ArrayLike | None = None,
) -> FloatArray:
    """Bend the legs so that the ankles are at given points; the root stays.

    Args:
        character: The character.
        poses: (frames, 59).
        ankles: (frames, 2, 3) target positions of the left and right ankle joint [m], world.
        feet: (frames, 2, 4) target orientations of the feet, w x y z, world; by default those
            that they have.

    Returns:
        (frames, 59). Only hip, knee and ankle joints differ.
    """
    poses = as_poses(poses)
    states = character.kinematics(poses)
    world = states.quaternions.copy()
    targets = np.asarray(ankles, dtype=np.float64)
    for i, side in enumerate(FEET):
        thigh, shank, foot = (character.body(f"{side}_{x}") for x in ("thigh", "shank", "foot"))
        turn_thigh, turn_shank = bend_turns(
            states.positions[:, thigh],
            states.positions[:, shank],
            states.positions[:, foot],
            rotations.rotate(states.quaternions[:, thigh], np.array([0.0, 1.0, 0.0])),
            targets[:, i],
        )
        world[:, thigh] = rotations.multiply(turn_thigh, world[:, thigh])
        world[:, shank] = rotations.multiply(turn_shank, world[:, shank])
        if feet is not None:
            world[:, foot] = np.asarray(feet, dtype=np.float64)[:, i]
    out = poses.copy()
    out[:, 3:] = character.local_rotations(world).reshape(len(poses), -1)
    return out


def bend_turns(
    hip: FloatArray, knee: FloatArray, ankle: FloatArray, lateral: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How to turn two bones so that the end of the second is at a target.

    Described for a leg; for an arm the lateral axis points the other way.

    Args:
        hip: (frames, 3) where the first bone begins [m].
        knee: (frames, 3) where the second does.
        ankle: (frames, 3) where that ends.
        lateral: (frames, 3) axis about which the second bone flexes, in the world, unit length; a
            limb that is straight or bent the wrong way bends about it.
        target: (frames, 3) where the end is to be.

    Returns:
        World rotations (frames, 4) of the first and of the second bone.
    """
    upper = np.linalg.norm(knee - hip, axis=1)
    lower = np.linalg.norm(ankle - knee, axis=1)
    along_thigh = (knee - hip) / upper[:, None]
    along_shank = (ankle - knee) / lower[:, None]
    wanted = np.linalg.norm(target - hip, axis=1)
    reach = np.clip(wanted, np.abs(upper - lower) + 1e-3, MAX_STRETCH * (upper + lower))

    # Axis about which the knee flexes, perpendicular to the thigh; + turns the shank backward.
    axis = np.cross(along_thigh, along_shank)
    forward = np.sum(axis * lateral, axis=1, keepdims=True)
    axis += np.maximum(_BENT - forward, 0.0) * lateral
    axis -= np.sum(axis * along_thigh, axis=1, keepdims=True) * along_thigh
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)

    cosine = (reach**2 - upper**2 - lower**2) / (2.0 * upper * lower)
    flexion = np.arccos(np.clip(cosine, -1.0, 1.0))[:, None]
    bent = np.cos(flexion) * along_thigh + np.sin(flexion) * np.cross(axis, along_thigh)
    turn_knee = rotations.between_vectors(along_shank, bent)

    now = upper[:, None] * along_thigh + lower[:, None] * bent
    # A target on the hip itself has no direction: the leg then keeps its own.
    aim = np.where(wanted[:, None] > 1e-6, target - hip, now)
    turn_hip = rotations.between_vectors(now, aim)
    return turn_hip, rotations.multiply(turn_hip, turn_knee)
