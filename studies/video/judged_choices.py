"""How well an avatar follows what somebody does: shares, lags, and what a constant answer gets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.vision.video_following import FollowStep
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray

WITHIN_S = 1.0
"""An answer is right if it was true at some moment of so long up to now [s]."""
# A change that lasts so long is one; one that is not taken up in so long counts as that [s].
_LASTING_S, _NEVER_S = 1.0, 3.0
# Clusters in which a person is for fewer choices say nothing.
_FEWEST = 10


@dataclass(frozen=True, eq=False)
class Judged:
    """Choices against the truth, one entry a choice.

    Attributes:
        truth: (m,) the actor's cluster at that moment.
        recent: (m, K) whether the actor was in each cluster within the last second.
        chosen: (m,) the cluster to which the chosen path leads.
        recognised: (m,) the cluster in which the person was most probably seen.
        own: (m,) the cluster that the avatar is in.
        lags: (c,) from an actor's change of cluster until it is chosen [s].
    """

    truth: IntArray
    recent: np.ndarray
    chosen: IntArray
    recognised: IntArray
    own: IntArray
    lags: FloatArray

    @classmethod
    def of(
        cls,
        steps: Sequence[FollowStep],
        clusters: Clusters,
        truth: IntArray,
        fps: float,
        empty_s: float,
    ) -> Judged:
        """Compare.

        Args:
            steps: What the avatar did.
            clusters: Those of the database.
            truth: Cluster of every frame of the actor's motion, at the database's rate.
            fps: That rate.
            empty_s: Time until the actor appears [s].
        """
        second = round(WITHIN_S * fps)
        kept = []
        for step in steps:
            now = int((step.time_s - empty_s) * fps + 1e-9)
            if second <= now < len(truth) and step.cluster is not None and len(step.frames):
                label = int(clusters.labels[step.frames[-1]])
                kept.append((now, step.cluster, step.person_cluster, label))
        at, chosen, recognised, own = np.array(kept, dtype=np.int32).reshape(-1, 4).T
        recent = np.zeros((len(at), len(clusters.mixture)), dtype=bool)
        for back in range(second + 1):
            recent[np.arange(len(at)), truth[at - back]] = True
        lags = _lags(at, chosen, truth, fps)
        return cls(truth[at].astype(np.int32), recent, chosen, recognised, own, lags)

    @classmethod
    def joined(cls, parts: Sequence[Judged]) -> Judged:
        """Several takes of one person."""
        names = ("truth", "recent", "chosen", "recognised", "own", "lags")
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def right(self, answers: IntArray | int) -> np.ndarray:
        """(m,) whether answers were true within the last second."""
        return np.asarray(self.recent[np.arange(len(self.truth)), answers])

    def balanced(self, answers: IntArray | int) -> float:
        """Share of right answers in each of the person's clusters, and the mean of these."""
        right = self.right(answers)
        sizes = np.bincount(self.truth, minlength=self.recent.shape[1])
        return float(np.mean([right[self.truth == k].mean() for k in _often(sizes)]))


def _often(sizes: np.ndarray) -> np.ndarray:
    often = np.flatnonzero(sizes >= _FEWEST)
    return often if len(often) else np.array([int(sizes.argmax())])


def _lags(at: IntArray, chosen: IntArray, truth: IntArray, fps: float) -> FloatArray:
    """How long after each change of the truth the answer follows [s]."""
    lasting, never = round(_LASTING_S * fps), round(_NEVER_S * fps)
    lags = []
    changes = np.flatnonzero(truth[1:] != truth[:-1]) + 1
    for change in changes:
        after = truth[change : change + never]
        stays = len(after) if (after == after[0]).all() else int((after != after[0]).argmax())
        if change <= lasting or stays < lasting:
            continue
        due = (at >= change) & (at < change + never) & (chosen == truth[change])
        lags.append((at[due][0] - change) / fps if due.any() else _NEVER_S)
    return np.array(lags, dtype=np.float64)
