"""How fast all bodies move, from joint velocities: what `qvel` says in terms of bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.errors import MotionError
from dynresp.motion import rotations
from dynresp.motion.character import VELOCITY_SIZE, BodyStates, Character
from dynresp.motion.rotations import FloatArray


@dataclass(frozen=True)
class BodyVelocities:
    """Velocities of all bodies, frame by frame, in world axes.

    Attributes:
        centers: (frames, bodies, 3) of each body's centre of mass [m/s].
        angular: (frames, bodies, 3) of each body [rad/s].
    """

    centers: FloatArray
    angular: FloatArray


def body_velocities(
    character: Character, states: BodyStates, velocities: npt.ArrayLike
) -> BodyVelocities:
    """Velocities of all bodies from root to tips.

    A body turns as its parent does plus the rate of its own joint; its joint moves as that point
    of the parent does.

    Args:
        character: The character.
        states: Where its bodies are (`Character.kinematics`).
        velocities: (frames, 45) rows of `qvel`, as many as the states have frames.

    Raises:
        MotionError: The velocities have another shape.
    """
    rates = np.asarray(velocities, dtype=np.float64)
    frames, bodies = states.positions.shape[:2]
    if rates.shape != (frames, VELOCITY_SIZE):
        raise MotionError(
            f"velocities must have the shape ({frames}, {VELOCITY_SIZE}), got {rates.shape}"
        )
    joints = rates[:, 3:].reshape(frames, bodies, 3)
    # Root and joints alike: rates are told in the frame of the body itself.
    angular = rotations.rotate(states.quaternions, joints)
    origins = np.empty((frames, bodies, 3))
    origins[:, 0] = rates[:, :3]
    for body in range(1, bodies):
        parent = character.parents[body]
        angular[:, body] += angular[:, parent]
        arm = states.positions[:, body] - states.positions[:, parent]
        origins[:, body] = origins[:, parent] + _cross(angular[:, parent], arm)
    centers = origins + _cross(angular, states.centers - states.positions)
    return BodyVelocities(centers, angular)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product (..., 3), written out: np.cross costs five times as much."""
    out = np.empty_like(a)
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
