"""Control by video: a person acting before a camera chooses what an avatar does next.

Ten times a second the paths open to the avatar, the cluster paths of its frame, are compared with
what is seen (Lee et al. 2002, section 5.3). The paper warps the last seconds of video onto every
path. But a path that fits what the person did some seconds ago leads the avatar there just as much
later. Here the cluster in which the person is now is recognised first (`action_recognition`,
`belief`). A path scores by how soon it is in that cluster and how long it stays. Among the paths
that score equally well, the one is chosen onto which the last second of video warps with the least
cost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.graph import placement
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.belief import Belief
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.time_warping import warp_onto_rows
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError

# How far the paths open to the avatar are looked at [s].
_LOOK_AHEAD_S = 3.0
# What a path does later counts less: its weight falls to 1/e in this time [s].
_PATIENCE_S = 1.0
# What was recognised before counts less: its weight falls to 1/e in this time [s].
_MEMORY_S = 0.3
# So much of the video is warped onto paths [s].
_BUFFER_S = 1.0
# Paths whose scores, 0 to 1, differ from the best by no more count as equally good. At most so many
# of them are compared by warping.
_EQUAL_SCORE, _MAX_COMPARED = 0.02, 24
# Added to the belief in every cluster.
_DOUBT = 0.02


@dataclass(frozen=True, eq=False)
class OpenPath:
    """A path open to the avatar.

    Attributes:
        frames: (s,) frames to play after the current one.
        cluster: The cluster to which it leads: the one in which it is most of the time.
    """

    frames: IntArray
    cluster: int


def open_paths(forest: ClusterForest, frame: int, within_s: float) -> list[OpenPath]:
    """The paths open to an avatar at a frame: to stay in its cluster, and all cluster paths.

    Args:
        forest: The cluster trees.
        frame: Where the avatar is.
        within_s: How far to look ahead [s]. A path that reaches its last cluster earlier stays
            there until then, if it can.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    labels, count = forest.clusters.labels, len(forest.clusters.mixture)
    lead = forest.frames_to_branch(frame)
    tree = forest.tree(frame, within_s)
    steps = forest.steps_within(within_s)
    paths = [lead[:1]]
    # If the tree is that of a later branch, the path to the branch is one of the paths, too.
    for node in range(len(lead) == 1, len(tree.node_parents)):
        paths.append(np.concatenate([lead, tree.frames_to(node)[1:]])[: steps + 1])
    out = []
    for path in paths:
        # A path that only stays has no frames if it must leave the cluster at once.
        frames = forest.stay(path, steps)[1:]
        if len(frames):
            visits = np.bincount(labels[frames], minlength=count)
            out.append(OpenPath(frames, int(visits.argmax())))
    return out


class VideoControl:
    """Recognises from rows of video what the person does, and chooses for the avatar.

    Attributes:
        forest: The paths open to the avatar.
        table: What frames look like.
        belief: Which frames the person is at.
        clusters: (K,) how probable each cluster is to be the person's.
    """

    def __init__(self, forest: ClusterForest, table: ViewTable, recogniser: Recogniser) -> None:
        """Begin without having seen anything.

        Args:
            forest: The paths open to the avatar.
            table: Of the forest's database.
            recogniser: Trained on the forest's clusters.

        Raises:
            UsageError: They are not of one database and one clustering.
        """
        count = len(forest.clusters.mixture)
        if recogniser.weights[1].shape[1] != count:
            raise UsageError(
                f"the recogniser knows {recogniser.weights[1].shape[1]} clusters, the forest has "
                f"{count}; train it on the forest's clusters"
            )
        self.forest, self.table = forest, table
        self.belief = Belief(forest.graph.database, table)
        self.clusters: FloatArray = np.full(count, 1.0 / count)
        self._recogniser = recogniser
        fps = table.fps
        kept = max(round(_BUFFER_S * fps), int(recogniser.ages.max()) + 1)
        self._rows: deque[npt.NDArray[np.float32]] = deque(maxlen=kept)
        self._fading = np.exp(-1.0 / (_MEMORY_S * fps))

    def see(self, row: npt.NDArray[np.float32]) -> None:
        """Take in what is seen, one frame of the database later than the last time.

        Args:
            row: (d,) as `ViewTable.row` and `PersonTracker.see` give it.
        """
        self._rows.append(row)
        self.belief.see(row)
        labels, count = self.forest.clusters.labels, len(self.clusters)
        believed = np.bincount(labels, self.belief.frames, minlength=count)
        recognised = self._recogniser.probabilities(np.array(self._rows))
        # The belief is too sure of itself: people differ more than frames do.
        both = np.sqrt(recognised * (believed + _DOUBT))
        self.clusters = self._fading * self.clusters + (1.0 - self._fading) * both / both.sum()

    def choose(self, frame: int) -> OpenPath:
        """What the avatar does next.

        Args:
            frame: The frame of the graph that it is at.

        Raises:
            UsageError: The frame is not in the graph's component, or nobody has been seen yet.
        """
        if not self._rows:
            raise UsageError("nobody has been seen yet; call `see` with a row before `choose`")
        paths = open_paths(self.forest, frame, _LOOK_AHEAD_S)
        labels = self.forest.clusters.labels
        steps = max(len(path.frames) for path in paths)
        fading = np.exp(-np.arange(steps) / (_PATIENCE_S * self.table.fps))
        scores = np.array(
            [
                np.average(self.clusters[labels[p.frames]], weights=fading[: len(p.frames)])
                for p in paths
            ]
        )
        good = np.flatnonzero(scores >= scores.max() - _EQUAL_SCORE)
        good = good[np.argsort(-scores[good], kind="stable")][:_MAX_COMPARED]
        if len(good) == 1:
            return paths[good[0]]
        seen = np.array(self._rows)[-round(_BUFFER_S * self.table.fps) :]
        costs = warped_costs(seen, self.table, self.forest, frame, [paths[k] for k in good])
        return paths[good[int(np.argmin(costs.min(axis=1)))]]


def warped_costs(
    seen: npt.NDArray[np.float32],
    table: ViewTable,
    forest: ClusterForest,
    frame: int,
    paths: Sequence[OpenPath],
) -> FloatArray:
    """How unlike each path is to what was seen, from every viewpoint: the paper's cost.

    Args:
        seen: (m, d) rows of video.
        table: What frames look like.
        forest: Whose paths.
        frame: Where the paths begin.
        paths: The paths; each may go on after the video ends.

    Returns:
        (k, views) mean distance of warped rows. The viewpoint is that of the clip of `frame`; the
        camera stays where it is when a path goes over into a clip that is turned. The paper takes
        the least cost of each path.
    """
    views = np.arange(table.views.count)
    planar = forest.graph.database.planar
    pieces, ends = [], [0]
    for path in paths:
        along = np.concatenate([[frame], path.frames]).astype(np.int32)
        turned = forest.root_states_along(along, placement.IDENTITY)[1:, 3] - planar[along[1:], 3]
        shift = np.round(turned / table.views.step).astype(int)
        at = (views[:, None] - shift) % table.views.count
        pieces.append(table.rows[along[1:], at].reshape(-1, table.rows.shape[2]))
        ends += [len(along) - 1] * table.views.count
    warped = warp_onto_rows(
        seen.astype(np.float64), np.concatenate(pieces).astype(np.float64), np.cumsum(ends), True
    )
    return warped.costs.reshape(len(paths), -1) / len(seen)
