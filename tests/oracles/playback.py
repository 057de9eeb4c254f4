"""Playing a walk, frame by frame with SciPy's rotations: the slow twin of `blending_kernel`."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dynresp.locomotion.graph import MotionGraph
from dynresp.motion.rotations import FloatArray


def play(graph: MotionGraph, start: int, frames: list[int]) -> FloatArray:
    """Poses (k, 59) of frames played after a start that is played as recorded at the origin."""
    database, blend_s = graph.database, graph.config.blend_s
    turn, shift = Rotation.identity(), np.zeros(3)
    offset, rate, age = np.zeros(45), np.zeros(45), blend_s
    played, before = [], start
    for frame in frames:
        if frame != database.successors[before]:
            now, its_rate = decayed(offset, rate, age, blend_s)
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
        now, _ = decayed(offset, rate, age, blend_s)
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
    offset: FloatArray, rate: FloatArray, age: float, blend_s: float
) -> tuple[FloatArray, FloatArray]:
    """The cubic that has a value and a slope at 0 and is at rest at `blend_s`, and its slope."""
    if age >= blend_s:
        return np.zeros(45), np.zeros(45)
    t, b = age, blend_s
    # a t^3 + b t^2 + rate t + offset, solved for its end.
    system = np.array([[b**3, b**2], [3 * b**2, 2 * b]])
    cubic, square = np.linalg.solve(system, np.stack([-offset - rate * b, -rate]))
    value = ((cubic * t + square) * t + rate) * t + offset
    return value, (3 * cubic * t + 2 * square) * t + rate
