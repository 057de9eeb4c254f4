"""Recorded terrain: find the blocks that people walked on from where their feet stood.

Made for three clips of the CMU database (subject 3): 45 s of walking over square blocks of several
heights. The files do not describe the blocks. So the grid and the height of each block are found
from the motion, and `onto_blocks` moves the motion onto an exact grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.terrain import BLOCK_M, LEVEL_M, Terrain
from dynresp.locomotion.worlds.world_contacts import (
    feet_on,
    find_stances,
    heights_above,
    sole_corners,
)
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing
from dynresp.support.arrays import LongArray
from dynresp.support.errors import MotionError

RECORDED_SCALE = 1.0382
"""Scale of the recorded blocks after retargeting: the character's legs are longer than the
subject's by this factor, and retargeting scales positions by it."""

# A sole whose heel and ball differ in height by more than this [m] is not used.
_TILT = 0.05
# Grids are tried at this many offsets along each side of a block, and at these turns [rad].
_OFFSETS = 40
_YAWS = np.radians(np.arange(-45.0, 45.0, 1.0))
# A grid is as good as the best one if its variance of heights [m2] is at most the best one's times
# the first number plus the second, which is below what can be measured.
_AS_GOOD, _NOISE_M2 = 1.05, 0.003**2
# There must be this many more stances than blocks, or the grid is a guess.
_SPARE = 8
# A leg counts as straight from this part of its length on: beyond, a knee turns by 10 degrees for a
# few millimetres.
_STRAIGHT = 0.995
# Time in which the root follows the feet up or down [s].
_FOLLOW_S = 0.5


@dataclass(frozen=True, eq=False)
class BlockFit:
    """The grid of blocks under some motions.

    Attributes:
        yaw: Angle from the motions' x axis to the grid's [rad], within an eighth of a turn.
        corner: (2,) where block (0, 0) begins, in coordinates turned by -yaw [m].
        side: Side of a block at the scale of the motions [m].
        levels: (columns, rows) level of each block, the lowest 0; 0 where no foot stood.
        stances: (columns, rows) how many level stances there were on each block.
        base: (motions,) height of level 0 in each motion's own coordinates [m].
        scatter: Standard deviation of the heights of stances on the same block [m].
        misfit: (columns, rows) how far each block is above its level, as recorded [m]; 0 where no
            foot stood.
    """

    yaw: float
    corner: FloatArray
    side: float
    levels: LongArray
    stances: LongArray
    base: FloatArray
    scatter: float
    misfit: FloatArray


def fit_blocks(
    character: Character, motions: Sequence[Motion], scale: float = RECORDED_SCALE
) -> BlockFit:
    """Find the grid, and the level of every block that a foot stood on.

    All motions have one grid, which is found in the longest of them. It is the grid with the
    smallest variance of the heights of stances on the same block; of equally good ones the grid on
    whose blocks feet stand nearest to the middle.

    Args:
        character: The character.
        motions: Motions on the same blocks in one world; their heights may differ by a constant.
        scale: Size of the blocks in the motions divided by their real size.

    Raises:
        MotionError: There are too few stances to find a grid.
    """
    side, level = BLOCK_M * scale, LEVEL_M * scale
    soles = [_level_soles(character, motion) for motion in motions]
    longest = int(np.argmax([len(s) for s in soles]))
    if len(soles[longest]) <= _SPARE:
        raise MotionError(
            f"{len(soles[longest])} stances are too few to find a grid of {side:.3f} m blocks; "
            "give a longer motion over them"
        )
    yaw, corner, scatter = _find_grid(soles[longest], side)
    cells = [_cells(s.mean(axis=1), yaw, corner, side) for s in soles]
    first = np.concatenate(cells).min(axis=0)
    cells = [c - first for c in cells]
    shape = tuple(np.concatenate(cells).max(axis=0) + 1)
    heights = [np.median(s[..., 2], axis=1) for s in soles]
    counts, means = _block_means(cells[longest], heights[longest], shape)
    base = np.zeros(len(motions))
    for k in range(len(motions)):
        known = counts[tuple(cells[k].T)] > 0
        if not known.any():
            raise MotionError(
                f"motion {motions[k].name!r} stands on no block that the longest motion stands "
                "on; give motions of one world"
            )
        base[k] = np.median(heights[k][known] - means[tuple(cells[k][known].T)])
    every = np.concatenate(cells)
    raised = np.concatenate([h - b for h, b in zip(heights, base, strict=True)])
    counts, means = _block_means(every, raised, shape)
    zero = _find_zero(means[counts > 0], level)
    levels = np.where(counts > 0, np.round((means - zero) / level), 0).astype(np.int64)
    lowest = int(levels[counts > 0].min())
    levels = np.where(counts > 0, levels - lowest, 0)
    zero += lowest * level
    misfit = np.where(counts > 0, means - zero - levels * level, 0.0)
    return BlockFit(yaw, corner + side * first, side, levels, counts, base + zero, scatter, misfit)


