"""Cluster frames by what a camera can see: where the limbs are, and how the person moves.

Control by choice and by sketch cluster joint angles (eq. 4 of Lee et al. 2002). But a silhouette
does not show the twist of an upper arm about its own axis, and skeletons from different sources,
mapped onto one character, differ most in that twist. So control by video clusters positions: of
head, hands, elbows, shoulders, knees and feet, relative to the pelvis and the facing. With them go
the height of the pelvis and the speeds ahead, to the left and of turning. All are averaged over the
cycle of a walk, so that a cluster is an action and not a phase of an action.
"""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.clusters.cluster_observations import WALK_CYCLE_S, averaged
from dynresp.locomotion.clusters.frame_clusters import Clusters, fit_clusters
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character, default_character
from dynresp.motion.rotations import FloatArray

MAX_VISIBLE_CLUSTERS = 5
"""Default limit on the number of clusters: more would look too much alike from some sides."""
CLUSTERING_VERSION = 2
"""Part of the identity of kept clusters; raise it when the same frames give other clusters.
Version 2 drops empty clusters."""

_BODIES = (
    "head", "left_forearm", "right_forearm", "left_foot", "right_foot", "left_shank",
    "right_shank", "left_upper_arm", "right_upper_arm", "chest",
)  # fmt: skip
_HANDS = ("left_forearm", "right_forearm")
# Position of the hand in the frame of the forearm [m].
_HAND = np.array([0.0, 0.0, -0.3])
# Weights: of a limb's position [1/m], of the height [1/m], of a speed [s/m] and of turning [s/rad].
_LIMB, _HEIGHT, _SPEED, _TURN = 0.5, 3.0, 0.7, 0.2
OBSERVATION_SIZE = 3 * (len(_BODIES) + len(_HANDS)) + 4
"""Numbers in an observation: positions, height and three speeds."""
# Speeds are means over this time [s].
_SPEED_S = 0.4


def visible_observations(database: MotionDatabase, character: Character) -> FloatArray:
    """One observation for each frame: what a camera can see of it, weighted.

    Args:
        database: The frames.
        character: Whose motions they are.

    Returns:
        (n, `OBSERVATION_SIZE`).
    """
    poses = database.poses.copy()
    facing = database.planar[:, 3]
    poses[:, ROOT] = 0.0
    poses[:, ROOT_QUAT] = rotations.multiply(rotations.from_yaw(-facing), poses[:, ROOT_QUAT])
    states = character.kinematics(poses)
    positions = [states.positions[:, character.body(name)] for name in _BODIES]
    positions += [
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
        duration = np.maximum(high - low, 1)[:, None] / database.fps
        root = database.planar[part].copy()
        root[:, 3] = np.unwrap(root[:, 3])
        speed = (root[high] - root[low]) / duration
        cosine, sine = np.cos(facing[part]), np.sin(facing[part])
        moving[part, 1] = _SPEED * (cosine * speed[:, 0] + sine * speed[:, 1])
        moving[part, 2] = _SPEED * (cosine * speed[:, 1] - sine * speed[:, 0])
        moving[part, 3] = _TURN * speed[:, 3]
    return averaged(database, np.concatenate([_LIMB * np.hstack(positions), moving], axis=1))


def find_visible_clusters(
    graph: MotionGraph, max_clusters: int = MAX_VISIBLE_CLUSTERS, character: Character | None = None
) -> Clusters:
    """Cluster the frames of a graph by what a camera can see.

    Args:
        graph: Its frames are clustered.
        max_clusters: Largest number of clusters.
        character: Whose motions they are, by default the product's own.

    Raises:
        UsageError: max_clusters is below 1.
    """
    x = visible_observations(graph.database, character or default_character())
    spacing = max(1, round(WALK_CYCLE_S * graph.database.fps))
    return fit_clusters(graph, x, spacing, max_clusters)
