"""Feet that do not slide: constraint-based fitting of a composed motion (Lee et al. 2002, 4.1.1).

A motion that is composed of stretches of others, and blended where it passes from one to the next,
slides its feet. Here each stance of a foot becomes one without slip: the foot rolls and pivots as
in its source, and whatever way its sole's stillest point would go is taken away
(`dynresp.motion.feet.skating`). What is free then is where the stance is put, which follows the
paper's four cases:

1. Begun before a blend, ended in it: where the motion before has it.
2. Begun in a blend, ended after it: where the motion after has it. The frames of a stance count the
   more, the less of a blend is left in them.
3. All in a blend: where what is played departs least from it. (The paper takes the closer of the
   two motions; the blend lies between them.)
4. Over the whole blend: between the two motions' places, and what departs from the motion after
   goes in the next swing. A graph may drop such transitions (`contact_cases`).

A stance over which several blends lie, one after the other, is dragged the farthest. It is moved
from the place told above to where the leg reaches it in all of its first `FitConfig.stance_s`.

In the swing between two stances the correction fades from the one's to the other's, without a leap
in velocity. Then hip, knee and ankle follow by two-bone inverse kinematics
(`dynresp.motion.feet.legs`), and where a leg is too short the root is lowered, smoothly.

A motion that is produced piece by piece is fitted so: give the frames already shown as `fitted`,
then the frames due, then as many to come as are planned, at least `FitConfig.look_ahead` for the
same feet as if all were fitted at once; show the frames due, and drop the rest.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

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
from dynresp.support.errors import MotionError, UsageError

# Frames that are bent at a time, which saves memory.
_BLOCK = 8192
# A frame in the middle of a blend still tells a little where a stance is put.
_LEAST_WEIGHT = 1e-3
# Corrections below this are rounding [m, rad].
_NOTHING = 1e-9


@dataclass(frozen=True)
class FitConfig:
    """How feet are fitted.

    Attributes:
        stance_s: As much of a stance as tells where it is put [s].
        ease_s: Time over which a correction fades in a swing, at most [s].
        still_s: Time in which a foot comes to rest that slides in the frames already shown [s].
        fastest: A correction changes by at most this [m/s] from stance to stance; where a swing is
            too short for it, the next stance is put nearer to the last.
        quickest: The same of its turn [rad/s].
        hastiest: By so much a correction may change where the leg would not reach the next stance
            otherwise [m/s].
        farthest: How far a standing foot is held from where it is played [m]; one that is dragged
            farther slides.
        root_s: Time over which the root is lowered, and raised again [s].
        deepest: How far the root is lowered at most [m]; a foot that is still too far away slides.
        straight: Part of its length to which a leg is stretched, unless it is played straighter: on
            the last few millimetres a knee turns by 10 degrees and more.
    """

    stance_s: float = 1.0
    ease_s: float = 0.5
    still_s: float = 0.1
    fastest: float = 0.5
    quickest: float = 2.0
    hastiest: float = 2.0
    farthest: float = 0.4
    root_s: float = 0.2
    deepest: float = 0.08
    straight: float = 0.99

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is not above 0, or `straight` is above 1; the message names it.
        """
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 < value < float("inf"):
                raise UsageError(f"{item.name} must be above 0, got {value}")
        if self.straight > 1.0:
            raise UsageError(f"straight must be at most 1, the whole leg, got {self.straight}")

    def fading(self, fps: float) -> int:
        """Frames after the last stance by which nothing is corrected any more, at most."""
        return _frames(self.ease_s, fps) + 4 * _frames(self.root_s, fps)

    def look_ahead(self, fps: float) -> int:
        """Frames to come on which a fitted frame depends, at most."""
        return self.fading(fps) + _frames(self.stance_s, fps)