def onto_blocks(
    character: Character, motions: Sequence[Motion], fit: BlockFit | None = None
) -> tuple[list[Motion], Terrain]:
    """Move recorded motions onto an exact grid of blocks that begins at the origin.

    The motions are turned and shifted so that the grid is along the axes, and scaled to the blocks'
    real size. Legs are bent or stretched so that standing feet touch the blocks. Between two
    stances of a foot its shift is interpolated. The root moves by the mean shift of both feet,
    smoothed.

    Args:
        character: The character.
        motions: Motions on the same blocks.
        fit: The blocks, by default those that `fit_blocks` finds.

    Returns:
        The motions, with the feet's contacts with the blocks, and the blocks.

    Raises:
        MotionError: There are too few stances to find a grid.
    """
    fit = fit_blocks(character, motions) if fit is None else fit
    terrain = Terrain(fit.levels)
    moved = []
    for motion, base in zip(motions, fit.base, strict=True):
        aligned = motion.moved(-fit.yaw, (0.0, 0.0, -float(base)))
        poses = np.array(aligned.poses)
        ankles = legs.ankle_positions(character, character.kinematics(poses))
        shrink = terrain.block_m / fit.side
        poses[:, :2] = (poses[:, :2] - fit.corner) * shrink
        ankles[..., :2] = (ankles[..., :2] - fit.corner) * shrink
        poses = legs.place_ankles(character, poses, ankles)
        poses, contacts = _settle(
            character, poses, motion.fps, terrain, LEVEL_M * fit.side / BLOCK_M
        )
        moved.append(Motion(poses, motion.fps, motion.name, contacts, motion.labels))
    return moved, terrain


def _level_soles(character: Character, motion: Motion) -> FloatArray:
    """(k, 4, 3) soles of the stances with a foot that is level from heel to ball."""
    corners = sole_corners(character, character.kinematics(motion.poses))
    soles = find_stances(corners, motion.fps).soles
    tilt = soles[:, :2, 2].mean(axis=1) - soles[:, 2:, 2].mean(axis=1)
    return soles[np.abs(tilt) < _TILT]


def _cells(points: FloatArray, yaw: float, corner: FloatArray, side: float) -> LongArray:
    """(k, 2) the blocks under points (k, 2 or more) in a grid."""
    return np.floor((_turned(points, yaw) - corner) / side).astype(np.int64)


def _turned(points: FloatArray, yaw: float) -> FloatArray:
    """Points (..., 2 or more) in coordinates turned by -yaw, (..., 2)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return points[..., :2] @ np.array([[cosine, -sine], [sine, cosine]])


def _find_grid(soles: FloatArray, side: float) -> tuple[float, FloatArray, float]:
    """Turn, corner of some block, and scatter of the heights [m], of the grid that fits best."""
    steps = np.arange(_OFFSETS) * side / _OFFSETS
    corners = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    variances = np.stack([_variances(soles, yaw, corners, side) for yaw in _YAWS])
    best = variances.min()
    if not np.isfinite(best):
        raise MotionError(
            f"nearly all {len(soles)} stances are on different blocks, so no grid is found; "
            "give a longer motion over the same blocks"
        )
    good = np.argwhere(variances <= best * _AS_GOOD + _NOISE_M2)
    off = [_off_middle(soles, _YAWS[y], corners[c], side) for y, c in good]
    y, c = good[np.argmin(off)]
    return float(_YAWS[y]), corners[c], float(np.sqrt(variances[y, c]))


def _variances(soles: FloatArray, yaw: float, corners: FloatArray, side: float) -> FloatArray:
    """(grids,) variance of heights on the same block; infinite if there are too many blocks."""
    heights = np.median(soles[..., 2], axis=1)
    at = _turned(soles.mean(axis=1), yaw)
    cells = np.floor((at - corners[:, None]) / side).astype(np.int64)
    cells -= cells.min(axis=1, keepdims=True)
    rows = int(cells[..., 1].max()) + 1
    blocks = (int(cells[..., 0].max()) + 1) * rows
    keys = cells[..., 0] * rows + cells[..., 1] + blocks * np.arange(len(corners))[:, None]
    size = blocks * len(corners)
    weights = np.broadcast_to(heights, keys.shape).ravel()
    counts = np.bincount(keys.ravel(), minlength=size)
    sums = np.bincount(keys.ravel(), weights, minlength=size)
    squares = np.bincount(keys.ravel(), weights**2, minlength=size)
    residuals = (squares - sums**2 / np.maximum(counts, 1)).reshape(len(corners), blocks)
    spare = len(heights) - np.count_nonzero(counts.reshape(len(corners), blocks), axis=1)
    total = np.maximum(residuals.sum(axis=1), 0.0)
    return np.where(spare >= _SPARE, total / np.maximum(spare, 1), np.inf)


def _off_middle(soles: FloatArray, yaw: float, corner: FloatArray, side: float) -> float:
    """Mean square of how far the soles' corners are from the middles of their blocks [m2]."""
    cells = _cells(soles.mean(axis=1), yaw, corner, side)
    middles = corner + (cells + 0.5) * side
    return float(np.mean((_turned(soles, yaw) - middles[:, None]) ** 2))


