"""Playing a walk, frame by frame with SciPy's rotations: the slow twin of `blending_kernel`."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dynresp.locomotion.graph.config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray


def play(graph: MotionGraph, start: int, frames: list[int]) -> FloatArray:
    """Poses (k, 59) of frames played after a start that is played as recorded at the origin."""
    database, config = graph.database, graph.config
    turn, shift = Rotation.identity(), np.zeros(3)
    offset, rate, age = np.zeros(45), np.zeros(45), config.blend_s
    played, before = [], start
    for frame in frames:
        if frame != database.successors[before]:
            now, its_rate = decayed(offset, rate, age, config)
            root, angles = placed(database.poses[before], turn, shift)
            pose_root = root + now[:3]
            pose_turns = angles * Rotation.from_rotvec(now[3:].reshape(14, 3))
            v = database.velocities[before].copy()
            v[:3] = turn.apply(v[:3])
            velocity = v + its_rate
            x, y, z, yaw = graph.placement_between([before], [frame])[0]
            shift = shift + turn.apply([x, y, z])
            turn = turn * Rotation.from_euler("z", yaw)
            root, angles = placed(database.poses[frame - 1], turn, shift)
            u = database.velocities[frame - 1].copy()
            u[:3] = turn.apply(u[:3])
            offset = np.concatenate(
                [pose_root - root, (angles.inv() * pose_turns).as_rotvec().ravel()]
            )
            rate, age = velocity - u, 0.0
        age += 1.0 / database.fps
        now, _ = decayed(offset, rate, age, config)
        root, angles = placed(database.poses[frame], turn, shift)
        shown = angles * Rotation.from_rotvec(now[3:].reshape(14, 3))
        played.append(np.concatenate([root + now[:3], shown.as_quat(scalar_first=True).ravel()]))
        before = frame
    return np.array(played)


def placed(pose: FloatArray, turn: Any, shift: FloatArray) -> tuple[FloatArray, Any]:
    """Root position, and the rotations of root and joints."""
    pose = pose.copy()  # SciPy does not take read-only arrays
    turns = Rotation.from_quat(pose[3:].reshape(14, 4), scalar_first=True)
    first = turn * turns[0]
    return turn.apply(pose[:3]) + shift, Rotation.concatenate([first, turns[1:]])


def decayed(
    offset: FloatArray, rate: FloatArray, age: float, config: GraphConfig
) -> tuple[FloatArray, FloatArray]:
    """What is left of a displacement and its rate: a cubic each, at rest in the end."""
    of_root = np.where(np.arange(45) < 6, rate, 0.0)
    slower = min(2.0 * config.blend_rate_s, config.blend_s)
    left, its_slope = cubic(offset, np.zeros(45), age, config.blend_s)
    root, its_rate = cubic(np.zeros(45), of_root, age, slower)
    joints, their_rate = cubic(np.zeros(45), rate - of_root, age, config.blend_rate_s)
    return left + root + joints, its_slope + its_rate + their_rate


def cubic(
    value: FloatArray, slope: FloatArray, t: float, end: float
) -> tuple[FloatArray, FloatArray]:
    """Value and slope at t of the cubic that begins with a value and a slope, and ends at rest."""
    if t >= end:
        return np.zeros(45), np.zeros(45)
    # a t^3 + b t^2 + slope t + value, solved for its end.
    system = np.array([[end**3, end**2], [3 * end**2, 2 * end]])
    a, b = np.linalg.solve(system, np.stack([-value - slope * end, -slope]))
    return ((a * t + b) * t + slope) * t + value, (3 * a * t + 2 * b) * t + slope
