"""Feet that stand between two frames of a graph.

A graph has few frames a second (15 in the paper), and what is shown between two of them is
interpolated, joint by joint. Cubics that keep the joints' velocities carry a foot on that has just
come to rest: at 15 frames a second it moves by up to 5 mm until the next frame, and back. So where
a foot stands at both ends of a step, it is led there instead, and the leg follows: the foot turns
as interpolated, and that point of its sole which moves least from end to end goes straight.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.feet.skating import TOUCH
from dynresp.motion.ground import sole_points
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

# A frame nearer than that to an end of a step is as it is there, as part of the step.
_ON = 1e-6
# Corners whose ways differ by less move alike [m].
_ALIKE = 1e-3
# Frames that are bent at a time, which saves memory.
_BLOCK = 8192


def keep_feet_planted(
    character: Character,
    poses: FloatArray,
    knots: tuple[FloatArray, FloatArray],
    step: npt.NDArray[np.intp],
    part: FloatArray,
    standing: npt.NDArray[np.bool_],
) -> FloatArray:
    """Poses between knots whose feet, where they stand, do not leave their way from knot to knot.

    Args:
        character: The character.
        poses: (n, 59) as interpolated.
        knots: (k, 59) where each step begins, and (k, 59) where it ends.
        step: (n,) the step that each pose lies in.
        part: (n,) how far it is on its way, 0 to 1.
        standing: (n, 2) whether the left and the right foot stand at both ends.

    Returns:
        (n, 59). Only the legs of standing feet differ, and none at the ends of steps.
    """
    out = np.array(poses)
    held = standing & ((part > _ON) & (part < 1.0 - _ON))[:, None]
    for i, side in enumerate(FEET):
        rows = np.flatnonzero(held[:, i])
        joints = [character.joint(f"{side}_{name}") for name in ("hip", "knee", "ankle")]
        columns = np.concatenate([np.arange(7 + 4 * j, 11 + 4 * j) for j in joints])
        for start in range(0, len(rows), _BLOCK):
            block = rows[start : start + _BLOCK]
            at = step[block]
            ends = tuple(knot[at] for knot in knots)
            bent = _led(character, poses[block], (ends[0], ends[1]), part[block], i)
            out[np.ix_(block, columns)] = bent[:, columns]
    return out


def _led(
    character: Character,
    poses: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    part: FloatArray,
    foot: int,
) -> FloatArray:
    """Poses (n, 59) with one foot on its way between two poses each."""
    body = character.body(f"{FEET[foot]}_foot")
    sole = sole_points(character, FEET[foot])
    corners = []
    for there in ends:
        at_end = character.kinematics(there)
        turned = rotations.rotate(at_end.quaternions[:, body, None], sole)
        corners.append(at_end.positions[:, body, None] + turned)
    before, after = corners
    # The point of the sole that is led: between corners that touch, nearest to those that move
    # least. A mean, since of corners that move alike now the one would be chosen, now the other.
    ways = np.linalg.norm((after - before)[..., :2], axis=-1)
    high = before[..., 2] - before[..., 2].min(axis=1, keepdims=True)
    weight = np.maximum(1.0 - high / TOUCH, 0.0) / (ways**2 + _ALIKE**2)
    weight /= weight.sum(axis=1, keepdims=True)
    own = weight @ sole
    begin, end = (np.einsum("nc,ncx->nx", weight, x) for x in (before, after))
    point = begin + part[:, None] * (end - begin)
    states = character.kinematics(poses)
    bodies = [character.body(f"{side}_foot") for side in FEET]
    ankles, feet = states.positions[:, bodies], states.quaternions[:, bodies]
    ankles[:, foot] = point - rotations.rotate(feet[:, foot], own)
    return legs.place_ankles(character, poses, ankles, feet)