def _block_means(
    cells: LongArray, heights: FloatArray, shape: tuple[int, ...]
) -> tuple[LongArray, FloatArray]:
    """How many stances are on each block of a grid, and their mean height [m]; 0 where none."""
    counts, sums = np.zeros(shape, dtype=np.int64), np.zeros(shape)
    np.add.at(counts, tuple(cells.T), 1)
    np.add.at(sums, tuple(cells.T), heights)
    return counts, sums / np.maximum(counts, 1)


def _find_zero(heights: FloatArray, level: float) -> float:
    """The height of a level [m], from 0 to below one level, near which most heights are whole."""
    zeros = np.linspace(0.0, level, 50, endpoint=False)
    rests = (heights - zeros[:, None] + 0.5 * level) % level - 0.5 * level
    return float(zeros[np.argmin((rests**2).sum(axis=1))])


def _settle(
    character: Character, poses: FloatArray, fps: float, terrain: Terrain, level: float
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Put the feet on the blocks.

    Args:
        character: The character.
        poses: (frames, 59), in the terrain's coordinates but for the heights.
        fps: Frame rate [1/s].
        terrain: The blocks.
        level: Height of a level in the poses [m].

    Returns:
        Poses (frames, 59), and contacts (frames, 2).
    """
    from scipy import ndimage

    states = character.kinematics(poses)
    ankles, corners = legs.ankle_positions(character, states), sole_corners(character, states)
    frames = np.arange(len(poses))
    stances = find_stances(corners, fps)
    middles = stances.soles.mean(axis=1)
    shift = np.zeros((len(poses), 2))
    for foot in range(2):
        # First each stance as a whole: its height may be off by up to half a level.
        mine = stances.feet == foot
        wanted = terrain.height(middles[mine]) - np.median(stances.soles[mine, :, 2], axis=1)
        known = np.abs(wanted) < level
        at = 0.5 * (stances.starts + stances.stops)[mine][known]
        if len(at):
            shift[:, foot] = np.interp(frames, at, wanted[known])
    corners[..., 2] += shift[:, :, None]
    contacts = feet_on(terrain.height, corners, fps)
    above = heights_above(terrain.height, corners).min(axis=2)
    for foot in range(2):
        # Then frame by frame, so that feet touch from the first to the last frame of contact.
        at = np.flatnonzero(contacts[:, foot])
        if len(at):
            shift[:, foot] -= np.interp(frames, at, above[at, foot])
    half = max(1, round(0.5 * _FOLLOW_S * fps))
    rise = smoothing.average(shift.mean(axis=1), half)
    reach = (shift + _slack(character, states, ankles)).min(axis=1)
    beyond = np.maximum(rise - reach, 0.0)
    highest = ndimage.maximum_filter1d(beyond, 2 * half + 1, mode="nearest")
    rise -= smoothing.average(highest, half)
    ankles[..., 2] += shift
    settled = np.array(poses)
    settled[:, 2] += rise
    return legs.place_ankles(character, settled, ankles), contacts


def _slack(character: Character, states: BodyStates, ankles: FloatArray) -> FloatArray:
    """How far each ankle can be lowered before its leg is straight (frames, 2) [m]; 0 if it is."""
    thighs, shanks, feet = (
        [character.body(f"{side}_{part}") for side in FEET] for part in ("thigh", "shank", "foot")
    )
    length = np.linalg.norm(character.offsets[shanks], axis=1)
    length = _STRAIGHT * (length + np.linalg.norm(character.offsets[feet], axis=1))
    away = states.positions[:, thighs] - ankles
    across = np.linalg.norm(away[..., :2], axis=-1)
    down = np.sqrt(np.maximum(length**2 - across**2, 0.0))
    return np.maximum(down - away[..., 2], 0.0)
