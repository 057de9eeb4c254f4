"""Find the jumps of a motion graph by three pruning rules (Lee et al. 2002, section 4.1).

A jump from frame i to frame j replaces the recorded step from i to i + 1 by the recorded step from
j - 1 to j. All pairs of steps are considered.

1. Contact: i and j - 1 have the same contacts, and so have i + 1 and j. In the strict form a
   contact also begins or ends from i to i + 1, and the same one from j - 1 to j.
2. Likelihood: exp(-D_i,j-1 / sigma) is not below `least_probability`.
3. Similarity: D is the least among (i, j - 1) and its up to eight neighbours (i +- 1, j - 1 +- 1)
   in the same clips that the first two rules have left. Among equal neighbours the first stays, in
   the order of the earlier frame, then of the later.

A clip's last frame begins no step, so it has no jump; the frame before it can have the same jumps.
Pairs with i and j - 1 in one clip and less than `stutter_s` apart are no jumps, since they skip or
repeat a moment. But these pairs, and the recorded step itself, whose distance is zero, count as
neighbours in the third rule; otherwise many pairs beside them would be local maxima.

Distances and rules are symmetric, so every pair of steps is compared once and gives two jumps. The
time grows with the square of the number of frames, memory with the number of frames and of jumps
that are left. An index over the frames would gain little: many of the pairs that rule 1 leaves are
close, and most of the time goes into those.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.frame_distance import FrameFeatures, frame_features, quarter_turned
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.support.arrays import IntArray

_Single = npt.NDArray[np.float32]
_Long = npt.NDArray[np.int64]

# Largest number of pairs that a thread holds, 32 MiB; it limits the rows of a lot.
_PAIRS_AT_ONCE = 4_000_000
_MAX_ROWS = 256
# Frames from which the directions of the bound vectors are computed.
_SAMPLE = 2000
# Frames that are projected at once.
_BLOCK = 8192
# Rounding in float32 may make a bound a little larger than the distance.
_SLACK, _FLOOR = 1.0001, 1e-5
_UPPER = np.triu_indices(4)


@dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps that three rules leave, sorted by source, then by target.

    Attributes:
        sources: (m,) frames i that are left.
        targets: (m,) frames j that are entered.
        distances: (m,) D_i,j-1.
        contact: Number of jumps left by the first rule.
        likelihood: By the second rule.
        similarity: By the third rule; None if it is not used.
    """

    sources: IntArray
    targets: IntArray
    distances: _Single
    contact: int
    likelihood: int
    similarity: int | None


def find_jumps(database: MotionDatabase, config: GraphConfig, threads: int = 0) -> Jumps:
    """Find the jumps of a database.

    Args:
        database: The frames.
        config: Coordinates, rules and thresholds.
        threads: Threads, 0 for all cores; the result is the same bit for bit.

    Raises:
        MotionError: A pose or a velocity is not finite.
    """
    search = _Search.of(database, config)
    lots = [
        (start, min(start + search.rows_at_once, len(database)))
        for start in range(0, len(database), search.rows_at_once)
    ]
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        found = list(pool.map(search.jumps, lots))
    first = np.concatenate([lot.first for lot in found])
    second = np.concatenate([lot.second for lot in found])
    distances = np.concatenate([lot.distances for lot in found])
    sources = np.concatenate([first, second])
    targets = np.concatenate([second, first]) + np.int32(1)
    order = np.argsort(sources.astype(np.int64) * len(database) + targets)
    return Jumps(
        sources=sources[order],
        targets=targets[order],
        distances=np.concatenate([distances, distances])[order],
        contact=2 * search.contact,
        likelihood=2 * sum(lot.likelihood for lot in found),
        similarity=2 * len(first) if config.keeps_local_maxima else None,
    )


@dataclass(frozen=True, eq=False)
class _Lot:
    """Pairs first < second of some rows, and how many the second rule left."""

    first: IntArray
    second: IntArray
    distances: _Single
    likelihood: int


