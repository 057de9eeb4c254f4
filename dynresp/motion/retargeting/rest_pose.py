"""An upright rest pose for a skeleton, whatever rest pose its file has.

Retargeting compares segments with a rest pose in which trunk and legs are straight. In most files
the rest pose is so; in some it lies down (their up axis was changed later), and in some it is no
pose of a person at all: every bone along one axis. Only the motion of the last kind shows how the
person stands.
"""

from __future__ import annotations

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.motion import FEET
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.retargeting.segments import Segments
from dynresp.motion.rotations import FloatArray

_UP = np.array([0.0, 0.0, 1.0])
# A rest pose is upright if trunk, thighs and shanks lean less than this [rad], and the shoulders
# are turned less against the hips.
_MAX_TILT = np.radians(35.0)
# A rest pose whose own up axis is so near [rad] to one of the file's axes was meant to stand on it.
_NEAR_AXIS = np.radians(20.0)
# Frames whose trunk and legs are bent by so much more than in the straightest one, summed over the
# five bones [rad], still show how the person stands.
_AS_STRAIGHT = 0.25


def with_upright_rest(skeleton: SkeletonMotion, segments: Segments) -> SkeletonMotion:
    """The same motion, relative to an upright rest pose.

    Args:
        skeleton: The source.
        segments: Its joints.

    Returns:
        The source itself if its rest pose is upright; with its rest pose turned if that is
        straight but lies down; else with the mean of the straightest frames as rest pose.
    """
    rest = skeleton.rest_positions()[None]
    faces_one_way = _line_of(rest, segments, "hip") @ _line_of(rest, segments, "shoulder")
    up = _own_up(rest, segments)
    if faces_one_way < np.cos(_MAX_TILT):
        pass
    elif _tilts(rest, segments, np.broadcast_to(_UP, (1, 3))).max() <= _MAX_TILT:
        return skeleton
    elif _tilts(rest, segments, up).max() <= _MAX_TILT:
        axis = np.eye(3)[np.argmax(np.abs(up[0]))] * np.sign(up[0][np.argmax(np.abs(up[0]))])
        meant = axis if axis @ up[0] > np.cos(_NEAR_AXIS) else up[0]
        turn = rotations.between_vectors(meant, _UP)
        return skeleton.with_rest(np.tile(turn, (len(skeleton.names), 1)))
    points = skeleton.joint_positions()
    up = _own_up(points, segments)
    bent = _tilts(points, segments, up).sum(axis=1)
    straight = np.flatnonzero(bent <= bent.min() + _AS_STRAIGHT)
    back = rotations.conjugate(_body_frames(points[straight], segments, up[straight]))
    poses = rotations.multiply(back[:, None], skeleton.rotations[straight])
    # All on the side of the first, so that a rotation and its negative do not cancel out.
    sign = np.where(np.sum(poses * poses[:1], axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    return skeleton.with_rest(np.mean(sign * poses, axis=0))


def _bones(points: FloatArray, segments: Segments) -> FloatArray:
    """Directions (frames, 5, 3), upward in a person who stands: trunk, thighs and shanks."""
    limbs = [segments.limbs[side] for side in FEET]
    hips, shoulders = (
        np.mean([points[:, limb[joint]] for limb in limbs], axis=0) for joint in ("hip", "shoulder")
    )
    bones = [shoulders - hips]
    for limb in limbs:
        bones += [points[:, limb["hip"]] - points[:, limb["knee"]]]
        bones += [points[:, limb["knee"]] - points[:, limb["ankle"]]]
    stacked = np.stack(bones, axis=1)
    return np.asarray(stacked / np.maximum(np.linalg.norm(stacked, axis=-1, keepdims=True), 1e-9))


def _line_of(rest: FloatArray, segments: Segments, joint: str) -> FloatArray:
    """Direction (3,) from the right hip or shoulder to the left."""
    line = rest[0, segments.limbs["left"][joint]] - rest[0, segments.limbs["right"][joint]]
    return np.asarray(line / max(float(np.linalg.norm(line)), 1e-9))


def _own_up(points: FloatArray, segments: Segments) -> FloatArray:
    """Where the head is, seen from the feet: unit vectors (frames, 3)."""
    bones = _bones(points, segments)
    up = 2.0 * bones[:, 0] + bones[:, 1:].mean(axis=1)
    length = np.linalg.norm(up, axis=1, keepdims=True)
    return np.where(length > 1e-6, up / np.maximum(length, 1e-6), _UP)


def _tilts(points: FloatArray, segments: Segments, up: FloatArray) -> FloatArray:
    """Angles [rad] of trunk, thighs and shanks from an up axis (frames, 3), (frames, 5)."""
    cosine = np.sum(_bones(points, segments) * up[:, None], axis=-1)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _body_frames(points: FloatArray, segments: Segments, up: FloatArray) -> FloatArray:
    """Rotations (frames, 4) that turn up to the given axes and +Y to the person's left."""
    across = points[:, segments.limbs["left"]["hip"]] - points[:, segments.limbs["right"]["hip"]]
    tilt = rotations.between_vectors(_UP, up)
    left = rotations.rotate(rotations.conjugate(tilt), across)
    return rotations.multiply(tilt, rotations.from_yaw(np.arctan2(-left[:, 0], left[:, 1])))
