"""The way from the simulation back to motion capture, with one pose and one number at a time."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tests.oracles import quaternions

Array = npt.NDArray[np.float64]


def ease(share: float) -> float:
    """Ease-in/ease-out: from 0 to 1, slope and curvature 0 at both ends."""
    share = min(max(share, 0.0), 1.0)
    return 10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5


def between(a: Array, b: Array, weights: Sequence[float]) -> Array:
    """Poses (n, 59) from a to b: the root on a straight line, each rotation by slerp.

    A rotation takes the shorter way at first, and then keeps to the way it has taken.
    """
    out = np.empty_like(a)
    for i, weight in enumerate(weights):
        for k in range(3):
            out[i, k] = (1.0 - weight) * a[i, k] + weight * b[i, k]
    for k in range(3, 59, 4):
        before = np.array([1.0, 0.0, 0.0, 0.0])
        for i, weight in enumerate(weights):
            start, goal = a[i, k : k + 4], b[i, k : k + 4]
            inverse = start * np.array([1.0, -1.0, -1.0, -1.0])
            turn = quaternions.multiply(inverse, goal)
            turn = turn if before @ turn >= 0.0 else -turn
            out[i, k : k + 4] = quaternions.multiply(start, power(turn, weight))
            before = turn
    return out


def power(q: Array, exponent: float) -> Array:
    """A rotation done in part: the same axis, a share of the angle (of up to a whole turn)."""
    sine = math.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    if sine < 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    half = exponent * math.atan2(sine, q[0])
    return np.array([math.cos(half), *(math.sin(half) * q[1:] / sine)])


def blend_onto(simulated: Array, reaction: Array) -> Array:
    """Poses (n + 1, 59) from the simulated ones to the reaction's."""
    last = len(simulated) - 1
    return between(simulated, reaction, [ease(i / last) for i in range(last + 1)])


def blended_targets(base: Array, reaction: Array, entry: int, start: int, end: int) -> Array:
    """What the servos track: base motion at first, the reaction alone from `end` on."""
    frames = [min(max(entry + i - start, 0), len(reaction) - 1) for i in range(len(base))]
    return between(base, reaction[frames], [ease(i / end) for i in range(len(base))])


def turned_about_vertical(pose: Array, angle: float, shift: tuple[float, float]) -> Array:
    """A pose (59,) turned about the world's vertical by an angle [rad], then shifted [m]."""
    out = pose.copy()
    c, s = math.cos(angle), math.sin(angle)
    out[0] = c * pose[0] - s * pose[1] + shift[0]
    out[1] = s * pose[0] + c * pose[1] + shift[1]
    turn = np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])
    out[3:7] = quaternions.multiply(turn, pose[3:7])
    return out
