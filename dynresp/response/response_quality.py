"""Quality metrics of a response; `docs/quality.md` explains each.

All are computed from the finished motion at its own frame rate (30 fps). Only the root's jump also
needs the poses that simulation and reaction would have at the seams.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.ground import clearances
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.response.response import Response

# A motion that stands still has hardly any joint speed steps; a seam is then compared with this
# [rad/s], about the sway of a standing person.
_LEAST_REFERENCE = 0.1
# The percentile of joint speed steps in the entered motion with which a seam is compared.
_PERCENTILE = 99.9


@dataclass(frozen=True)
class Quality:
    """Quality metrics of one response.

    The seams are the two ends of the blend: exit and end.

    Attributes:
        speed_step_exit: Largest joint speed step at the exit [rad/s].
        speed_step_end: The same at the end of the blend [rad/s].
        speed_step_reference: 99.9th percentile of the joint speed steps in the entered motion,
            at least 0.1 rad/s.
        speed_step_ratio: The larger of the two steps divided by the reference.
        root_jump_m: Distance of the root, one frame inside a seam, from where the simulation (at
            the exit) or the placed reaction (at the end) has it; the larger one [m].
        root_jump_deg: The same for its orientation [degrees].
        root_shake_m: How unsteady the root's own step is at a seam, for any reason: a hit that
            still shakes the body counts, too [m].
        root_shake_deg: The same for its orientation [degrees].
        foot_skate_m: Distance that standing feet slide after contact, sum of both feet [m].
        foot_skate_worst_m: Largest distance that one foot slides in one stance [m].
        foot_skate_blend_m: Distance that standing feet slide in the blend, sum of both feet [m].
        foot_depth_m: How deep a foot gets into the ground after contact [m].
        body_depth_m: How deep any other body gets [m].
        free_physics_s: Time from contact to the exit [s].
        physics_s: Time from contact to the end of the blend [s].
    """

    speed_step_exit: float
    speed_step_end: float
    speed_step_reference: float
    speed_step_ratio: float
    root_jump_m: float
    root_jump_deg: float
    root_shake_m: float
    root_shake_deg: float
    foot_skate_m: float
    foot_skate_worst_m: float
    foot_skate_blend_m: float
    foot_depth_m: float
    body_depth_m: float
    free_physics_s: float
    physics_s: float


def measure(response: Response, character: Character) -> Quality | None:
    """Compute the metrics; None where nothing was hit or the simulation diverged."""
    if response.exit is None or response.end is None or response.contact_frame is None:
        return None
    assert response.entered_motion is not None
    motion = response.motion
    steps = joint_speed_steps(motion)
    at_seams = [float(steps[k - 1].max()) for k in (response.exit, response.end)]
    recorded = joint_speed_steps(response.entered_motion)
    reference = float(np.percentile(recorded, _PERCENTILE)) if recorded.size else 0.0
    reference = max(reference, _LEAST_REFERENCE)
    assert response.simulated_after_exit is not None
    assert response.placed_before_end is not None
    jumps = [
        _root_distance(motion.poses[response.exit + 1], response.simulated_after_exit),
        _root_distance(motion.poses[response.end - 1], response.placed_before_end),
    ]
    # The first step of the blend, and the last.
    shakes = [root_shake(motion, k) for k in (response.exit, response.end - 1)]
    after = motion.slice(response.contact_frame, len(motion))
    states = character.kinematics(after.poses)
    depth = np.maximum(0.0, -clearances(character, states))
    feet = [character.body(f"{side}_foot") for side in FEET]
    skates = stance_slides(after, character)
    blend = motion.slice(response.exit, response.end + 1)
    return Quality(
        speed_step_exit=at_seams[0],
        speed_step_end=at_seams[1],
        speed_step_reference=reference,
        speed_step_ratio=max(at_seams) / reference,
        root_jump_m=max(jump[0] for jump in jumps),
        root_jump_deg=max(jump[1] for jump in jumps),
        root_shake_m=max(shake[0] for shake in shakes),
        root_shake_deg=max(shake[1] for shake in shakes),
        foot_skate_m=float(sum(skates)),
        foot_skate_worst_m=float(max(skates, default=0.0)),
        foot_skate_blend_m=float(sum(stance_slides(blend, character))),
        foot_depth_m=float(depth[:, feet].max()),
        body_depth_m=float(np.delete(depth, feet, axis=1).max()),
        free_physics_s=(response.exit - response.contact_frame) / motion.fps,
        physics_s=(response.end - response.contact_frame) / motion.fps,
    )


def joint_speed_steps(motion: Motion) -> FloatArray:
    """Change of each joint's angular velocity from one frame step to the next.

    Returns:
        (frames - 2, 13) [rad/s]; row k is the change at frame k + 1. Velocities are vectors, so a
        change of axis at the same speed counts.
    """
    q = motion.joint_quaternions
    turns = rotations.to_rotation_vector(rotations.multiply(rotations.conjugate(q[:-1]), q[1:]))
    return np.linalg.norm(np.diff(turns, axis=0), axis=-1) * motion.fps


def _root_distance(pose: FloatArray, other: FloatArray) -> tuple[float, float]:
    """Distance [m] and angle [degrees] between the roots of two poses."""
    angle = rotations.angle_between(pose[ROOT_QUAT], other[ROOT_QUAT])
    return float(np.linalg.norm(pose[ROOT] - other[ROOT])), float(np.degrees(angle))


def root_shake(motion: Motion, frame: int) -> tuple[float, float]:
    """How unsteady the root's step is from a frame to the next, apart from smooth movement.

    It is the difference of the step from the mean of the steps before and after it. A movement of
    constant acceleration has none; a shift between the two frames gives the size of that shift.

    Args:
        motion: Any motion.
        frame: The frame before the step; there must be one frame before it and two after.

    Returns:
        Position [m] and orientation [degrees].
    """
    near = motion.slice(frame - 1, frame + 3)
    q = near.root_quaternions
    turns = rotations.to_rotation_vector(rotations.multiply(q[1:], rotations.conjugate(q[:-1])))
    found = [
        float(np.linalg.norm(step - 0.5 * (before + after)))
        for before, step, after in (np.diff(near.root_positions, axis=0), turns)
    ]
    return found[0], float(np.degrees(found[1]))
