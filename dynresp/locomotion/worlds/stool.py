"""A step stool on a level floor, and what one does with it (Lee et al. 2002, section 6).

The paper's step stool was recorded for five minutes; no such recording is at hand here, so the
motion is a built-in one. The stool is a cube with its middle at the origin: 0.32 m is as high as a
tall step stool and a low seat, and as wide as two feet side by side and a foot's length need.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.obstacles import Obstacle, World, box_distance
from dynresp.locomotion.worlds.world_contacts import feet_on, sole_corners
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray

SIDE_M = 0.32
"""Length, width and height of the stool [m]."""

# How far the floor goes to all sides of the stool [m]: a step beyond where the motions go.
_FLOOR = 2.5


@functools.cache
def stool_world() -> World:
    """The stool as a box on level ground."""
    half = 0.5 * SIDE_M
    stool = Obstacle((0.0, 0.0), (half, half), height=SIDE_M)
    return World((-_FLOOR, -_FLOOR, _FLOOR, _FLOOR), (stool,))


def stool_ground(points: npt.ArrayLike) -> FloatArray:
    """Height [m] of what one stands on: (..., 2) -> (...). The stool's top, or the floor."""
    at = np.asarray(points, dtype=np.float64)
    return np.where(box_distance(at, stool_world().boxes[0]) <= 0.0, SIDE_M, 0.0)


def stool_contacts(motion: Motion, character: Character) -> BoolArray:
    """Which feet stand on the floor or on the stool, by how near and how slow they are.

    Args:
        motion: In the world of the stool.
        character: Whose motion it is.

    Returns:
        (frames, 2): left, right.
    """
    corners = sole_corners(character, character.kinematics(motion.poses))
    return feet_on(stool_ground, corners, motion.fps)


def stool_motions(character: Character) -> list[Motion]:
    """The built-in motion about the stool, from its four sides.

    Args:
        character: Whose motions they are.

    Returns:
        Four motions in one world, named "built-in: ...", with the contacts of their feet.

    Raises:
        SpecError: The file of the built-in motion is wrong.
    """
    return from_all_sides(load_builtin("stool", character))


def from_all_sides(motion: Motion) -> list[Motion]:
    """A motion about the stool, and the same turned about it by quarter turns.

    The stool looks alike from its four sides, so all that is done from one side can be done from
    the others: what begins where another copy ends can follow it.

    Args:
        motion: In the world of the stool.

    Returns:
        Four motions, the given one first.
    """
    turned = [motion]
    for quarter in range(1, 4):
        copy = motion.moved(0.5 * np.pi * quarter, (0.0, 0.0, 0.0))
        name = f"{motion.name}, turned by {90 * quarter} degrees"
        turned.append(dataclasses.replace(copy, name=name))
    return turned