@dataclass(frozen=True, eq=False)
class Composed:
    """A motion composed of others, as it is played before its feet are fitted.

    Attributes:
        poses: (n, 59) as played, blends included.
        source: (n, 59) for each frame the recorded pose it is made from, placed where it belongs,
            without what is blended into it; equal to `poses` outside blends.
        contacts: (n, 2) whether the left and the right foot are to stand.
        jumps: Frames at which the source changes, ascending; the first of the source entered. One
            below 0 was that many frames before this piece and may be blending still.
        fps: Frame rate [1/s].
        blend_s: How long a jump is blended [s].
        fitted: (m, 59) the first m frames as they have been shown; None for none. Two or more let
            velocities go on.
        ground: (n, 2) height of the ground under each foot [m]; None for 0.

    Raises:
        MotionError: The shapes do not fit each other, or a number is out of bounds.
    """

    poses: FloatArray
    source: FloatArray
    contacts: npt.NDArray[np.bool_]
    jumps: npt.ArrayLike
    fps: float
    blend_s: float
    fitted: FloatArray | None = None
    ground: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check what fits what."""
        n = len(as_poses(self.poses))
        if len(as_poses(self.source)) != n:
            raise MotionError(f"source must have {n} frames as poses, got {len(self.source)}")
        if np.shape(self.contacts) != (n, 2):
            raise MotionError(f"contacts must be ({n}, 2), got {np.shape(self.contacts)}")
        if self.ground is not None and np.shape(self.ground) != (n, 2):
            raise MotionError(f"ground must be ({n}, 2), got {np.shape(self.ground)}")
        if self.fitted is not None and len(as_poses(self.fitted)) > n:
            raise MotionError(f"fitted must have at most {n} frames, got {len(self.fitted)}")
        if not (self.fps > 0.0 and self.blend_s > 0.0):
            raise MotionError(f"fps and blend_s must be above 0, got {self.fps}, {self.blend_s}")
        jumps = np.asarray(self.jumps, dtype=np.int64)
        if jumps.ndim != 1 or np.any(np.diff(jumps) <= 0) or np.any(jumps >= n):
            raise MotionError(f"jumps must be frames below {n}, ascending, got {jumps}")


def fit_feet(
    character: Character, composed: Composed, config: FitConfig | None = None
) -> FloatArray:
    """Poses whose standing feet do not slide.

    Args:
        character: The character.
        composed: The motion.
        config: How.

    Returns:
        (n, 59): `composed.fitted`, then the fitted frames. Frames in which nothing is to be
        corrected are those of `composed.poses`, bit for bit.
    """
    from dynresp.motion.feet.foot_fitting_kernel import correct_kernel

    config = config or FitConfig()
    poses = as_poses(composed.poses)
    n, fps = len(poses), composed.fps
    played = foot_tracks(character, poses)
    source = foot_tracks(character, as_poses(composed.source))
    fitted = np.empty((0, poses.shape[1])) if composed.fitted is None else composed.fitted
    kept = len(fitted)
    shown = foot_tracks(character, fitted)
    blend = max(1, round(composed.blend_s * fps))
    jumps = np.asarray(composed.jumps, dtype=np.int64)
    jump = np.zeros(n, dtype=bool)
    jump[jumps[jumps >= 0]] = True
    weight = _weights(jumps, n, blend)
    counts = (_frames(config.stance_s, fps), blend, _frames(config.still_s, fps),
              _frames(config.ease_s, fps))  # fmt: skip
    limits = (TOUCH, config.fastest / fps, config.quickest / fps, config.farthest,
              config.hastiest / fps, config.deepest)  # fmt: skip
    reach = _reach(character, played, config)
    ankles, feet = played.ankles.copy(), played.feet.copy()
    changed = np.zeros(n, dtype=bool)
    for i, side in enumerate(FEET):
        sole = np.pad(sole_points(character, side), ((0, 0), (0, 1)))
        balls = foot_balls(character, side)
        shift, turn = np.zeros((n, 3)), np.zeros((n, 3))
        shift[:kept] = shown.ankles[i] - played.ankles[i, :kept]
        turn[:kept] = rotations.to_rotation_vector(
            rotations.multiply(shown.feet[i], rotations.conjugate(played.feet[i, :kept]))
        )
        ground = np.zeros(n) if composed.ground is None else composed.ground[:, i]
        bound = np.minimum(ground, lowest_points(source, i, balls))
        contact = np.ascontiguousarray(composed.contacts[:, i], dtype=bool)
        correct_kernel(
            (played.ankles[i], played.feet[i]), (source.ankles[i], source.feet[i]),
            contact, jump, weight, bound, sole, balls, kept,
            (np.ascontiguousarray(played.hips[i]), reach[i]), counts, limits, shift, turn,
        )  # fmt: skip
        corrected = (np.abs(shift) > _NOTHING).any(axis=1) | (np.abs(turn) > _NOTHING).any(axis=1)
        changed |= corrected
        ankles[i] += shift
        feet[i] = rotations.multiply(rotations.from_rotation_vector(turn), feet[i])
    drop = _lowering(played, reach, ankles, fps, config)
    if kept:
        behind = poses[kept - 1, 2] - fitted[-1, 2] - drop[kept - 1]
        away = np.arange(n) - (kept - 1)
        drop += behind * (1.0 - rotations.ease(away / (2 * _frames(config.root_s, fps))))
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


def _frames(seconds: float, fps: float) -> int:
    return max(1, round(seconds * fps))


def _weights(jumps: npt.NDArray[np.int64], n: int, blend: int) -> FloatArray:
    """How much each frame tells where a stance is put: little while a blend goes on (n,)."""
    frames = np.arange(n)
    before = np.searchsorted(jumps, frames, side="right") - 1
    weight = np.ones(n)
    inside = before >= 0
    since = frames[inside] - jumps[before[inside]]
    weight[inside] = rotations.ease(since / blend) ** 2 + _LEAST_WEIGHT
    return weight


def _reach(character: Character, played: FootTracks, config: FitConfig) -> FloatArray:
    """How far an ankle may be from its hip (2, frames) [m]."""
    reach = np.empty(played.hips.shape[:2])
    for i, side in enumerate(FEET):
        bones = [character.offsets[character.body(f"{side}_{x}")] for x in ("shank", "foot")]
        longest = config.straight * sum(float(np.linalg.norm(bone)) for bone in bones)
        reach[i] = np.maximum(longest, _length(played.hips[i] - played.ankles[i]))
    return reach


def _lowering(
    played: FootTracks, reach: FloatArray, ankles: FloatArray, fps: float, config: FitConfig
) -> FloatArray:
    """How far the root is lowered so that legs reach (frames,) [m].

    Ankles (2, frames, 3) that are then still out of reach are drawn in, in place.
    """
    need = np.zeros(ankles.shape[1])
    for i in range(len(FEET)):
        way = played.hips[i] - ankles[i]
        down = way[:, 2] - np.sqrt(np.maximum(reach[i] ** 2 - np.sum(way[:, :2] ** 2, axis=1), 0))
        need = np.where(_length(way) > reach[i] + _NOTHING, np.maximum(need, down), need)
    if not need.any():
        return need
    half = _frames(config.root_s, fps)
    lowered = smoothing.cover(np.minimum(need, config.deepest), half)
    for i in range(len(FEET)):
        way = ankles[i] - played.hips[i]
        way[:, 2] += lowered
        across = np.sqrt(np.maximum(reach[i] ** 2 - way[:, 2] ** 2, 0.0))
        short = np.flatnonzero(_length(way) > reach[i] + _NOTHING)
        part = across[short] / np.maximum(_length(way[short, :2]), 1e-12)
        ankles[i, short, :2] += (np.minimum(part, 1.0) - 1.0)[:, None] * way[short, :2]
    return lowered


def _length(vectors: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(vectors, axis=-1)
    return lengths
