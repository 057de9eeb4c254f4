"""A step stool on a level floor, and motion on it (Lee et al. 2002, section 6).

The paper recorded five minutes with a step stool. There is no such recording here, so the motion is
built in. The stool is a cube around the origin: 0.32 m is the height of a tall step stool or a low
seat, and wide enough for two feet side by side and for the length of a foot.
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

# The floor ends this far from the stool's middle [m]: a step beyond the motions.
_FLOOR = 2.5


@functools.cache
def stool_world() -> World:
    """The stool as a box on level ground."""
    half = 0.5 * SIDE_M
    stool = Obstacle((0.0, 0.0), (half, half), height=SIDE_M)
    return World((-_FLOOR, -_FLOOR, _FLOOR, _FLOOR), (stool,))


def stool_ground(points: npt.ArrayLike) -> FloatArray:
    """Height of the ground at points (..., 2): (...) [m], the top of the stool or the floor."""
    at = np.asarray(points, dtype=np.float64)
    return np.where(box_distance(at, stool_world().boxes[0]) <= 0.0, SIDE_M, 0.0)


def stool_contacts(motion: Motion, character: Character) -> BoolArray:
    """Which feet stand on the floor or on the stool: those that are near it and slow.

    Args:
        motion: A motion in the world of the stool.
        character: The character.

    Returns:
        (frames, 2): left, right.
    """
    corners = sole_corners(character, character.kinematics(motion.poses))
    return feet_on(stool_ground, corners, motion.fps)


def stool_motions(character: Character) -> list[Motion]:
    """The built-in motion on the stool, from its four sides.

    Args:
        character: The character.

    Returns:
        Four motions in one world, named "built-in: ...", with the contacts of their feet.

    Raises:
        SpecError: The file of the built-in motion is wrong.
    """
    return from_all_sides(load_builtin("stool", character))


def from_all_sides(motion: Motion) -> list[Motion]:
    """A motion on the stool, and the same after one, two and three quarter turns.

    The stool has four equal sides, so a motion from one side also fits the others. A copy can
    follow another that ends where it begins.

    Args:
        motion: A motion in the world of the stool.

    Returns:
        Four motions, the given one first.
    """
    turned = [motion]
    for quarter in range(1, 4):
        copy = motion.moved(0.5 * np.pi * quarter, (0.0, 0.0, 0.0))
        name = f"{motion.name}, turned by {90 * quarter} degrees"
        turned.append(dataclasses.replace(copy, name=name))
    return turned
