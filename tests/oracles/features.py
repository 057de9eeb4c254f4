"""Slow, readable twin of the features: one hit, one slice, one body at a time, by matrices."""

import numpy as np

from dynresp.motion.character import Character
from tests.oracles import quaternions
from tests.oracles.kinematics import Array, body_frames

BODIES = ("pelvis", "abdomen", "chest", "head", "left_foot", "right_foot")


def slices(character: Character, poses: Array, velocities: Array, frames: list[int]) -> Array:
    """Features of one hit: poses (frames, 59) and velocities (frames, 45) from contact on."""
    yaw = quaternions.facing(poses[0, 3:7])
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    ground = poses[0, :3] * [1, 1, 0]
    numbers: list[float] = []
    for frame in frames:
        _, matrices, centers = body_frames(character, poses[frame])
        speeds, rates = _speeds(character, poses[frame], velocities[frame])
        for name in BODIES:
            body = character.body(name)
            numbers += list(turn @ (centers[body] - ground))
            numbers += list(_rotation_vector(turn @ matrices[body]))
            numbers += list(turn @ speeds[body])
            numbers += list(turn @ rates[body])
        share = character.masses / character.masses.sum()
        numbers += list(turn @ (share @ centers - ground))
        numbers += list(turn @ (share @ speeds))
    return np.array(numbers)


def _speeds(character: Character, pose: Array, rates: Array) -> tuple[Array, Array]:
    """Velocities of centres of mass and angular velocities (14, 3), root to tip."""
    origins, matrices, centers = body_frames(character, pose)
    angular, linear = np.zeros((14, 3)), np.zeros((14, 3))
    for body in range(14):
        own = matrices[body] @ rates[3 + 3 * body : 6 + 3 * body]
        parent = int(character.parents[body])
        if parent < 0:
            angular[body], linear[body] = own, rates[:3]
        else:
            angular[body] = angular[parent] + own
            arm = origins[body] - origins[parent]
            linear[body] = linear[parent] + np.cross(angular[parent], arm)
    return linear + np.cross(angular, centers - origins), angular


def _rotation_vector(matrix: Array) -> Array:
    """Axis times angle of a rotation matrix whose angle is below half a turn."""
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    axis = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    return axis * (angle / (2 * np.sin(angle)) if angle > 1e-7 else 0.5)
