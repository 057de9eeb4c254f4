"""Feet that do not slide: constraint-based fitting of a composed motion (Lee et al. 2002, 4.1.1).

A motion that is composed of pieces of others, and blended where it goes from one to the next,
slides its feet. Here each stance of a foot becomes one without slip: the foot rolls and pivots as
in its source, and the slide of its sole's stillest point is taken away
(`dynresp.motion.feet.skating`). What is still free is where the stance is put. This follows the
paper's four cases:

1. Begun before a blend, ended in it: where the motion before has it.
2. Begun in a blend, ended after it: where the motion after has it. A frame of a stance counts the
   more, the less of a blend is left in it.
3. All in a blend: where it differs least from what is played. (The paper takes the closer of the
   two motions; the blend is between them.)
4. Over the whole blend: between where the two motions have it; the difference to the motion after
   fades in the next swing. A graph may drop such transitions (`contact_cases`).

A stance during several blends, one after the other, is dragged the farthest. It is moved from
there to where the leg reaches it in all of its first `STANCE_S`.

In the swing between two stances the correction changes from the one's to the other's, with a
continuous velocity. Then hip, knee and ankle follow by two-bone inverse kinematics
(`dynresp.motion.feet.legs`), and where a leg is too short the root is lowered, smoothly.

To fit a motion that is produced piece by piece: give the frames already shown as `fitted`, then the
frames due, then the planned frames to come, at least `look_ahead_frames` for the same feet as if
all were fitted at once; show the frames due, and drop the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import Character, as_poses
from dynresp.motion.feet import legs
from dynresp.motion.feet.foot_tracks import FootTracks, foot_balls, foot_tracks, lowest_points
from dynresp.motion.feet.skating import TOUCH
from dynresp.motion.ground import sole_points
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing
from dynresp.support.errors import MotionError

STANCE_S = 1.0
"""So much of a stance counts for where it is put [s]."""
EASE_S = 0.5
"""Time in which a correction fades in a swing, at most [s]."""
STILL_S = 0.1
"""Time in which a foot comes to rest that slides in the frames already shown [s]."""
ROOT_S = 0.2
"""Time in which the root is lowered, and raised again [s]."""
MAX_SHIFT_SPEED = 0.5
"""A correction changes by at most this [m/s] from stance to stance; where a swing is too short for
it, the next stance is put nearer to the last."""
MAX_TURN_RATE = 2.0
"""The same for its turn [rad/s]."""
MAX_HURRIED_SPEED = 2.0
"""By this a correction may change where the leg would not reach the next stance otherwise [m/s]."""
MAX_HOLD_DISTANCE = 0.4
"""How far a standing foot is held from where it is played [m]; one that is dragged farther
slides."""
MAX_ROOT_DROP = 0.08
"""How far the root is lowered at most [m]; a foot that is still too far away slides."""

# Part of its length to which a leg is stretched, unless it is played straighter: on the last few
# millimetres a knee turns by 10 degrees and more.
_STRAIGHT = 0.99
# Frames that are bent at a time, which saves memory.
_BLOCK = 8192
# A frame in the middle of a blend still counts a little for where a stance is put.
_LEAST_WEIGHT = 1e-3
# Corrections below this are rounding [m, rad].
_NOTHING = 1e-9


def fading_frames(fps: float) -> int:
    """Frames after the last stance by which nothing is corrected any more, at most."""
    return _frames(EASE_S, fps) + 4 * _frames(ROOT_S, fps)


def look_ahead_frames(fps: float) -> int:
    """Frames to come on which a fitted frame depends, at most."""
    return fading_frames(fps) + _frames(STANCE_S, fps)


@dataclass(frozen=True, eq=False)
class ComposedMotion:
    """A motion composed of others, as it is played before its feet are fitted.

    Attributes:
        poses: (n, 59) as played, blends included.
        source: (n, 59) for each frame the recorded pose that it is made from, placed where it
            belongs, without what is blended into it; equal to `poses` outside blends.
        contacts: (n, 2) whether the left and the right foot are to stand.
        jumps: Frames at which the source changes, ascending; the first of the source entered. One
            below 0 was that many frames before this piece, and its blend may go on still.
        fps: Frame rate [1/s].
        blend_s: How long a jump is blended [s].
        fitted: (m, 59) the first m frames as they have been shown; None for none. Two or more let
            velocities go on.
        ground: (n, 2) height of the ground under each foot [m]; None for 0.
    """

    poses: FloatArray
    source: FloatArray
    contacts: npt.NDArray[np.bool_]
    jumps: npt.ArrayLike
    fps: float
    blend_s: float
    fitted: FloatArray | None = None
    ground: FloatArray | None = None


def fit_feet(
    character: Character, composed: ComposedMotion, max_root_drop: float = MAX_ROOT_DROP
) -> FloatArray:
    """Poses whose standing feet do not slide.

    Args:
        character: The character.
        composed: The motion.
        max_root_drop: How far the root is lowered at most [m].

    Returns:
        (n, 59): `composed.fitted`, then the fitted frames. Frames in which nothing is to be
        corrected are those of `composed.poses`, bit for bit.

    Raises:
        MotionError: Shapes of `composed` do not agree, or a number is out of bounds.
    """
    _check(composed)
    poses = as_poses(composed.poses)
    n = len(poses)
    played = foot_tracks(character, poses)
    fitted = np.empty((0, poses.shape[1])) if composed.fitted is None else composed.fitted
    reach = _reach(character, played)
    shift, turn = _corrections(character, composed, played, reach, fitted, max_root_drop)
    ankles = played.ankles + shift
    feet, changed = played.feet.copy(), np.zeros(n, dtype=bool)
    for i in range(len(FEET)):
        changed |= (np.abs(shift[i]) > _NOTHING).any(axis=1)
        changed |= (np.abs(turn[i]) > _NOTHING).any(axis=1)
        feet[i] = rotations.multiply(rotations.from_rotation_vector(turn[i]), feet[i])
    drop = _root_drop(played, reach, ankles, composed.fps, max_root_drop)
    kept = len(fitted)
    if kept:
        behind = poses[kept - 1, 2] - fitted[-1, 2] - drop[kept - 1]
        away = np.arange(n) - (kept - 1)
        fading = 2 * _frames(ROOT_S, composed.fps)
        drop += behind * (1.0 - rotations.ease(away / fading))
    changed |= np.abs(drop) > _NOTHING
    out = np.array(poses)
    out[:kept] = fitted
    rows = np.flatnonzero(changed[kept:]) + kept
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        lowered = poses[block]
        lowered[:, 2] -= drop[block]
        wanted = [x[:, block].swapaxes(0, 1) for x in (ankles, feet)]
        out[block] = legs.place_ankles(character, lowered, *wanted)
    return out


def _check(composed: ComposedMotion) -> None:
    """Refuse a motion whose parts do not agree."""
    n = len(as_poses(composed.poses))
    if len(as_poses(composed.source)) != n:
        raise MotionError(f"source must have {n} frames as poses, got {len(composed.source)}")
    if np.shape(composed.contacts) != (n, 2):
        raise MotionError(f"contacts must be ({n}, 2), got {np.shape(composed.contacts)}")
    if composed.ground is not None and np.shape(composed.ground) != (n, 2):
        raise MotionError(f"ground must be ({n}, 2), got {np.shape(composed.ground)}")
    if composed.fitted is not None and len(as_poses(composed.fitted)) > n:
        raise MotionError(f"fitted must have at most {n} frames, got {len(composed.fitted)}")
    if not (composed.fps > 0.0 and composed.blend_s > 0.0):
        raise MotionError(
            f"fps and blend_s must be above 0, got {composed.fps}, {composed.blend_s}"
        )
    jumps = np.asarray(composed.jumps, dtype=np.int64)
    if jumps.ndim != 1 or np.any(np.diff(jumps) <= 0) or np.any(jumps >= n):
        raise MotionError(f"jumps must be frames below {n}, ascending, got {jumps}")


def _corrections(
    character: Character,
    composed: ComposedMotion,
    played: FootTracks,
    reach: FloatArray,
    fitted: FloatArray,
    max_root_drop: float,
) -> tuple[FloatArray, FloatArray]:
    """How each ankle is shifted [m] and each foot turned (rotation vector [rad]), (2, n, 3) each.

    Args:
        character: The character.
        composed: The motion.
        played: Its feet as played.
        reach: (2, n) how far an ankle may be from its hip [m].
        fitted: (m, 59) the first frames as they have been shown.
        max_root_drop: How far the root is lowered at most [m].
    """
    from dynresp.motion.feet import foot_fitting_place_kernel as kernel
    from dynresp.motion.feet.foot_fitting_kernel import correct_kernel

    n, fps, kept = len(reach[0]), composed.fps, len(fitted)
    source = foot_tracks(character, as_poses(composed.source))
    shown = foot_tracks(character, fitted)
    blend = max(1, round(composed.blend_s * fps))
    jumps = np.asarray(composed.jumps, dtype=np.int64)
    jump = np.zeros(n, dtype=bool)
    jump[jumps[jumps >= 0]] = True
    weight = _weights(jumps, n, blend)
    times = kernel.FitTimes(_frames(STANCE_S, fps), blend, _frames(STILL_S, fps),
                            _frames(EASE_S, fps))  # fmt: skip
    limits = kernel.FitLimits(
        touch=TOUCH,
        shift=MAX_SHIFT_SPEED / fps,
        turn=MAX_TURN_RATE / fps,
        hold_distance=MAX_HOLD_DISTANCE,
        hurried_shift=MAX_HURRIED_SPEED / fps,
        root_drop=max_root_drop,
    )
    shift, turn = np.zeros((2, n, 3)), np.zeros((2, n, 3))
    for i, side in enumerate(FEET):
        sole = np.pad(sole_points(character, side), ((0, 0), (0, 1)))
        balls = foot_balls(character, side)
        shift[i, :kept] = shown.ankles[i] - played.ankles[i, :kept]
        turn[i, :kept] = rotations.to_rotation_vector(
            rotations.multiply(shown.feet[i], rotations.conjugate(played.feet[i, :kept]))
        )
        ground = np.zeros(n) if composed.ground is None else composed.ground[:, i]
        bound = np.minimum(ground, lowest_points(source, i, balls))
        contact = np.array(composed.contacts[:, i], dtype=bool)
        correct_kernel(
            kernel.Track(played.ankles[i], played.feet[i]),
            kernel.Track(source.ankles[i], source.feet[i]),
            kernel.FootDemands(contact, jump, weight, bound),
            kernel.FootShape(sole, balls),
            kernel.Leg(played.hips[i], reach[i]),
            kept,
            times,
            limits,
            kernel.Correction(shift[i], turn[i]),
        )
    return shift, turn


def _frames(seconds: float, fps: float) -> int:
    return max(1, round(seconds * fps))


def _weights(jumps: npt.NDArray[np.int64], n: int, blend: int) -> FloatArray:
    """How much each frame counts for where a stance is put: little during a blend (n,)."""
    frames = np.arange(n)
    before = np.searchsorted(jumps, frames, side="right") - 1
    weight = np.ones(n)
    inside = before >= 0
    since = frames[inside] - jumps[before[inside]]
    weight[inside] = rotations.ease(since / blend) ** 2 + _LEAST_WEIGHT
    return weight


def _reach(character: Character, played: FootTracks) -> FloatArray:
    """How far an ankle may be from its hip (2, frames) [m]."""
    reach = np.empty(played.hips.shape[:2])
    for i, side in enumerate(FEET):
        bones = [character.offsets[character.body(f"{side}_{x}")] for x in ("shank", "foot")]
        longest = _STRAIGHT * sum(float(np.linalg.norm(bone)) for bone in bones)
        reach[i] = np.maximum(longest, _length(played.hips[i] - played.ankles[i]))
    return reach


def _root_drop(
    played: FootTracks, reach: FloatArray, ankles: FloatArray, fps: float, max_root_drop: float
) -> FloatArray:
    """How far the root is lowered so that legs reach (frames,) [m].

    Ankles (2, frames, 3) that are then still out of reach are drawn in, in place.
    """
    need = np.zeros(ankles.shape[1])
    for i in range(len(FEET)):
        to_hip = played.hips[i] - ankles[i]
        level = np.sum(to_hip[:, :2] ** 2, axis=1)
        down = to_hip[:, 2] - np.sqrt(np.maximum(reach[i] ** 2 - level, 0))
        need = np.where(_length(to_hip) > reach[i] + _NOTHING, np.maximum(need, down), need)
    if not need.any():
        return need
    drop = smoothing.cover(np.minimum(need, max_root_drop), _frames(ROOT_S, fps))
    for i in range(len(FEET)):
        to_ankle = ankles[i] - played.hips[i]
        to_ankle[:, 2] += drop
        across = np.sqrt(np.maximum(reach[i] ** 2 - to_ankle[:, 2] ** 2, 0.0))
        short = np.flatnonzero(_length(to_ankle) > reach[i] + _NOTHING)
        part = across[short] / np.maximum(_length(to_ankle[short, :2]), 1e-12)
        ankles[i, short, :2] += (np.minimum(part, 1.0) - 1.0)[:, None] * to_ankle[short, :2]
    return drop


def _length(vectors: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(vectors, axis=-1)
    return lengths
