"""Control by video: what an avatar does next is chosen by somebody acting before a camera.

Ten times a second the ways open to the avatar, the cluster paths of its frame, are compared with
what is seen (Lee et al. 2002, section 5.3). The paper warps the last seconds of video onto every
way. A way that fits what somebody did some seconds ago leads the avatar there as much later. Here
the cluster in which the person is now is told first (`recognition`, `belief`), and ways count by
how soon they are in it and how long they stay. Of those that are equally good the one is taken
onto which the last second of video can be warped with the least cost.
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
from dynresp.locomotion.vision.belief import Belief, BeliefConfig
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.time_warping import warp_onto_rows
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError

# Added to the belief in every cluster.
_DOUBT = 0.02


@dataclass(frozen=True, eq=False)
class OpenPath:
    """A way open to the avatar.

    Attributes:
        frames: (s,) frames to play after the one at hand.
        cluster: The cluster to which it leads: the one in which it is most of the time.
    """

    frames: IntArray
    cluster: int


def open_paths(forest: ClusterForest, frame: int, within_s: float) -> list[OpenPath]:
    """The ways open to an avatar at a frame: to stay in its cluster, and all cluster paths.

    Args:
        forest: The cluster trees.
        frame: Where the avatar is.
        within_s: How far to look ahead [s]; a way that has come into the last cluster of its path
            stays there as long, if it can.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    labels, count = forest.clusters.labels, len(forest.clusters.mixture)
    lead = forest.frames_to_branch(frame)
    tree = forest.tree(frame, within_s)
    steps = forest.steps_within(within_s)
    ways = [lead[:1]]
    # Where the tree is that of a later branch, the way there is one as well.
    for node in range(len(lead) == 1, len(tree.node_parents)):
        ways.append(np.concatenate([lead, tree.frames_to(node)[1:]])[: steps + 1])
    out = []
    for way in ways:
        # Somebody who only stays may have to leave at once.
        frames = forest.stay(way, steps)[1:]
        if len(frames):
            led = np.bincount(labels[frames], minlength=count)
            out.append(OpenPath(frames, int(led.argmax())))
    return out


