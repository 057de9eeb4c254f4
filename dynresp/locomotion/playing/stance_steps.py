"""Keep standing feet in position between two frames of a graph.

A graph has few frames a second (15 in the paper); poses between them are interpolated joint by
joint. Cubics that keep the joints' velocities move a foot that has just come to rest: at 15 fps by
up to 5 mm until the next frame, and back. So if a foot stands at both ends of a step, its position
is prescribed and the leg follows: the foot turns as interpolated, and the point of its sole that
moves least from end to end moves on a straight line.
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

# A frame closer to an end of a step than this, as part of the step, is not changed.
_ON = 1e-6
# Corners whose displacements differ by less than this count as moving alike [m].
_ALIKE = 1e-3
# Frames that are changed at a time, to save memory.
_BLOCK = 8192


def keep_feet_planted(
    character: Character,
    poses: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    step: npt.NDArray[np.intp],
    part: FloatArray,
    standing: npt.NDArray[np.bool_],
) -> FloatArray:
    """Poses within steps, with standing feet kept in position.

    Args:
        character: The character.
        poses: (n, 59) as interpolated.
        ends: (k, 59) poses at the start of each step, and (k, 59) at its end.
        step: (n,) the step of each pose.
        part: (n,) the part of the step that has passed, 0 to 1.
        standing: (n, 2) whether the left and the right foot stand at both ends.

    Returns:
        (n, 59). Only legs of standing feet are changed, and no pose at an end of a step.
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
            around = ends[0][at], ends[1][at]
            bent = _with_foot_held(character, poses[block], around, part[block], i)
            out[np.ix_(block, columns)] = bent[:, columns]
    return out


def _with_foot_held(
    character: Character,
    poses: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    part: FloatArray,
    foot: int,
) -> FloatArray:
    """Poses (n, 59) whose foot moves straight from its position at one end to that at the other."""
    body = character.body(f"{FEET[foot]}_foot")
    sole = sole_points(character, FEET[foot])
    corners = []
    for there in ends:
        at_end = character.kinematics(there)
        turned = rotations.rotate(at_end.quaternions[:, body, None], sole)
        corners.append(at_end.positions[:, body, None] + turned)
    before, after = corners
    # The point of the sole that moves straight: a mean of the corners that touch, with most weight
    # on those that move least. Choosing one corner would switch among corners that move alike.
    moved = np.linalg.norm((after - before)[..., :2], axis=-1)
    high = before[..., 2] - before[..., 2].min(axis=1, keepdims=True)
    weight = np.maximum(1.0 - high / TOUCH, 0.0) / (moved**2 + _ALIKE**2)
    weight /= weight.sum(axis=1, keepdims=True)
    own = weight @ sole
    begin, end = (np.einsum("nc,ncx->nx", weight, x) for x in (before, after))
    point = begin + part[:, None] * (end - begin)
    states = character.kinematics(poses)
    bodies = [character.body(f"{side}_foot") for side in FEET]
    ankles, feet = states.positions[:, bodies], states.quaternions[:, bodies]
    ankles[:, foot] = point - rotations.rotate(feet[:, foot], own)
    return legs.place_ankles(character, poses, ankles, feet)
