"""Index of a graph's frames that finds the frame most like a pose.

The distance is the graph's own (eq. 2 and 3). Only few pairs of a pose and a frame are computed in
full: each has a vector of few numbers, and the squared distance of two such vectors is a lower
bound of the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_distance import (
    JOINT_WEIGHTS,
    FrameFeatures,
    frame_distances,
    frame_features,
)
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import MotionError

# Bits of the feet in a contact state.
_FEET = 3
# Numbers of a bound vector, besides the length of what the projection leaves out.
_BOUND_SIZE = 32
# What single precision may add to the squared distance of two bound vectors.
_SLACK = 1e-3
# The arms' joints among those that are compared, and the others.
_COMPARED = [name for name, weight in JOINT_WEIGHTS.items() if weight]
_FREE = [i for i, name in enumerate(_COMPARED) if name.endswith(("shoulder", "elbow"))]
_STEADY = [i for i in range(len(_COMPARED)) if i not in _FREE]
# Poses that are looked up at once.
_BLOCK = 64


@dataclass(frozen=True, eq=False)
class NearestFrames:
    """The frames of a graph that resemble each of some poses most.

    Attributes:
        frames: (m,) of the graph's database; (m, count) from `EntryIndex.nearest_several`, and
            the others likewise.
        distances: (m,) how unlike they are (eq. 2).
        same_contacts: (m,) whether the same feet stand.
    """

    frames: IntArray
    distances: FloatArray
    same_contacts: npt.NDArray[np.bool_]


class EntryIndex:
    """Frames of a graph, indexed to find those that resemble a pose.

    Attributes:
        graph: The graph.
        frames: (k,) the indexed frames, ascending.
    """

    def __init__(self, graph: MotionGraph, frames: npt.ArrayLike | None = None) -> None:
        """Index frames.

        Args:
            graph: The graph.
            frames: The frames to index, by default all of the graph's component.

        Raises:
            MotionError: There is no frame.
        """
        self.graph = graph
        self.frames: IntArray = np.array(graph.frames if frames is None else frames, np.int32)
        if not len(self.frames):
            raise MotionError("an index of entries needs at least one frame; none was given")
        database = graph.database
        self._features = frame_features(
            database.poses[self.frames], database.velocities[self.frames], graph.config
        )
        rows = _rows(self._features)
        self._center = rows.mean(axis=0)
        rows -= self._center
        # The directions in which the frames differ most. An orthogonal projection increases no
        # distance.
        _, vectors = np.linalg.eigh(rows.T @ rows)
        self._axes = vectors[:, ::-1][:, :_BOUND_SIZE].copy()
        bounds = self._projected(rows)
        feet = database.contact_states[self.frames] & _FEET
        # Rows of the frames in which the same feet stand, for each state; then all rows.
        self._rows_of = [np.flatnonzero(feet == state) for state in range(_FEET + 1)]
        self._rows_of.append(np.arange(len(self.frames)))
        self._bound_vectors = [bounds[rows].T.copy() for rows in self._rows_of]

    def nearest(
        self,
        poses: FloatArray,
        velocities: FloatArray,
        contacts: npt.NDArray[np.bool_],
        max_distance: float = np.inf,
    ) -> NearestFrames:
        """The frame that resembles each pose most, among those in which the same feet stand.

        If none of those is near enough, among all.

        Args:
            poses: (m, 59).
            velocities: (m, 45) rows of `qvel`.
            contacts: (m, 2) whether the left and the right foot stand.
            max_distance: Frames farther than this are not near enough. Where no frame is near
                enough, the one returned need not be the nearest.
        """
        features, vectors, standing = self._prepared(poses, velocities, contacts)
        places, distances = np.zeros(len(vectors), np.intp), np.full(len(vectors), np.inf)

        def look_up(rows: npt.NDArray[np.intp], state: int) -> None:
            if len(rows) and len(self._rows_of[state]):
                for block in np.array_split(rows, -(-len(rows) // _BLOCK)):
                    found = self._look_up(features, vectors, block, state, max_distance)
                    places[block], distances[block] = found

        for state in range(_FEET + 1):
            look_up(np.flatnonzero(standing == state), state)
        same = np.isfinite(distances) & (distances <= max_distance)
        look_up(np.flatnonzero(~same), _FEET + 1)
        return NearestFrames(self.frames[places], distances, same)

    def nearest_several(
        self,
        poses: FloatArray,
        velocities: FloatArray,
        contacts: npt.NDArray[np.bool_],
        count: int,
        max_distance: float = np.inf,
    ) -> NearestFrames:
        """The nearest frame to each pose, and others that are almost as near.

        The others have the smallest lower bounds; they need not be the next in order of distance.

        Args:
            poses: (m, 59).
            velocities: (m, 45) rows of `qvel`.
            contacts: (m, 2) whether the left and the right foot stand.
            count: How many for each pose, 1 or more; if there are fewer, the nearest is repeated.
            max_distance: See `nearest`.

        Returns:
            (m, count) each; the nearest is the first.
        """
        best = self.nearest(poses, velocities, contacts, max_distance)
        features, vectors, standing = self._prepared(poses, velocities, contacts)
        standing = np.where(best.same_contacts, standing, _FEET + 1)
        frames = np.repeat(best.frames[:, None], count, axis=1)
        distances = np.repeat(best.distances[:, None], count, axis=1)
        for state in range(_FEET + 2):
            least = min(count, len(self._rows_of[state]) + 1) - 1
            rows = np.flatnonzero(standing == state)
            if not len(rows) or not least:
                continue
            for block in np.array_split(rows, -(-len(rows) // _BLOCK)):
                bounds = self._bounds(vectors[block], state)
                columns = np.argpartition(bounds, least - 1, axis=1)[:, :least]
                others = self._rows_of[state][columns]
                frames[block, 1 : least + 1] = self.frames[others]
                distances[block, 1 : least + 1] = self._distances(
                    features, np.repeat(block, least), others.ravel()
                ).reshape(others.shape)
        return NearestFrames(
            frames, distances, np.repeat(best.same_contacts[:, None], count, axis=1)
        )

    def _prepared(
        self, poses: FloatArray, velocities: FloatArray, contacts: npt.NDArray[np.bool_]
    ) -> tuple[FrameFeatures, npt.NDArray[np.float32], npt.NDArray[np.intp]]:
        """Poses as they are compared: in full, as bound vectors, and which feet stand (bits)."""
        features = frame_features(poses, velocities, self.graph.config)
        vectors = self._projected(_rows(features) - self._center)
        return features, vectors, np.asarray(contacts, dtype=np.intp) @ np.array([1, 2])

    def _bounds(self, own: npt.NDArray[np.float32], state: int) -> npt.NDArray[np.float32]:
        """Lower bounds of the distances between poses and the frames of a state (rows, k)."""
        others = self._bound_vectors[state]
        least = np.sum(others**2, axis=0) - 2.0 * (own @ others)
        least += (np.sum(own**2, axis=1) - np.float32(_SLACK))[:, None]
        bounds: npt.NDArray[np.float32] = least
        return bounds

    def _look_up(
        self,
        features: FrameFeatures,
        vectors: npt.NDArray[np.float32],
        rows: npt.NDArray[np.intp],
        state: int,
        max_distance: float,
    ) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """Row and distance of the frame of a state that is nearest to each of some poses."""
        least = self._bounds(vectors[rows], state)
        first = least.argmin(axis=1)
        bound = self._distances(features, rows, self._rows_of[state][first])
        close = least <= np.minimum(bound, max_distance)[:, None]
        close[np.arange(len(rows)), first] = True
        moment, column = np.nonzero(close)
        found = self._distances(features, rows[moment], self._rows_of[state][column])
        # The least of each pose; among equals the first.
        order = np.lexsort((column, found, moment))
        best = order[np.searchsorted(moment[order], np.arange(len(rows)))]
        return self._rows_of[state][column[best]], found[best]

    def _distances(
        self,
        features: FrameFeatures,
        moments: npt.NDArray[np.intp],
        places: npt.NDArray[np.intp],
    ) -> FloatArray:
        """(k,) distances between poses and frames, pair by pair."""
        own = np.arange(len(moments))
        both = _paired(features, moments, self._features, places)
        return frame_distances(both, own, own + len(moments))

    def _projected(self, rows: FloatArray) -> npt.NDArray[np.float32]:
        """Centred rows along the axes, and the length of the rest (n, 33)."""
        along = rows @ self._axes
        rest = np.sum(rows**2, axis=1) - np.sum(along**2, axis=1)
        return np.column_stack([along, np.sqrt(np.maximum(rest, 0.0))]).astype(np.float32)


def _paired(
    a: FrameFeatures, rows: npt.NDArray[np.intp], b: FrameFeatures, others: npt.NDArray[np.intp]
) -> FrameFeatures:
    """Rows of one, then rows of the other."""
    return FrameFeatures(
        a.config,
        np.concatenate([a.positions[rows], b.positions[others]]),
        np.concatenate([a.orientations[rows], b.orientations[others]]),
        np.concatenate([a.yaws[rows], b.yaws[others]]),
        np.concatenate([a.joints[rows], b.joints[others]]),
        np.concatenate([a.linear[rows], b.linear[others]]),
        np.concatenate([a.rates[rows], b.rates[others]]),
    )


def _rows(features: FrameFeatures) -> FloatArray:
    """(n, d) numbers whose squared differences add up to no more than the distance.

    The chord between two quaternions is at most half the angle between the rotations, if their
    signs are right. For legs and trunk, which never turn by half a turn, w >= 0 makes them right.
    For pelvis and arms the product of the quaternion with itself is used, which has no sign: two
    products differ by the sine of half the angle.
    """
    n = len(features)
    steady = features.joints[:, _STEADY]
    signed = np.where(steady[..., :1] < 0.0, -steady, steady)
    free = features.joints[:, _FREE]
    columns = [features.rates, signed.reshape(n, -1)]
    if features.config.coordinates is not Coordinates.BLOCKS:
        free = np.concatenate([features.orientations[:, None], free], axis=1)
        columns += [features.positions, features.linear]
    i, j = np.triu_indices(4)
    scale = np.where(i == j, np.sqrt(0.5), 1.0)
    columns.append((scale * free[..., i] * free[..., j]).reshape(n, -1))
    return np.concatenate(columns, axis=1)
