"""Small databases of made frames, for tests of the motion graph."""

import numpy as np

from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.motion import rotations
from dynresp.motion.character import POSE_SIZE
from dynresp.motion.rotations import FloatArray


def wandering_poses(rng: np.random.Generator, frames: int, spread: float = 0.3) -> FloatArray:
    """(frames, 59) a root that wanders, and joints that sway; signs of quaternions at random."""
    poses = np.empty((frames, POSE_SIZE))
    time = np.arange(frames)[:, None]
    poses[:, :3] = np.cumsum(rng.normal(0.0, 0.05, (frames, 3)), axis=0) + rng.normal(0, 1, 3)
    sway = sum(
        rng.normal(0.0, spread, (1, 14, 3)) * np.sin(0.3 * k * time + rng.uniform(0, 6))[:, None]
        for k in (1, 2)
    )
    quaternions = rotations.from_rotation_vector(sway)
    yaw = rng.uniform(-3, 3) + np.cumsum(rng.normal(0, 0.1, frames))
    quaternions[:, 0] = rotations.multiply(rotations.from_yaw(yaw), quaternions[:, 0])
    signs = rng.choice([-1.0, 1.0], size=(frames, 14, 1))
    poses[:, 3:] = (signs * quaternions).reshape(frames, -1)
    return poses


def made_database(
    rng: np.random.Generator, lengths: tuple[int, ...], alike: float = 0.05, columns: int = 2
) -> MotionDatabase:
    """Clips that are noisy copies of each other, with contacts that come and go.

    Args:
        rng: Where chance comes from.
        lengths: Frames of each clip.
        alike: How far clips sway from each other [rad].
        columns: Of contacts, 2 or 4.
    """
    base = wandering_poses(rng, max(lengths))
    poses, contacts, clips, at = [], [], [], 0
    for index, length in enumerate(lengths):
        own = base[:length].copy()
        noise = rng.normal(0.0, alike, (length, 14, 3))
        turned = rotations.multiply(
            own[:, 3:].reshape(length, 14, 4), rotations.from_rotation_vector(noise)
        )
        own[:, 3:] = turned.reshape(length, -1)
        own[:, :2] += rng.normal(0.0, 0.1, 2)
        poses.append(own)
        # Runs of a few frames.
        contacts.append(np.repeat(rng.random((length, columns)) < 0.5, 3, axis=0)[:length])
        clips.append(Clip(f"clip {index}", at, at + length, str(index)))
        at += length
    return MotionDatabase(np.concatenate(poses), np.concatenate(contacts), 15.0, tuple(clips), "")
