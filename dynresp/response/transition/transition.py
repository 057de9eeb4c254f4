"""From the simulation back to motion capture: targets that lead there, and the blend.

Zordan et al. 2007, section 6: from the moment the reaction and its timing are known, the servos
track a blend of the motion before and the motion to come, and the simulated motion is brought onto
the reaction over a fixed length: the root by straight lines, rotations by slerp, with an
ease-in/ease-out weight in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class TransitionConfig:
    """How the way back is made.

    Attributes:
        blend_s: Length of the blend [s].
        second_pass: Simulate again from the contact on, tracking all the way towards the reaction
            that was found (Zordan et al. 2005); without, only from the exit on.
    """

    blend_s: float = 1.0 / 3.0
    second_pass: bool = False

    def __post_init__(self) -> None:
        """Check the length.

        Raises:
            UsageError: It is not positive.
        """
        if not (np.isfinite(self.blend_s) and self.blend_s > 0):
            raise UsageError(f"blend_s must be above 0, got {self.blend_s}")

    def blend_frames(self, fps: float) -> int:
        """Frames from the last that is wholly simulated to the first that is wholly reaction."""
        return max(1, round(self.blend_s * fps))


def place_on(reaction: FloatArray, entry: int, pose: FloatArray) -> FloatArray:
    """A reaction moved on the ground so that its entry frame stands and faces where a pose does.

    Args:
        reaction: (frames, 59).
        entry: The frame entered.
        pose: (59,) where the character is.

    Returns:
        (frames, 59): turned about the vertical and shifted on the ground alone, as in the search.
    """
    entered = reaction[entry]
    turn = float(rotations.yaw_of(pose[ROOT_QUAT]) - rotations.yaw_of(entered[ROOT_QUAT]))
    now = rotations.rotate(rotations.from_yaw(turn), entered[ROOT])
    return move_poses(reaction, turn, (pose[0] - now[0], pose[1] - now[1], 0.0))


def blended_targets(
    base: FloatArray, reaction: FloatArray, entry: int, start: int, end: int
) -> FloatArray:
    """What the servos track on the way from the base motion to the reaction.

    Args:
        base: (n, 59) the base motion, frame by frame from where the targets begin.
        reaction: (frames, 59); its frame `entry` is due at frame `start` of the targets' clock
            where that is not negative, and else its later frames are.
        entry: The frame of the reaction that is due at the exit.
        start: The exit, counted from where the targets begin.
        end: Where the targets are the reaction alone, likewise.

    Returns:
        (n, 59). The blend begins with the first target and ends at `end`.
    """
    at = np.clip(entry + np.arange(len(base)) - start, 0, len(reaction) - 1)
    return _blend(base, reaction[at], rotations.ease(np.arange(len(base)) / end))


def blend_onto(simulated: FloatArray, reaction: FloatArray) -> FloatArray:
    """The simulated motion brought onto the reaction.

    Args:
        simulated: (n + 1, 59) from the exit on.
        reaction: (n + 1, 59) from the entry on, placed.

    Returns:
        (n + 1, 59): the first pose is the simulated one, the last the reaction's.
    """
    weight = rotations.ease(np.arange(len(simulated)) / max(len(simulated) - 1, 1))
    return _blend(simulated, reaction, weight)


def _blend(a: FloatArray, b: FloatArray, weight: FloatArray) -> FloatArray:
    """Poses from a to b (frames, 59): the root by straight lines, rotations by slerp.

    Each rotation goes one way round, the shorter one at the first frame: where two motions turn
    apart by more than half a turn, slerp frame by frame would leap to the other way. Quaternions
    are continuous in sign.
    """
    out = np.empty_like(a)
    out[:, ROOT] = a[:, ROOT] + weight[:, None] * (b[:, ROOT] - a[:, ROOT])
    qa, qb = (rotations.make_continuous(x[:, 3:].reshape(len(a), -1, 4)) for x in (a, b))
    turn = rotations.make_continuous(rotations.multiply(rotations.conjugate(qa), qb))
    turn = np.where(turn[:1, :, :1] < 0, -turn, turn)
    sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    half_angle = np.arctan2(sine, turn[..., :1])
    # Half the angle over its sine, which is 1 at zero.
    scale = np.where(sine > 1e-9, half_angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    part = rotations.from_rotation_vector(2.0 * weight[:, None, None] * scale * turn[..., 1:])
    out[:, 3:] = rotations.make_continuous(rotations.multiply(qa, part)).reshape(len(a), -1)
    return out
