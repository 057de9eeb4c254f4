"""Clusters of what can be seen: where limbs are and how somebody moves.

The clusters of choice and sketch are made of joint angles (eq. 4 of Lee et al. 2002). A silhouette
does not show how far an upper arm is turned about its own axis, and just there skeletons from
different sources differ when they are laid onto one character. For control by video clusters are
therefore made of places: head, hands, elbows, shoulders, knees and feet against the pelvis in the
facing frame, its height, and the speeds ahead, to the left and of turning, all averaged over a
walk's cycle, so that a cluster is an action and not a phase of one.
"""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.clusters.cluster_observations import WALK_CYCLE_S, averaged
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import MixtureConfig, fit_mixture
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character, default_character
from dynresp.motion.rotations import FloatArray

MOST = 5
"""Actions told apart by default: finer ones look too much alike from some sides."""

_PLACES = (
    "head", "left_forearm", "right_forearm", "left_foot", "right_foot", "left_shank",
    "right_shank", "left_upper_arm", "right_upper_arm", "chest",
)  # fmt: skip
_HANDS = ("left_forearm", "right_forearm")
# The hand in the frame of the forearm [m].
_HAND = np.array([0.0, 0.0, -0.3])
# What a metre of a limb, a metre of height, a metre a second and a radian a second count.
_LIMB, _HEIGHT, _SPEED, _TURN = 0.5, 3.0, 0.7, 0.2
OBSERVED = 3 * (len(_PLACES) + len(_HANDS)) + 4
"""Numbers of an observation: places, height and three speeds."""
# Speeds are means over so long [s].
_SPEED_S = 0.4


def sight_observations(database: MotionDatabase, character: Character) -> FloatArray:
    """One observation a frame.

    Args:
        database: The frames.
        character: Whose they are.

    Returns:
        (n, `OBSERVED`).
    """
    poses = database.poses.copy()
    facing = database.planar[:, 3]
    poses[:, ROOT] = 0.0
    poses[:, ROOT_QUAT] = rotations.multiply(rotations.from_yaw(-facing), poses[:, ROOT_QUAT])
    states = character.kinematics(poses)
    places = [states.positions[:, character.body(name)] for name in _PLACES]
    places += [
        states.positions[:, body] + rotations.rotate(states.quaternions[:, body], _HAND)
        for body in map(character.body, _HANDS)
    ]
    moving = np.empty((len(database), 4))
    moving[:, 0] = _HEIGHT * database.planar[:, 2]
    half = max(1, round(0.5 * _SPEED_S * database.fps))
    for clip in database.clips:
        part = slice(clip.start, clip.stop)
        frames = np.arange(clip.stop - clip.start)
        low, high = np.maximum(frames - half, 0), np.minimum(frames + half, len(frames) - 1)
        passed = np.maximum(high - low, 1)[:, None] / database.fps
        way = database.planar[part].copy()
        way[:, 3] = np.unwrap(way[:, 3])
        speed = (way[high] - way[low]) / passed
        cosine, sine = np.cos(facing[part]), np.sin(facing[part])
        moving[part, 1] = _SPEED * (cosine * speed[:, 0] + sine * speed[:, 1])
        moving[part, 2] = _SPEED * (cosine * speed[:, 1] - sine * speed[:, 0])
        moving[part, 3] = _TURN * speed[:, 3]
    return averaged(database, np.concatenate([_LIMB * np.hstack(places), moving], axis=1))


def cluster_by_sight(
    graph: MotionGraph, most: int = MOST, character: Character | None = None
) -> Clusters:
    """Cluster the frames of a graph by what can be seen.

    Args:
        graph: Its frames count.
        most: Most clusters.
        character: Whose motions they are, by default the product's own.
    """
    database = graph.database
    x = sight_observations(database, character or default_character())
    spacing = max(1, round(WALK_CYCLE_S * database.fps))
    kept = graph.frames[spacing // 2 :: spacing]
    kept = graph.frames if len(kept) == 0 else kept
    fit = fit_mixture(x[kept], MixtureConfig(most=most))
    logs = fit.mixture.log_posteriors(x)
    labels = np.argmax(logs, axis=1).astype(np.int32)
    examples = np.empty(len(fit.mixture), dtype=np.int32)
    for k, mean in enumerate(fit.mixture.means):
        distances = np.sum((x[graph.frames] - mean) ** 2, axis=1)
        distances[labels[graph.frames] != k] += np.inf
        examples[k] = graph.frames[np.argmin(distances)]
    return Clusters(
        fit.mixture, labels, logs.astype(np.float32), examples, spacing, fit.curve, fit.bounded
    )