@dataclass(frozen=True, eq=False)
class _Search:
    """Data for all rows of the matrix; see `frame_distance_kernel.close_pairs`."""

    clip_of: IntArray
    place_of: _Long
    group_stops: _Long
    frame_of: IntArray
    bounds: _Single
    packed: _Single
    yaws: _Single
    turned: _Single
    cell: _Single
    max_distance: float
    stutter: int
    keeps_local_maxima: bool
    contact: int

    @classmethod
    def of(cls, database: MotionDatabase, config: GraphConfig) -> _Search:
        """Group the steps of a database by their contacts, and arrange frames for the kernel."""
        features = frame_features(database.poses, database.velocities, config)
        stutter = stutter_frames(config)
        groups = step_groups(database.contact_states, database.successors, config.contact_change)
        steps = np.flatnonzero(groups >= 0)
        frame_of = steps[np.argsort(groups[steps], kind="stable")].astype(np.int32)
        place_of = np.full(len(database), -1, dtype=np.int64)
        place_of[frame_of] = np.arange(len(frame_of))
        group_stops = np.zeros(len(database), dtype=np.int64)
        group_stops[frame_of] = np.searchsorted(groups[frame_of], groups[frame_of], side="right")
        packed, turned = _packed(features, frame_of)
        return cls(
            clip_of=database.clip_of,
            place_of=place_of,
            group_stops=group_stops,
            frame_of=frame_of,
            bounds=_bound_vectors(features, frame_of),
            packed=packed,
            yaws=features.yaws[frame_of].astype(np.float32),
            turned=turned,
            cell=features.cell.astype(np.float32),
            max_distance=config.max_distance,
            stutter=stutter,
            keeps_local_maxima=config.keeps_local_maxima,
            contact=_count_pairs(groups, database.clip_of, stutter),
        )

    @property
    def rows_at_once(self) -> int:
        """Rows of a lot."""
        longest = int(np.max(self.group_stops - self.place_of, initial=1))
        return max(8, min(_MAX_ROWS, _PAIRS_AT_ONCE // longest))

    def jumps(self, rows: tuple[int, int]) -> _Lot:
        """Pairs of steps that the rules leave in some rows of the matrix."""
        from dynresp.locomotion.graph.frame_distance_kernel import (
            Groups,
            PackedFrames,
            close_pairs,
        )
        from dynresp.locomotion.graph.pruning_kernel import keep_best_of_neighbours

        # One more row on both sides, which has neighbours of the pairs.
        first, stop = max(rows[0] - 1, 0), min(rows[1] + 1, len(self.clip_of))
        offsets, second, distances = close_pairs(
            first,
            stop,
            Groups(self.place_of, self.group_stops, self.frame_of),
            PackedFrames(self.bounds, self.packed, self.yaws, self.turned, self.cell),
            self.max_distance * _SLACK + _FLOOR,
            self.max_distance,
        )
        own = slice(offsets[rows[0] - first], offsets[rows[1] - first])
        frames = np.arange(first, stop, dtype=np.int32)
        sources = np.repeat(frames, np.diff(offsets))
        jumps = np.zeros(len(second), dtype=bool)
        jumps[own] = (second[own] - sources[own] >= self.stutter) | (
            self.clip_of[second[own]] != self.clip_of[sources[own]]
        )
        likelihood = int(np.count_nonzero(jumps))
        if self.keeps_local_maxima:
            best = np.empty(len(second), dtype=bool)
            keep_best_of_neighbours(first, offsets, second, distances, self.clip_of, best)
            jumps &= best
        return _Lot(sources[jumps], second[jumps], distances[jumps], likelihood)


def stutter_frames(config: GraphConfig) -> int:
    """Least number of frames between i and j - 1 of a jump within a clip, at least one."""
    return max(1, math.ceil(config.stutter_s * config.fps - 1e-9))


def step_groups(states: npt.NDArray[np.uint8], successors: IntArray, contact_change: bool) -> _Long:
    """Groups of steps between which the first rule allows jumps.

    Args:
        states: (n,) contacts of each frame.
        successors: (n,) the frame after each, -1 at the end of a clip.
        contact_change: Whether the rule has its strict form.

    Returns:
        (n,) group of the step from each frame, -1 where it has no jump.
    """
    before, after = states.astype(np.int64), states[successors].astype(np.int64)
    allowed = successors >= 0
    if contact_change:
        allowed &= before != after
    return np.where(allowed, 256 * before + after, -1)


def _count_pairs(groups: _Long, clip_of: IntArray, stutter: int) -> int:
    """Pairs i < j of steps of one group, without those that would stutter."""
    sizes = np.unique(groups[groups >= 0], return_counts=True)[1].tolist()
    total = sum(size * (size - 1) // 2 for size in sizes)
    for gap in range(1, min(stutter, len(groups))):
        same = (groups[gap:] == groups[:-gap]) & (clip_of[gap:] == clip_of[:-gap])
        total -= int(np.count_nonzero(same & (groups[gap:] >= 0)))
    return total


def _packed(features: FrameFeatures, frames: IntArray) -> tuple[_Single, _Single]:
    """`packed` and `turned` of the kernel, in the order of the frames given."""
    from dynresp.locomotion.graph.frame_distance_kernel import LANES, PARTS

    on_blocks = features.config.coordinates is Coordinates.BLOCKS
    packed = np.zeros((len(frames), PARTS, LANES), dtype=np.float32)
    quaternions = packed[:, :4]
    quaternions[:, 0] = 1.0
    joints = features.joints.shape[1]
    quaternions[:, :, :joints] = features.joints[frames].transpose(0, 2, 1)
    plain: Sequence[npt.NDArray[np.float64]] = [features.rates[frames]]
    turned = np.zeros((0, 4, 10), dtype=np.float32)
    if on_blocks:
        turned = np.concatenate(quarter_turned(features), axis=2)[frames].astype(np.float32)
    else:
        quaternions[:, :, joints] = features.orientations[frames]
        # Relative to their mean, where single precision is finest.
        positions = features.positions - np.mean(features.positions, axis=0)
        plain = [*plain, features.linear[frames], positions[frames]]
    numbers = np.concatenate(plain, axis=1)
    packed.reshape(-1, PARTS * LANES)[:, 4 * LANES : 4 * LANES + numbers.shape[1]] = numbers
    return packed, turned


def _bound_vectors(features: FrameFeatures, frames: IntArray) -> _Single:
    """`bounds` of the kernel: few numbers a frame, no farther apart than the frames are.

    Velocities and positions enter as they are, a rotation q by the matrix q q', which is the same
    for q and -q: |q q' - r r'|^2 / 2 is the squared sine of half the angle between q and r, so
    never above half the angle squared. A projection increases no distance, whatever the directions;
    those in which a sample of the frames varies most give the best bounds.
    """
    from threadpoolctl import threadpool_limits

    from dynresp.locomotion.graph.frame_distance_kernel import BOUND_SIZE

    bounds = np.empty((BOUND_SIZE, len(frames)), dtype=np.float32)
    if len(frames) == 0:
        return bounds
    rows = _embedded(features, frames[:: max(1, len(frames) // _SAMPLE)])
    middle = rows.mean(axis=0)
    # The matrices are small: threads of BLAS would only slow this down.
    with threadpool_limits(limits=1, user_api="blas"):
        spread = ((rows - middle).T @ (rows - middle)).astype(np.float64)
        directions = np.linalg.eigh(spread)[1][:, : -BOUND_SIZE - 1 : -1].astype(np.float32)
        for start in range(0, len(frames), _BLOCK):
            block = slice(start, start + _BLOCK)
            bounds[:, block] = ((_embedded(features, frames[block]) - middle) @ directions).T
    return bounds


def _embedded(features: FrameFeatures, frames: IntArray) -> _Single:
    """Frames as points whose squared distances are at most those of the frames."""
    quaternions = features.joints[frames]
    plain = [features.rates[frames]]
    if features.config.coordinates is not Coordinates.BLOCKS:
        roots = features.orientations[frames, None]
        quaternions = np.concatenate([quaternions, roots], axis=1)
        positions = features.positions[frames] - np.mean(features.positions, axis=0)
        plain += [features.linear[frames], positions]
    # Off the diagonal, entries of the matrix count twice.
    share = np.where(_UPPER[0] == _UPPER[1], math.sqrt(0.5), 1.0)
    products = quaternions[..., _UPPER[0]] * quaternions[..., _UPPER[1]] * share
    rows = np.concatenate([products.reshape(len(frames), -1), *plain], axis=1)
    return rows.astype(np.float32)


__all__ = ["Jumps", "find_jumps", "step_groups", "stutter_frames"]
