"""Slow twins of foot skating and fitting: plain loops, SciPy's rotations, and mink's solver."""

import math
from collections.abc import Sequence

import daqp  # noqa: F401  (the solver that mink must use)
import mink
import mujoco
import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray


def stillest_way(ways: FloatArray) -> FloatArray:
    """The shortest vector in the hull of ways (n, 2), by numerical minimisation over weights."""
    best = ways[np.argmin(np.linalg.norm(ways, axis=1))]
    scale = max(float(np.abs(ways).max()), 1e-12)
    found = (
        minimize(
            lambda w: float(np.sum((w @ ways / scale) ** 2)),
            np.full(len(ways), 1.0 / len(ways)),
            jac=lambda w: 2.0 * (ways / scale) @ (w @ ways / scale),
            bounds=[(0.0, 1.0)] * len(ways),
            constraints={"type": "eq", "fun": lambda w: w.sum() - 1.0},
            options={"ftol": 1e-16, "maxiter": 500},
        ).x
        @ ways
    )
    return min(best, found, key=np.linalg.norm)


def slide(
    before: tuple[FloatArray, Rotation],
    after: tuple[FloatArray, Rotation],
    sole: FloatArray,
    touch: float,
) -> FloatArray:
    """How a sole's stillest point moves over the ground (2,) [m].

    Args:
        before: The foot's place and orientation.
        after: The same a frame later.
        sole: (4, 3) its corners in the foot's frame.
        touch: How much higher than the lowest a corner that touches is at most [m].
    """
    a, b = (place + turned.apply(sole) for place, turned in (before, after))
    stands = a[:, 2] <= a[:, 2].min() + touch
    return stillest_way((b - a)[stands, :2])


def outside(point: Sequence[float] | FloatArray, discs: FloatArray) -> float:
    """How far a point is out of the one of discs (m, 3) that it is farthest out of [m]."""
    return max(math.hypot(point[0] - x, point[1] - y) - radius for x, y, radius in discs)


def least_outside(discs: FloatArray) -> float:
    """The least that any point is `outside` of discs (m, 3), by a grid that is made ever finer."""
    middle = discs[:, :2].mean(axis=0)
    best, size = (float(middle[0]), float(middle[1])), 1.0
    while size > 1e-5:
        steps = np.linspace(-size, size, 9)
        grid = [(best[0] + x, best[1] + y) for x in steps for y in steps]
        best = min(grid, key=lambda point: outside(point, discs))
        size *= 0.5
    return outside(best, discs)


def unslid(source: FloatArray, turns: Rotation, sole: FloatArray, touch: float) -> FloatArray:
    """Where a foot goes in a stance whose slide is taken away (frames, 2) [m].

    Args:
        source: (frames, 3) where its ankle is in the source, all frames of one stance.
        turns: Its orientations there.
        sole: (4, 3) corners of the sole.
        touch: See `slide`.
    """
    way = [source[0, :2]]
    for k in range(1, len(source)):
        off = slide((source[k - 1], turns[k - 1]), (source[k], turns[k]), sole, touch)
        way.append(way[-1] + (source[k] - source[k - 1])[:2] - off)
    return np.array(way)


def put(way: FloatArray, source: FloatArray, window: int) -> FloatArray:
    """A stance's way (frames, 2), shifted to be nearest to its source on the first frames' mean."""
    return way + np.mean(source[:window, :2] - way[:window], axis=0)


def hermite(a: float, slope_a: float, b: float, slope_b: float, u: float, frames: float) -> float:
    """The cubic between two values with given slopes a frame, at part u of so many frames."""
    return (
        (2 * u**3 - 3 * u**2 + 1) * a
        + (u**3 - 2 * u**2 + u) * frames * slope_a
        + (-2 * u**3 + 3 * u**2) * b
        + (u**3 - u**2) * frames * slope_b
    )


def place_feet(
    character: Character, pose: FloatArray, ankles: FloatArray, feet: FloatArray
) -> FloatArray:
    """A pose (59,) whose feet come to lie at ankles (2, 3), oriented like feet (2, 4), by mink.

    All but the legs stays; among the solutions it takes one near the pose.
    """
    model = character.model
    configuration = mink.Configuration(model, pose.copy())
    tasks: list[mink.Task] = []
    for side, place, turn in zip(("left", "right"), ankles, feet, strict=True):
        task = mink.FrameTask(f"{side}_foot", "body", 1.0, 1.0)
        task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3(turn), place))
        tasks.append(task)
    posture = mink.PostureTask(model, cost=1e-4)
    posture.set_target(pose)
    legs = [
        int(model.joint(f"{side}_{part}").dofadr[0]) + axis
        for side in ("left", "right")
        for part in ("hip", "knee", "ankle")
        for axis in range(3)
    ]
    still = mink.DofFreezingTask(model, [x for x in range(model.nv) if x not in legs])
    for _ in range(60):
        velocity = mink.solve_ik(
            configuration, [*tasks, posture], 1.0, "daqp", damping=1e-6, limits=[],
            constraints=[still],
        )  # fmt: skip
        configuration.integrate_inplace(velocity, 1.0)
        if float(np.abs(velocity).max()) < 1e-6:
            break
    return np.array(configuration.q)


def knee_flexion(character: Character, pose: FloatArray, side: str) -> float:
    """Angle at a knee [rad], 0 where the leg is straight, from MuJoCo's own kinematics."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(character.model, data)
    hip, knee, ankle = (data.body(f"{side}_{x}").xpos for x in ("thigh", "shank", "foot"))
    a, b = knee - hip, ankle - knee
    return math.acos(float(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))


def as_rotation(quaternion: FloatArray) -> Rotation:
    """A quaternion w x y z, or (n, 4) of them, as SciPy has it."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
