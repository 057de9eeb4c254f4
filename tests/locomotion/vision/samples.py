"""Two actions that look very different, for tests of control by video."""

import numpy as np

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import Mixture
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph, PruningCounts
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray

FPS = 15.0
STEPPING, WAVING = 0, 1


def stepping(character: Character, frames: int, fps: float = FPS, pace: float = 1.0) -> FloatArray:
    """Long steps to and fro, arms down: (frames, 59)."""
    poses = np.tile(character.rest_pose, (frames, 1))
    swing = 0.6 * np.sin(2 * np.pi * pace * np.arange(frames) / fps)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        column = 7 + 4 * character.joint(f"{side}_hip")
        poses[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), sign * swing)
    poses[:, 0] += 0.6 * np.sin(2 * np.pi * 0.2 * np.arange(frames) / fps)
    return poses


def waving(character: Character, frames: int, fps: float = FPS, pace: float = 1.0) -> FloatArray:
    """Stands, and swings its stretched arms up and down at its sides: (frames, 59)."""
    poses = np.tile(character.rest_pose, (frames, 1))
    lift = 1.7 + 0.6 * np.sin(2 * np.pi * pace * np.arange(frames) / fps)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        column = 7 + 4 * character.joint(f"{side}_shoulder")
        poses[:, column : column + 4] = rotations.about_axis((1.0, 0.0, 0.0), sign * lift)
    return poses


def acting_database(character: Character) -> MotionDatabase:
    """Six seconds of each action."""
    motions = [Motion(poses(character, 90), FPS, poses.__name__) for poses in (stepping, waving)]
    return MotionDatabase.from_motions(motions, character)


def acting_forest(character: Character) -> ClusterForest:
    """The two clips as loops, with a jump from one to the other every second."""
    database = acting_database(character)
    edges = {(i, i + 1) for i in range(179) if i != 89} | {(89, 1), (179, 91)}
    edges |= {(i, i + 91) for i in range(0, 89, 15)} | {(i, i - 89) for i in range(90, 179, 15)}
    recorded = [database.successors[i] == j for i, j in sorted(edges)]
    order = np.lexsort((~np.array(recorded), [i for i, _ in sorted(edges)]))
    sources, targets = np.array(sorted(edges))[order].T
    offsets = np.concatenate([[0], np.cumsum(np.bincount(sources, minlength=180))])
    distances = np.where(np.array(recorded)[order], 0.0, 0.1).astype(np.float32)
    graph = MotionGraph(
        database,
        GraphConfig(),
        PruningCounts(180, 180 * 180, 0, 0, None, 0, 0, 180),
        offsets.astype(np.int64),
        targets.astype(np.int32),
        distances,
    )
    labels = np.repeat([STEPPING, WAVING], 90).astype(np.int32)
    logs = np.log(np.where(np.arange(2) == labels[:, None], 0.99, 0.01))
    mixture = Mixture(np.full(2, 0.5), np.eye(2, 36), np.ones(2))
    examples = np.array([20, 110], dtype=np.int32)
    return ClusterForest(
        graph, Clusters(mixture, labels, logs.astype(np.float32), examples, 1, (), False)
    )