@dataclass(frozen=True)
class ControlConfig:
    """How the avatar follows.

    Attributes:
        look_ahead_s: How far the ways open to the avatar are looked at [s].
        patience_s: What a way does later counts less, falling to 1/e in so long [s].
        memory_s: What was told of the person before counts less, likewise [s].
        buffer_s: How much of the video is warped onto ways [s].
        equal: Ways whose scores, 0 to 1, differ by no more count as equally good.
        compared: At most so many of them are compared by warping.
    """

    look_ahead_s: float = 3.0
    patience_s: float = 1.0
    memory_s: float = 0.3
    buffer_s: float = 1.0
    equal: float = 0.02
    compared: int = 24

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One of them makes no sense.
        """
        for name in ("look_ahead_s", "patience_s", "memory_s", "buffer_s"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise UsageError(f"{name} must be above 0, got {getattr(self, name)}")
        if not 0.0 <= self.equal <= 1.0:
            raise UsageError(f"equal must be 0 to 1, got {self.equal}")
        if self.compared < 1:
            raise UsageError(f"compared must be 1 or more, got {self.compared}")


class VideoControl:
    """Tells from rows of video what the person does, and chooses for the avatar.

    Attributes:
        forest: The ways open to the avatar.
        table: What frames look like.
        belief: Which frames the person is at.
        clusters: (K,) how probable each cluster is to be the person's.
    """

    def __init__(
        self,
        forest: ClusterForest,
        table: ViewTable,
        recogniser: Recogniser,
        config: ControlConfig | None = None,
        belief: BeliefConfig | None = None,
    ) -> None:
        """Nothing has been seen yet.

        Args:
            forest: The ways open to the avatar.
            table: Of the forest's database.
            recogniser: Trained on the forest's clusters.
            config: How the avatar follows.
            belief: How fast the belief changes.

        Raises:
            UsageError: They are not of one database and one clustering.
        """
        count = len(forest.clusters.mixture)
        if recogniser.weights[1].shape[1] != count:
            raise UsageError(
                f"the recogniser tells {recogniser.weights[1].shape[1]} clusters, the forest has "
                f"{count}; train it on the forest's clusters"
            )
        self.forest, self.table = forest, table
        self.belief = Belief(forest.graph.database, table, belief)
        self.clusters: FloatArray = np.full(count, 1.0 / count)
        self._recogniser = recogniser
        self._config = config = config or ControlConfig()
        fps = table.fps
        kept = max(round(config.buffer_s * fps), int(recogniser.ages.max()) + 1)
        self._rows: deque[npt.NDArray[np.float32]] = deque(maxlen=kept)
        self._fading = np.exp(-1.0 / (config.memory_s * fps))

    def see(self, row: npt.NDArray[np.float32]) -> None:
        """Take in what is seen, a frame of the database later than the last time.

        Args:
            row: (d,) as `ViewTable.row` and `PersonTracker.see` give it.
        """
        self._rows.append(row)
        self.belief.see(row)
        labels, count = self.forest.clusters.labels, len(self.clusters)
        followed = np.bincount(labels, self.belief.frames, minlength=count)
        told = self._recogniser.probabilities(np.array(self._rows))
        # The belief is too sure of itself: people differ more than frames do.
        both = np.sqrt(told * (followed + _DOUBT))
        self.clusters = self._fading * self.clusters + (1.0 - self._fading) * both / both.sum()

    def choose(self, frame: int) -> OpenPath:
        """What the avatar does next.

        Args:
            frame: The frame of the graph that it is at.

        Raises:
            UsageError: The frame is not in the graph's component, or nobody has been seen yet.
        """
        if not self._rows:
            raise UsageError("nobody has been seen yet; choose once a row has come")
        config = self._config
        ways = open_paths(self.forest, frame, config.look_ahead_s)
        labels = self.forest.clusters.labels
        steps = max(len(way.frames) for way in ways)
        fading = np.exp(-np.arange(steps) / (config.patience_s * self.table.fps))
        scores = np.array(
            [
                np.average(self.clusters[labels[w.frames]], weights=fading[: len(w.frames)])
                for w in ways
            ]
        )
        good = np.flatnonzero(scores >= scores.max() - config.equal)
        good = good[np.argsort(-scores[good], kind="stable")][: config.compared]
        if len(good) == 1:
            return ways[good[0]]
        seen = np.array(self._rows)[-round(config.buffer_s * self.table.fps) :]
        costs = warped_costs(seen, self.table, self.forest, frame, [ways[k] for k in good])
        return ways[good[int(np.argmin(costs.min(axis=1)))]]


def warped_costs(
    seen: npt.NDArray[np.float32],
    table: ViewTable,
    forest: ClusterForest,
    frame: int,
    ways: Sequence[OpenPath],
) -> FloatArray:
    """How unlike each way is to what was seen, from every viewpoint: the paper's cost.

    Args:
        seen: (m, d) rows of video.
        table: What frames look like.
        forest: Whose ways.
        frame: Where the ways begin.
        ways: The ways; each may go on when the video ends.

    Returns:
        (k, views) mean distance of warped rows. The viewpoint is that of the clip of `frame`; it
        stays where it is when a way goes over into a clip that is turned. The paper takes the
        least of each way.
    """
    views = np.arange(table.views.count)
    planar = forest.graph.database.planar
    pieces, ends = [], [0]
    for way in ways:
        along = np.concatenate([[frame], way.frames]).astype(np.int32)
        turned = forest.root_states_along(along, placement.IDENTITY)[1:, 3] - planar[along[1:], 3]
        shift = np.round(turned / table.views.step).astype(int)
        at = (views[:, None] - shift) % table.views.count
        pieces.append(table.rows[along[1:], at].reshape(-1, table.rows.shape[2]))
        ends += [len(along) - 1] * table.views.count
    warped = warp_onto_rows(
        seen.astype(np.float64), np.concatenate(pieces).astype(np.float64), np.cumsum(ends), True
    )
    return warped.costs.reshape(len(ways), -1) / len(seen)
