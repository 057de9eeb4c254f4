"""Poses and motions that the tests make themselves."""

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Label, Motion
from dynresp.motion.rotations import FloatArray


def random_quaternions(rng: np.random.Generator, *shape: int) -> FloatArray:
    """Uniformly distributed rotations (*shape, 4)."""
    return rotations.normalize(rng.normal(size=(*shape, 4)))


def random_poses(rng: np.random.Generator, frames: int) -> FloatArray:
    """Poses (frames, 59) with every joint turned anyhow."""
    return np.concatenate(
        [rng.normal(size=(frames, 3)), random_quaternions(rng, frames, 14).reshape(frames, -1)],
        axis=1,
    )


def smooth_motion(
    rng: np.random.Generator, frames: int = 40, fps: float = 30.0, speed: float = 2.0
) -> Motion:
    """A motion whose joints turn at up to about `speed` [rad/s], with contacts and labels."""
    turns = rotations.from_rotation_vector(rng.normal(size=(frames, 14, 3)) * speed / fps)
    quaternions = random_quaternions(rng, 1, 14).repeat(frames, axis=0)
    for k in range(1, frames):
        quaternions[k] = rotations.multiply(quaternions[k - 1], turns[k])
    root = np.cumsum(rng.normal(size=(frames, 3)) / fps, axis=0)
    root[:, 2] += 1.0
    return Motion(
        np.concatenate([root, quaternions.reshape(frames, -1)], axis=1),
        fps,
        "smooth",
        rng.random((frames, 2)) > 0.5,
        (Label("all", 0, frames), Label("middle", frames // 4, frames // 2)),
    )


def bend_knees(character: Character, poses: FloatArray, flexion: FloatArray) -> FloatArray:
    """Poses whose knees are hinges, bent by flexion (frames, 2) [rad], positive backward shank."""
    bent = poses.copy()
    for i, side in enumerate(("left", "right")):
        column = 7 + 4 * character.joint(f"{side}_knee")
        bent[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), flexion[:, i])
    return bent
