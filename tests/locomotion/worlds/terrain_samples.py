"""Walks over blocks that the tests make themselves."""

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.terrain import BLOCK_M, LEVEL_M
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray

FPS = 60.0
# Frames that a foot stands and swings; the other one stands meanwhile.
_STANDS, _SWINGS = 42, 18
# From the ankle joint down to the sole [m].
_ANKLE = 0.07


def block_walk(
    character: Character,
    rng: np.random.Generator,
    levels: npt.NDArray[np.int64],
    steps: int,
    yaw: float = 0.0,
    corner: tuple[float, float] = (0.0, 0.0),
    scale: float = 1.0,
) -> Motion:
    """A stiff walk from block to block, one step each, at random.

    Args:
        character: The character.
        rng: Where the numbers come from.
        levels: (columns, rows) of the blocks.
        steps: How many steps.
        yaw: How the grid is turned about the origin [rad], after it has been put at its corner.
        corner: Where it begins [m].
        scale: Size of the blocks over that of real ones.
    """
    side, level = BLOCK_M * scale, LEVEL_M * scale
    cell = np.array(levels.shape) // 2
    stands = []
    for _ in range(steps + 2):
        moves = [(1, 0), (-1, 0), (0, 1), (0, -1)]
        allowed = [m for m in moves if np.all((cell + m >= 0) & (cell + m < levels.shape))]
        cell = cell + allowed[rng.integers(len(allowed))]
        middle = np.array(corner) + (cell + rng.uniform(0.35, 0.65, 2)) * side
        stands.append([*middle, levels[tuple(cell)] * level + _ANKLE])
    ankles = np.repeat(np.array([stands[:2]]), 1 + steps * (_STANDS + _SWINGS) // 2, axis=0)
    for step in range(steps):
        foot, begin = step % 2, 1 + step * (_STANDS + _SWINGS) // 2
        swing = rotations.ease(np.arange(1, _SWINGS + 1) / _SWINGS)[:, None]
        start, stop = ankles[begin, foot].copy(), np.array(stands[step + 2])
        over = np.array([0.0, 0.0, 0.4]) * swing * (1.0 - swing)
        ankles[begin : begin + _SWINGS, foot] = start + swing * (stop - start) + over
        ankles[begin + _SWINGS :, foot] = stop
    turn = rotations.from_yaw(yaw)
    ankles = rotations.rotate(turn, ankles)
    poses = np.repeat(character.rest_pose[None], len(ankles), axis=0)
    poses[:, :2] = ankles[..., :2].mean(axis=1)
    poses[:, 2] = ankles[..., 2].min(axis=1) + 0.62
    feet = np.broadcast_to(rotations.identity(), (len(ankles), 2, 4))
    return Motion(legs.place_ankles(character, poses, ankles, feet), FPS, "blocks")


def footprint(x: float, y: float, z: float, long: float = 0.2, wide: float = 0.08) -> FloatArray:
    """(4, 3) corners of a level sole about a point."""
    half = np.array([[-long, -wide], [-long, wide], [long, -wide], [long, wide]]) / 2
    return np.concatenate([half + np.array([x, y]), np.full((4, 1), z)], axis=1)
