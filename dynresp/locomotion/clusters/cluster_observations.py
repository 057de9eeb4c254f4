"""What clusters are made of: one vector a frame (Lee et al. 2002, eq. 4).

In fixed coordinates it is the paper's: root position [m], half-angle logarithm of the root's
orientation against a reference, and of the joints whose weight is 1.

Where the place or facing of a recording does not matter, the paper's vector would group frames by
where they happened to be recorded. It also found clusters in relative coordinates of less use
(section 4.2.4): without a place, what tells frames apart is first the phase of the step, which
changes several times a second. So there position on the ground and yaw make way for what tells
actions apart, the speeds ahead, to the left and of turning in the facing frame, and every number
is averaged over about one cycle of a walk. On blocks the height above the ground of the recording
does not matter either, and the speed upward takes its place.
"""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, ROOT, ROOT_QUAT, Character
from dynresp.motion.rotations import FloatArray

CLUSTERED_JOINTS = (
    "waist", "back", "left_shoulder", "left_elbow", "right_shoulder", "right_elbow",
    "left_hip", "left_knee", "right_hip", "right_knee",
)  # fmt: skip
"""Joints of weight 1 in eq. 4; all others have weight 0."""

WALK_CYCLE_S = 1.0
"""Two steps of a walk [s]."""

# Orientations that are tried as the reference; many frames are alike.
_CANDIDATES = 2000
_BLOCK = 512


def observations(
    database: MotionDatabase, coordinates: Coordinates, character: Character
) -> FloatArray:
    """One observation a frame.

    Args:
        database: The frames.
        coordinates: In what world frames are compared.
        character: Whose they are.

    Returns:
        (n, 36) in fixed and relative coordinates and on blocks: metres, half radians, metres a
        second and half radians a second, which count alike.
    """
    quaternions = database.poses[:, ROOT_QUAT]
    joints = database.poses[:, JOINTS].reshape(len(database), -1, 4)
    used = joints[:, [character.joint(name) for name in CLUSTERED_JOINTS]]
    angles = _half_logarithm(used).reshape(len(database), -1)
    if coordinates is Coordinates.FIXED:
        reference = reference_orientation(quaternions)
        turned = rotations.multiply(rotations.conjugate(reference), quaternions)
        return np.hstack([database.poses[:, ROOT], _half_logarithm(turned), angles])
    facing = rotations.from_yaw(database.planar[:, 3])
    leaning = _half_logarithm(rotations.multiply(rotations.conjugate(facing), quaternions))
    speeds = _speeds(database)
    if coordinates is Coordinates.RELATIVE:
        speeds[:, 2] = database.planar[:, 2]
    # The leaning is free of any twist about the vertical: its third number is 0.
    return averaged(database, np.hstack([speeds, leaning[:, :2], angles]))


def reference_orientation(quaternions: FloatArray) -> FloatArray:
    """The orientation whose farthest other one is nearest, (4,) of (n, 4).

    Logarithms against it stay as far from their singularity as they can. At most 2,000 evenly
    spread orientations are tried; all count as the others.
    """
    step = -(-len(quaternions) // _CANDIDATES)
    tried = quaternions[::step]
    # The angle between two falls with |cosine of its half|: the farthest has the least.
    least = np.ones(len(tried))
    for start in range(0, len(quaternions), _BLOCK):
        block = quaternions[start : start + _BLOCK]
        cosines = np.abs(np.einsum("ik,jk->ij", tried, block))
        least = np.minimum(least, cosines.min(axis=1))
    return tried[int(np.argmax(least))]


def decorrelation(x: FloatArray, database: MotionDatabase, longest_s: float) -> int:
    """Frames after which observations (n, d) are nearly independent of what they were.

    That is where the autocorrelation within clips first falls below 1/e, at most `longest_s` [s].
    """
    longest = max(round(longest_s * database.fps), 1)
    apart = x - x.mean(axis=0)
    variance = float(np.mean(np.sum(apart**2, axis=1)))
    for lag in range(1, longest):
        # A lag that crosses from clip to clip says nothing.
        inside = database.clip_of[lag:] == database.clip_of[:-lag]
        products = np.einsum("nd,nd->n", apart[lag:], apart[:-lag])[inside]
        if len(products) == 0 or products.mean() < variance / np.e:
            return lag
    return longest


def _half_logarithm(quaternions: FloatArray) -> FloatArray:
    """Half-angle vectors [half rad], the logarithm of eq. 3 and 4."""
    return 0.5 * rotations.to_rotation_vector(quaternions)


def _speeds(database: MotionDatabase) -> FloatArray:
    """(n, 4) speed ahead, to the left and up [m/s], and of turning [half rad/s]."""
    planar = database.planar
    out = np.empty((len(database), 4))
    for clip in database.clips:
        span = slice(clip.start, clip.stop)
        way = planar[span].copy()
        way[:, 3] = 0.5 * np.unwrap(way[:, 3])
        out[span] = np.gradient(way, 1.0 / database.fps, axis=0)
    cosine, sine = np.cos(planar[:, 3]), np.sin(planar[:, 3])
    ahead = cosine * out[:, 0] + sine * out[:, 1]
    out[:, 1] = cosine * out[:, 1] - sine * out[:, 0]
    out[:, 0] = ahead
    return out


def averaged(database: MotionDatabase, x: FloatArray) -> FloatArray:
    """Means of (n, d) over a walk's cycle around each frame, cut at the ends of its clip."""
    half = round(0.5 * WALK_CYCLE_S * database.fps)
    out = np.empty_like(x)
    for clip in database.clips:
        frames = np.arange(clip.stop - clip.start)
        sums = np.zeros((len(frames) + 1, x.shape[1]))
        np.cumsum(x[clip.start : clip.stop], axis=0, out=sums[1:])
        low = np.maximum(frames - half, 0)
        high = np.minimum(frames + half + 1, len(frames))
        out[clip.start : clip.stop] = (sums[high] - sums[low]) / (high - low)[:, None]
    return out
