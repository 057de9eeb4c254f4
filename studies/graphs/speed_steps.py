"""How suddenly a motion changes its speed: at the jumps of a walk, and in the recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import compose
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.response.response_quality import joint_speed_steps

COLUMNS = ("joint", "root", "turn")
"""Quantities: the joint whose speed changes most, the root, and the root's turning."""
UNITS = ("rad_s", "m_s", "rad_s")
QUANTILE = 99.9
"""Percentile of the recorded speed steps that jumps are compared with."""


def speed_steps(motion: Motion) -> FloatArray:
    """Changes of velocity at the frames 1 to n - 2 of a motion, (n - 2, 3); see `COLUMNS`."""
    velocities = np.diff(motion.root_positions, axis=0) * motion.fps
    q = motion.root_quaternions
    turns = rotations.to_rotation_vector(rotations.multiply(rotations.conjugate(q[:-1]), q[1:]))
    changes = [np.diff(rows, axis=0) for rows in (velocities, turns * motion.fps)]
    root, turn = (np.linalg.norm(rows, axis=1) for rows in changes)
    return np.column_stack([joint_speed_steps(motion).max(axis=1), root, turn])


def source_limits(graph: MotionGraph) -> FloatArray:
    """(3,) percentiles of the speed steps of the recordings; see `COLUMNS`."""
    clips = [graph.database.motion(clip) for clip in range(len(graph.database.clips))]
    return _percentiles(clips)


def source_limits_at(graph: MotionGraph, character: Character, fps: float) -> FloatArray:
    """The same for the recordings, played at another frame rate."""
    clips = []
    for clip in graph.database.clips:
        if clip.stop - clip.start > 1:
            frames = np.arange(clip.start, clip.stop)
            poses = compose(graph, character, frames, fps=fps).unfitted
            clips.append(Motion(poses, fps, clip.name))
    return _percentiles(clips)


def at_jumps(motion: Motion, jumps: npt.NDArray[np.intp], rate: float = 1.0) -> FloatArray:
    """Speed steps (k, 3) from the frames that jumps leave to those that they enter.

    Args:
        motion: The motion.
        jumps: (j,) frames of the walk that are reached by a jump.
        rate: Frames of the motion for one of the walk.
    """
    steps = speed_steps(motion)
    left = np.floor((jumps - 1) * rate).astype(np.intp)
    rows = [left + k - 1 for k in range(math.ceil(rate) + 1)]
    near = np.concatenate(rows)
    return steps[near[(near >= 0) & (near < len(steps))]]


def _percentiles(clips: Sequence[Motion]) -> FloatArray:
    steps = np.concatenate([speed_steps(clip) for clip in clips if len(clip) > 2])
    limits: FloatArray = np.percentile(steps, QUANTILE, axis=0)
    return limits
