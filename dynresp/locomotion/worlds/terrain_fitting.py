"""Fitting the feet of a walk to the blocks of a terrain, and measuring how they stand.

The motion is blended, so a foot may come down beside its block, and the walk allows stances that
are higher or lower than recorded. First the feet are fitted as on level ground, so that they do not
slide. Then each stance moves to its block: to its height, and away from edges at which the height
changes. In a swing the shift goes from that of one stance to that of the next, and the foot is
raised over the blocks below it. The root follows the feet.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.playing.composition import Composition, compose
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.locomotion.worlds.terrain_walk import TerrainWalk
from dynresp.locomotion.worlds.world_contacts import sole_corners
from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.feet import legs
from dynresp.motion.feet.skating import foot_slides
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing
from dynresp.support.arrays import LongArray
from dynresp.support.runs import runs

# The root is lowered by at most this [m]: more than on level ground, since jumps are rough in a
# graph of so little motion.
_MAX_ROOT_DROP = 0.12
# Distance that soles keep from edges at which the height changes [m].
_EDGE_M = 0.01
# Height at which a swinging sole passes over blocks [m], and the time to reach it [s].
_CLEAR_M, _LIFT_S = 0.02, 0.12
# Largest speed at which a foot is raised for that [m/s].
_MAX_CLIMB_SPEED = 1.0
# Time in which the root follows the feet [s].
_FOLLOW_S = 0.5
# Part of its length to which a leg is stretched.
_STRAIGHT = 0.99


@dataclass(frozen=True, eq=False)
class Footing:
    """How well the feet of a motion stand on blocks. A stance is a run of frames in contact.

    Attributes:
        off_height: (s,) largest distance of the sole's lowest point above or below its block [m].
        overhang: (s,) how far the sole sticks out over an edge to lower ground, the median over
            the stance [m].
        slide: (s,) distance that the foot slides [m].
        sunk: (frames,) how deep a sole is in a block, standing or swinging [m].
    """

    off_height: FloatArray
    overhang: FloatArray
    slide: FloatArray
    sunk: FloatArray


def compose_on_terrain(
    graph: TerrainGraph,
    terrain: Terrain,
    walk: TerrainWalk,
    fps: float | None = None,
) -> Composition:
    """Play a walk over blocks, with its feet on them.

    Args:
        graph: The graph of the walk.
        terrain: The blocks.
        walk: The walk; two frames or more.
        fps: Frame rate of the motion, by default the graph's.

    Returns:
        As of `compose`; `motion` is fitted to the blocks. `unfitted` has the recorded heights,
        which are not those of the blocks where the walk changes steps.
    """
    character, rate = graph.character, graph.graph.config.fps
    played = compose(
        graph.graph, character, walk.frames, walk.placements[0], fps, max_root_drop=_MAX_ROOT_DROP
    )
    motion = played.motion
    blocks = walk_blocks(walk, rate, motion)
    poses = _put_on_blocks(character, terrain, motion, blocks)
    fitted = Motion(poses, motion.fps, "walk over blocks", motion.contacts)
    return Composition(played.frames, fitted, played.jumps, walk.placements, played.unfitted)


def walk_blocks(walk: TerrainWalk, rate: float, motion: Motion) -> LongArray:
    """The block on which each foot of a composed walk should stand.

    Args:
        walk: The walk.
        rate: Its frame rate [1/s].
        motion: The motion composed of it.

    Returns:
        (n, 2, 2) column and row; -1 where a foot does not stand.
    """
    at = np.arange(len(motion)) * rate / motion.fps
    # As in `compose`: half way between two frames the later one counts.
    nearest = np.minimum(np.floor(at + 0.5 + 1e-9).astype(np.intp), len(walk.frames) - 1)
    return np.where(motion.contacts[..., None], walk.blocks[nearest], -1)


def footing(character: Character, terrain: Terrain, motion: Motion, blocks: LongArray) -> Footing:
    """Measure how feet stand.

    Args:
        character: The character.
        terrain: The blocks.
        motion: The motion, with its contacts.
        blocks: (n, 2, 2) the block on which each foot should stand; see `walk_blocks`.
    """
    states = character.kinematics(motion.poses)
    soles = sole_corners(character, states)
    slides = foot_slides(character, states)
    beneath = terrain.height(soles)
    cells = (soles[..., :2] - terrain.corner) / terrain.block_m
    inward = np.abs(cells - np.round(cells)).min(axis=-1) * terrain.block_m
    depth = np.nan_to_num(np.minimum(beneath - soles[..., 2], inward), nan=0.0)
    off, over, slide = [], [], []
    for foot in range(2):
        for start, stop in runs(motion.contacts[:, foot]):
            rows = slice(start, stop)
            top = terrain.levels[tuple(blocks[rows, foot].T)] * terrain.level_m
            off.append(np.abs(soles[rows, foot, :, 2].min(axis=1) - top).max())
            lower = ~(beneath[rows, foot] > top[:, None] - 0.5 * terrain.level_m)
            corner = terrain.corner + blocks[rows, foot, None] * terrain.block_m
            xy = soles[rows, foot, :, :2]
            out = np.maximum(corner - xy, xy - corner - terrain.block_m).max(axis=-1)
            over.append(np.median(np.where(lower, np.maximum(out, 0.0), 0.0).max(axis=1)))
            slide.append(slides[start : stop - 1, foot].sum())
    return Footing(
        np.array(off), np.array(over), np.array(slide), np.maximum(depth, 0.0).max(axis=(1, 2))
    )


def _put_on_blocks(
    character: Character,
    terrain: Terrain,
    motion: Motion,
    blocks: LongArray,
) -> FloatArray:
    """Poses (n, 59) with every stance on its block."""
    states = character.kinematics(motion.poses)
    soles, ankles = sole_corners(character, states), legs.ankle_positions(character, states)
    shift = np.zeros((len(motion), 2, 3))
    for foot in range(2):
        stances = runs(motion.contacts[:, foot])
        for start, stop in stances:
            rows = slice(start, stop)
            block = blocks[start, foot]
            sole = np.median(soles[rows, foot], axis=0)
            shift[rows, foot, :2] = drawn_in(terrain, block, sole, _EDGE_M)
            top = terrain.levels[tuple(block)] * terrain.level_m
            shift[rows, foot, 2] = top - soles[rows, foot, :, 2].min(axis=1)
        _pass_on(shift[:, foot], stances)
        _raise(terrain, soles[:, foot], shift[:, foot], stances, motion.fps)
    root = smoothing.average(shift.mean(axis=1), max(1, round(0.5 * _FOLLOW_S * motion.fps)))
    root[:, 2] -= _lowering(character, states, ankles + shift, root, motion.fps)
    poses = np.array(motion.poses)
    poses[:, :3] += root
    return legs.place_ankles(character, poses, ankles + shift)


def drawn_in(terrain: Terrain, block: LongArray, sole: FloatArray, edge: float) -> FloatArray:
    """(2,) the smallest shift of a sole away from edges at which the height changes [m].

    Args:
        terrain: The blocks.
        block: (2,) column and row of the block that it stands on.
        sole: (4, 2 or more) its corners [m].
        edge: Distance that it keeps from such edges [m].
    """
    corner = terrain.corner + block * terrain.block_m
    high = np.max(sole[:, :2], axis=0) - corner - terrain.block_m + edge
    low = corner - np.min(sole[:, :2], axis=0) + edge
    # Along x and along y: the step across the edge that the sole reaches over, and by how much.
    step = np.where(high > 0, 1, np.where(low > 0, -1, 0))
    over = np.maximum(np.maximum(high, low), 0.0)
    here = terrain.levels[tuple(block)]
    shift = np.zeros(2)
    for axis in range(2):
        across = np.zeros(2, dtype=np.int64)
        across[axis] = step[axis]
        if _level(terrain, block + across) != here:
            shift[axis] = -step[axis] * over[axis]
    if not shift.any() and step.all() and _level(terrain, block + step) != here:
        axis = int(np.argmin(over))
        shift[axis] = -step[axis] * over[axis]
    return shift


def _level(terrain: Terrain, block: LongArray) -> int | None:
    """Level of a block; None beside the grid."""
    if np.all((block >= 0) & (block < terrain.levels.shape)):
        return int(terrain.levels[tuple(block)])
    return None


def _pass_on(shift: FloatArray, stances: list[tuple[int, int]]) -> None:
    """Fill in the shift (n, 3) of a foot before, between and after its stances."""
    if not stances:
        return
    shift[: stances[0][0]] = shift[stances[0][0]]
    shift[stances[-1][1] :] = shift[stances[-1][1] - 1]
    for (_, stop), (start, _) in itertools.pairwise(stances):
        share = rotations.ease(np.arange(1, start - stop + 1) / (start - stop + 1))[:, None]
        shift[stop:start] = shift[stop - 1] + share * (shift[start] - shift[stop - 1])


def _raise(
    terrain: Terrain,
    soles: FloatArray,
    shift: FloatArray,
    stances: list[tuple[int, int]],
    fps: float,
) -> None:
    """Raise a swinging foot (its shift, in place) over the blocks below it."""
    from scipy import ndimage

    there = soles + shift[:, None]
    need = np.nan_to_num(terrain.height(there) - there[..., 2], nan=-np.inf).max(axis=1)
    stands = np.zeros(len(need), dtype=bool)
    for start, stop in stances:
        stands[start:stop] = True
    # Frames to the nearest frame in which it stands.
    away = ndimage.distance_transform_edt(~stands) if stances else np.full(len(need), np.inf)
    half = max(1, round(_LIFT_S * fps))
    wanted = need + _CLEAR_M * rotations.ease(np.minimum(away / half, 1.0))
    wanted = np.where(stands, 0.0, np.maximum(wanted, 0.0))
    highest = ndimage.maximum_filter1d(wanted, 2 * half + 1, mode="nearest")
    raised = smoothing.average(highest, half)
    shift[:, 2] += np.minimum(raised, _MAX_CLIMB_SPEED * away / fps)


def _lowering(
    character: Character,
    states: BodyStates,
    ankles: FloatArray,
    root: FloatArray,
    fps: float,
) -> FloatArray:
    """How far the root must be lowered for the legs to reach the ankles (n,) [m], smoothed."""
    from scipy import ndimage

    need = np.zeros(len(root))
    for i, side in enumerate(FEET):
        thigh, shank, foot = (character.body(f"{side}_{x}") for x in ("thigh", "shank", "foot"))
        length = _STRAIGHT * float(
            np.linalg.norm(character.offsets[shank]) + np.linalg.norm(character.offsets[foot])
        )
        before = np.linalg.norm(states.positions[:, thigh] - states.positions[:, foot], axis=1)
        reach = np.maximum(length, before)
        away = states.positions[:, thigh] + root - ankles[:, i]
        across = np.sum(away[:, :2] ** 2, axis=1)
        need = np.maximum(need, away[:, 2] - np.sqrt(np.maximum(reach**2 - across, 0.0)))
    half = max(1, round(0.5 * _FOLLOW_S * fps))
    highest = ndimage.maximum_filter1d(need, 2 * half + 1, mode="nearest")
    return smoothing.average(highest, half)
