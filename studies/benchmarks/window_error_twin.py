"""The window error, written for reading: the slow twin of the compiled kernel.

Written out from Zordan et al. 2007, section 5, with nothing but loops and scalar arithmetic in
double precision. It shares no code with the fast path: the tests hold the kernel equal to it, and
`python -m studies full-search` measures how many times faster the kernel is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from dynresp.response.windows.windows import WindowErrorConfig

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
State = tuple[Vector, Quaternion]
Window = list[list[State]]
"""States by frame and body."""


def error_surface(
    trace: tuple[npt.ArrayLike, npt.ArrayLike],
    clip: tuple[npt.ArrayLike, npt.ArrayLike],
    exits: Iterable[int],
    entries: Iterable[int],
    config: WindowErrorConfig,
) -> npt.NDArray[np.float64]:
    """Window errors of all pairs of exit and entry frames.

    Args:
        trace: Positions (frames, bodies, 3) [m] and quaternions (frames, bodies, 4), w x y z.
        clip: The same for the reaction.
        exits: Frames of the trace at which windows begin.
        entries: Frames of the clip at which windows begin.
        config: Length of the windows and weights.

    Returns:
        (exits, entries) [m].
    """
    exit_windows = [cut_window(*trace, start, config.window_frames) for start in exits]
    entry_windows = [cut_window(*clip, start, config.window_frames) for start in entries]
    return np.array([[window_error(a, b, config) for b in entry_windows] for a in exit_windows])


def window_error(a: Window, b: Window, config: WindowErrorConfig) -> float:
    """Error of two windows that stand in their own facing frames [m]."""
    bodies = len(a[0])
    position_weight, angle_weight = config.position_weight, config.angle_weight
    total = 0.0
    weights = 0.0
    for i in range(len(a)):
        difference = 0.0
        for body in range(bodies):
            wp = position_weight[body] if isinstance(position_weight, tuple) else position_weight
            wt = angle_weight[body] if isinstance(angle_weight, tuple) else angle_weight
            (position_a, quaternion_a), (position_b, quaternion_b) = a[i][body], b[i][body]
            difference += wp * math.dist(position_a, position_b)
            difference += wt * angle_between(quaternion_a, quaternion_b)
        weight = (1.0 - i / len(a)) ** 2
        total += weight * difference
        weights += weight
    return total / weights


def cut_window(
    positions: npt.ArrayLike, quaternions: npt.ArrayLike, start: int, frames: int
) -> Window:
    """A window, moved so that its first frame stands at the origin and faces along +X.

    The facing is the twist of the pelvis (body 0) about the vertical; a pelvis exactly upside
    down has none and is not turned.
    """
    position = np.asarray(positions, dtype=np.float64)[start : start + frames].tolist()
    quaternion = np.asarray(quaternions, dtype=np.float64)[start : start + frames].tolist()
    origin_x, origin_y, _ = position[0][0]
    w, _, _, z = quaternion[0][0]
    yaw = 2.0 * math.atan2(z, w)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    unturn = (math.cos(yaw / 2.0), 0.0, 0.0, -math.sin(yaw / 2.0))
    window = []
    for i in range(frames):
        states = []
        for (x, y, height), (qw, qx, qy, qz) in zip(position[i], quaternion[i], strict=True):
            x, y = x - origin_x, y - origin_y
            ahead, left = cosine * x + sine * y, cosine * y - sine * x
            states.append(((ahead, left, height), multiply(unturn, (qw, qx, qy, qz))))
        window.append(states)
    return window


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Angle of the rotation that leads from a to b [rad], 0 to pi; accurate near zero."""
    w, x, y, z = multiply((a[0], -a[1], -a[2], -a[3]), b)
    return 2.0 * math.atan2(math.hypot(x, y, z), abs(w))


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
