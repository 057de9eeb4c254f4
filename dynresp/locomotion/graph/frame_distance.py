"""Distances between frames: how unlike they are (Lee et al. 2002, section 4.1, eq. 2 and 3).

    D_ij = d(p_i, p_j) + nu d(v_i, v_j)
    d(p_i, p_j) = |p_i,0 - p_j,0|^2 + sum_k w_k |log(q_j,k^-1 q_i,k)|^2

The logarithm is the half-angle vector of the shorter turn, so a term is half an angle, squared.
d(v_i, v_j) is the squared difference of the rates of the quantities of eq. 3: metres and half
radians a second, with the same weights. So nu is a time squared: with nu = 0.0225 s^2 a difference
of rates counts as much as the difference in pose that it causes within 0.15 s.

A metre and a half radian count alike, as in the paper. The end of a limb half a metre long moves by
x metres if its joint turns by x half radians.

The distance is taken after frame j has been moved onto frame i as far as its clip would be moved by
a jump:

- `Coordinates.FIXED`: it is not moved.
- `Coordinates.RELATIVE`: it is turned and shifted to i's yaw and position on the ground. Height,
  tilt and velocity in the facing frame still count.
- `Coordinates.BLOCKS`: it is turned by the quarter turns nearest to the difference of yaw, then
  shifted by the whole blocks nearest to the difference of position and height. The rest counts as
  in fixed coordinates. The world's origin is at a corner or in the middle of a block.

The distance is the same from i to j as from j to i, and zero from a frame to itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, ROOT, ROOT_QUAT, VELOCITY_SIZE, as_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError

JOINT_WEIGHTS = {
    "waist": 1, "back": 1, "neck": 0,
    "left_shoulder": 1, "left_elbow": 1, "right_shoulder": 1, "right_elbow": 1,
    "left_hip": 1, "left_knee": 1, "left_ankle": 0,
    "right_hip": 1, "right_knee": 1, "right_ankle": 0,
}  # fmt: skip
"""Weights of the joints, in the order of a pose (section 4.1). The pelvis has weight 1, too."""

_USED = [index for index, weight in enumerate(JOINT_WEIGHTS.values()) if weight]
_QUARTER = 0.5 * math.pi
_QUARTERS = rotations.from_yaw(_QUARTER * np.arange(4))


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """The numbers of each frame that the distance compares. Arrays are read-only.

    In relative coordinates positions, orientations and linear velocities are those after the frame
    was moved to the world's origin, facing +X; otherwise they are the frame's own.

    Attributes:
        config: Gives coordinates, nu and the size of blocks.
        positions: (n, 3) of the root [m]; in relative coordinates x and y are zero.
        orientations: (n, 4) of the root, w x y z.
        yaws: (n,) yaw of the root before it was moved [rad].
        joints: (n, 10, 4) rotations of the joints of weight 1, w x y z.
        linear: (n, 3) velocity of the root times the square root of nu [m].
        rates: (n, 33) half the angular velocities of the root, in its own frame, and of the
            joints of weight 1, times the square root of nu [half radians].
    """

    config: GraphConfig
    positions: FloatArray
    orientations: FloatArray
    yaws: FloatArray
    joints: FloatArray
    linear: FloatArray
    rates: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("positions", "orientations", "yaws", "joints", "linear", "rates"):
            getattr(self, name).flags.writeable = False

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def cell(self) -> FloatArray:
        """(3,) length, width and height of a block [m]."""
        side, height = self.config.block_m, self.config.block_height_m
        return np.array([side, side, height])


def frame_features(
    poses: npt.ArrayLike, velocities: npt.ArrayLike, config: GraphConfig
) -> FrameFeatures:
    """Compute the numbers by which frames are compared.

    Args:
        poses: (n, 59) rows of `qpos`.
        velocities: (n, 45) rows of `qvel`: root linear in the world [m/s], root angular in the
            root's frame, joints in the child's frame [rad/s].
        config: Gives coordinates, nu and the size of blocks.

    Raises:
        MotionError: Shapes do not match, or a number is not finite.
    """
    rows = as_poses(poses)
    n = len(rows)
    moving = np.asarray(velocities, dtype=np.float64)
    if moving.shape != (n, VELOCITY_SIZE):
        raise MotionError(
            f"velocities must be ({n}, {VELOCITY_SIZE}), one row a pose, got {moving.shape}"
        )
    if not (np.isfinite(rows).all() and np.isfinite(moving).all()):
        raise MotionError("a pose or a velocity has a number that is not finite")
    positions, linear = rows[:, ROOT].copy(), moving[:, :3]
    orientations = rotations.normalize(rows[:, ROOT_QUAT])
    yaws = rotations.yaw_of(orientations)
    if config.coordinates is Coordinates.RELATIVE:
        back = rotations.from_yaw(-yaws)
        positions[:, :2] = 0.0
        orientations = rotations.multiply(back, orientations)
        linear = rotations.rotate(back, linear)
    time = math.sqrt(config.velocity_weight)
    angular = moving[:, 3:].reshape(n, -1, 3)
    used = np.concatenate([angular[:, :1], angular[:, 1:][:, _USED]], axis=1)
    return FrameFeatures(
        config=config,
        positions=positions,
        orientations=np.array(orientations),
        yaws=yaws,
        joints=rotations.normalize(rows[:, JOINTS].reshape(n, -1, 4)[:, _USED]),
        linear=time * linear,
        rates=0.5 * time * used.reshape(n, -1),
    )


def frame_distances(
    features: FrameFeatures, first: npt.ArrayLike, second: npt.ArrayLike
) -> FloatArray:
    """Distances D of pairs of frames (eq. 2).

    Args:
        features: Features of all frames.
        first: (...,) indices i.
        second: (...,) indices j; shapes broadcast.

    Returns:
        (...,) distances.
    """
    i, j = np.broadcast_arrays(np.asarray(first), np.asarray(second))
    total = np.sum((features.rates[i] - features.rates[j]) ** 2, axis=-1)
    total += np.sum(_half_squared(features.joints[i], features.joints[j]), axis=-1)
    if features.config.coordinates is Coordinates.BLOCKS:
        turns = np.round((features.yaws[i] - features.yaws[j]) / _QUARTER).astype(int) % 4
        turn = _QUARTERS[turns]
        orientation = rotations.multiply(turn, features.orientations[j])
        linear = rotations.rotate(turn, features.linear[j])
        apart = features.positions[i] - rotations.rotate(turn, features.positions[j])
        apart -= features.cell * np.round(apart / features.cell)
    else:
        orientation, linear = features.orientations[j], features.linear[j]
        apart = features.positions[i] - features.positions[j]
    total += np.sum(apart**2, axis=-1)
    total += np.sum((features.linear[i] - linear) ** 2, axis=-1)
    return total + _half_squared(features.orientations[i], orientation)


def quarter_turned(features: FrameFeatures) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Roots of all frames after none, one, two and three quarter turns about the vertical.

    Returns:
        Positions (n, 4, 3), moved near the origin by whole blocks; orientations (n, 4, 4);
        linear velocities (n, 4, 3), scaled as in `FrameFeatures`.
    """
    positions = rotations.rotate(_QUARTERS, features.positions[:, None])
    positions -= features.cell * np.round(positions / features.cell)
    orientations = rotations.multiply(_QUARTERS, features.orientations[:, None])
    return positions, orientations, rotations.rotate(_QUARTERS, features.linear[:, None])


def _half_squared(a: FloatArray, b: FloatArray) -> FloatArray:
    """|log(b^-1 a)|^2 with the half-angle logarithm: half the angle between rotations, squared.

    The angle is computed from chords, which are exact near zero and independent of signs.
    """
    near, far = np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)
    half: FloatArray = 2.0 * np.arctan2(np.minimum(near, far), np.maximum(near, far))
    return half**2
