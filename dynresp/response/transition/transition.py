"""The blend from the simulation to a recorded motion, and the servo targets that lead there.

Zordan et al. 2007, section 6: once the reaction and its timing are known, the servos track a blend
of the base motion and the reaction, and the simulated motion is blended onto the reaction over a
fixed time: the root along straight lines, rotations by slerp, with an ease-in/ease-out weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number


@dataclass(frozen=True)
class TransitionConfig:
    """Settings of the blend.

    Attributes:
        blend_s: Length of the blend [s], above 0.
        second_pass: Whether to simulate again from the contact on, with servos that track towards
            the chosen reaction (Zordan et al. 2005); else only from the exit on.
    """

    blend_s: float = 1.0 / 3.0
    second_pass: bool = False

    def __post_init__(self) -> None:
        """Check the length.

        Raises:
            UsageError: It is not positive.
        """
        check_number("blend_s", self.blend_s, 0.0, unit="s", above_low=True)

    def blend_frames(self, fps: float) -> int:
        """Number of frames from the exit, still simulated, to the first frame of reaction alone."""
        return max(1, round(self.blend_s * fps))


def place_on(reaction: FloatArray, entry: int, pose: FloatArray) -> FloatArray:
    """Move a reaction on the ground so that its entry frame stands and faces as a pose does.

    Args:
        reaction: (frames, 59) poses.
        entry: The frame of the reaction that is placed on the pose.
        pose: (59,) the pose of the character.

    Returns:
        (frames, 59) the poses, turned about the vertical and shifted on the ground only, as in the
        full search.
    """
    entered = reaction[entry]
    turn = float(rotations.yaw_of(pose[ROOT_QUAT]) - rotations.yaw_of(entered[ROOT_QUAT]))
    turned = rotations.rotate(rotations.from_yaw(turn), entered[ROOT])
    return move_poses(reaction, turn, (pose[0] - turned[0], pose[1] - turned[1], 0.0))


def blended_targets(
    base: FloatArray, reaction: FloatArray, entry: int, start: int, end: int
) -> FloatArray:
    """Servo targets that lead from the base motion to the reaction.

    Args:
        base: (n, 59) the base motion from the first target on.
        reaction: (frames, 59) poses; frame `entry` is due at target `start`.
        entry: The frame of the reaction that is due at the exit.
        start: The exit, counted in targets; negative if it is before the first target.
        end: The first target that is the reaction alone.

    Returns:
        (n, 59) targets; the blend begins with the first and ends at `end`.
    """
    at = np.clip(entry + np.arange(len(base)) - start, 0, len(reaction) - 1)
    return _blend(base, reaction[at], rotations.ease(np.arange(len(base)) / end))


def blend_onto(simulated: FloatArray, reaction: FloatArray) -> FloatArray:
    """Blend the simulated motion onto the reaction.

    Args:
        simulated: (n + 1, 59) simulated poses from the exit on.
        reaction: (n + 1, 59) poses of the reaction from the entry on, placed.

    Returns:
        (n + 1, 59) poses; the first is the simulated one, the last the reaction's.
    """
    weight = rotations.ease(np.arange(len(simulated)) / max(len(simulated) - 1, 1))
    return _blend(simulated, reaction, weight)


def _blend(a: FloatArray, b: FloatArray, weight: FloatArray) -> FloatArray:
    """Blend poses a to b (frames, 59): the root along straight lines, rotations by slerp.

    Each rotation keeps the direction that is shorter at the first frame. Slerp frame by frame would
    jump to the other direction where two motions differ by more than half a turn. Quaternions are
    continuous in sign.
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
