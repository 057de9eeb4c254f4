"""Playing a walk, frame by frame with SciPy's rotations: the slow twin of `blending_kernel`."""

from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray


def play(graph: MotionGraph, start: int, frames: list[int]) -> tuple[FloatArray, FloatArray]:
    """Frames played after a start that is played as recorded at the origin.

    Returns:
        Poses (k, 59), and how they move (k, 45), by finite differences.
    """
    database, config = graph.database, graph.config
    turn, shift = Rotation.identity(), np.zeros(3)
    offset, rate, age = np.zeros(45), np.zeros(45), config.blend_s
    played, moving, before = [], [], start
    for frame in frames:
        if frame != database.successors[before]:
            now, its_rate = decayed(offset, rate, age, config)
            poses = np.array(database.poses[before]), np.array(database.poses[frame - 1])
            speeds = database.velocities[before], database.velocities[frame - 1]
            pose = displaced(poses[0], turn, shift, now)
            velocity = speed(poses[0], speeds[0], turn, shift, now, its_rate)
            turn, shift = laid_over(poses[1], poses[0], turn, shift, config)
            there = displaced(poses[1], turn, shift, np.zeros(45))
            offset = np.concatenate(
                [pose[:3] - there[:3], (turns_of(there).inv() * turns_of(pose)).as_rotvec().ravel()]
            )
            # What the rate adds to the velocity is linear in it: one component at a time.
            none = speed(poses[1], speeds[1], turn, shift, offset, np.zeros(45))
            adds = np.array(
                [speed(poses[1], speeds[1], turn, shift, offset, one) - none for one in np.eye(45)]
            )
            rate, age = np.linalg.solve(adds.T, velocity - none), 0.0
        age += 1.0 / database.fps
        now, its_rate = decayed(offset, rate, age, config)
        played.append(displaced(database.poses[frame], turn, shift, now))
        recorded = database.velocities[frame]
        moving.append(speed(database.poses[frame], recorded, turn, shift, now, its_rate))
        before = frame
    return np.array(played), np.array(moving)


def laid_over(
    matched: FloatArray, left: FloatArray, turn: Any, shift: FloatArray, config: GraphConfig
) -> tuple[Any, FloatArray]:
    """Where a clip is put so that one of its poses is laid over another clip's.

    Args:
        matched: (59,) the pose, in its clip's world.
        left: (59,) the other clip's, in its own world.
        turn: How that clip is turned.
        shift: And where it is put then.
        config: Says the coordinates; fixed or relative ones.
    """
    if config.coordinates is Coordinates.FIXED:
        return turn, shift
    there, own = facing(left), facing(matched)
    turned = turn * there * own.inv()
    at = turn.apply(left[:3]) + shift - turned.apply(matched[:3])
    return turned, np.array([at[0], at[1], shift[2]])


def facing(pose: FloatArray) -> Any:
    """The turn about the vertical that comes nearest to a pose's root orientation, by search."""
    root = Rotation.from_quat(np.array(pose[3:7]), scalar_first=True)

    def away(yaw: float) -> float:
        return float((Rotation.from_euler("z", yaw).inv() * root).magnitude())

    first = min(np.linspace(-np.pi, np.pi, 25), key=away)
    best = minimize_scalar(away, (first - 0.3, first, first + 0.3), tol=1e-14)
    return Rotation.from_euler("z", best.x)


def turns_of(pose: FloatArray) -> Any:
    """The rotations of root and joints."""
    return Rotation.from_quat(pose[3:].reshape(14, 4).copy(), scalar_first=True)


def displaced(pose: FloatArray, turn: Any, shift: FloatArray, offset: FloatArray) -> FloatArray:
    """A pose (59,) placed, then displaced: the root [m], then rotation vectors."""
    root, angles = placed(pose, turn, shift)
    shown = angles * Rotation.from_rotvec(offset[3:].reshape(14, 3))
    return np.concatenate([root + offset[:3], shown.as_quat(scalar_first=True).ravel()])


def speed(
    pose: FloatArray,
    velocity: FloatArray,
    turn: Any,
    shift: FloatArray,
    offset: FloatArray,
    rate: FloatArray,
) -> FloatArray:
    """How a placed pose moves (45,) that is displaced, by differences over a very short time."""
    short = 1e-4
    before, after = (
        displaced(moved(pose, velocity, t), turn, shift, offset + t * rate) for t in (-short, short)
    )
    turned = (turns_of(before).inv() * turns_of(after)).as_rotvec().ravel()
    return np.concatenate([after[:3] - before[:3], turned]) / (2.0 * short)


def moved(pose: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
    """A pose that has gone on with its velocity; rotations turn about axes of their own."""
    turned = turns_of(pose) * Rotation.from_rotvec(seconds * velocity[3:].reshape(14, 3))
    root = pose[:3] + seconds * velocity[:3]
    return np.concatenate([root, turned.as_quat(scalar_first=True).ravel()])


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
