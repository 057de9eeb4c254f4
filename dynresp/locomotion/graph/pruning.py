"""Which jumps between frames are worth taking: three pruning rules (Lee et al. 2002, section 4.1).

A jump from frame i to frame j is a pair of steps: the one recorded from i to i + 1, which it
leaves, and the one from j - 1 to j, which it takes in its stead. All pairs of steps are considered.

1. Contact: i and j - 1 have the same contacts, and so have i + 1 and j. In the strict form a
   contact moreover begins or ends from i to i + 1, and the same from j - 1 to j.
2. Likelihood: exp(-D_i,j-1 / sigma) is not below `least_probability`.
3. Similarity: D is the least among (i, j - 1) and its up to eight neighbours (i +- 1, j - 1 +- 1)
   in the same clips that the first two rules have left. Of equal neighbours the one that comes
   first, by the earlier frame and then the later, stays.

A clip's last frame makes no step and so has no jump: the first rule cannot be asked of it. Nothing
is lost with it, since jumps lead from the frame before. Nor is it a jump where i and j - 1 lie in
one clip less than `stutter_s` apart: that skips or repeats a moment. But such pairs and the
recorded way itself, whose distance is zero, do take part in the third rule as neighbours; else the
rim of the strip that they leave would be full of local maxima.

Distances and rules are the same from i to j - 1 as from j - 1 to i, so that every pair of steps is
compared once and serves two jumps. The time grows with the square of the number of frames; memory
grows with the number of frames and of jumps that are left. An index over the frames would gain
little: of the pairs that rule 1 leaves many are close, and most of the time goes into those.
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

# Pairs that a thread holds at most, for which it takes rows in smaller lots: 32 MiB.
_PAIRS_AT_ONCE = 4_000_000
_MOST_ROWS = 256
# Frames of which the directions of the sketch are found.
_SAMPLE = 2000
# Frames that are sketched at once.
_BLOCK = 8192
# Float32 may put the sketches of two frames a little farther apart than the frames are.
_SLACK, _FLOOR = 1.0001, 1e-5
_UPPER = np.triu_indices(4)


@dataclass(frozen=True, eq=False)
class Transitions:
    """Jumps that three rules have left, ordered by source, then by target.

    Attributes:
        sources: (m,) frames i that are left.
        targets: (m,) frames j that are entered.
        distances: (m,) D_i,j-1.
        contact: Number of jumps left by the first rule.
        likelihood: By the second.
        similarity: By the third; None where it is not in force.
    """

    sources: IntArray
    targets: IntArray
    distances: _Single
    contact: int
    likelihood: int
    similarity: int | None


def find_transitions(
    database: MotionDatabase, config: GraphConfig, threads: int = 0
) -> Transitions:
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
    return Transitions(
        sources=sources[order],
        targets=targets[order],
        distances=np.concatenate([distances, distances])[order],
        contact=2 * search.contact,
        likelihood=2 * sum(lot.likelihood for lot in found),
        similarity=2 * len(first) if config.keeps_local_maxima else None,
    )


@dataclass(frozen=True, eq=False)
class _Lot:
    """Pairs first < second of some rows, and how many there were before the third rule."""

    first: IntArray
    second: IntArray
    distances: _Single
    likelihood: int


@dataclass(frozen=True, eq=False)
class _Search:
    """All that the rows of the matrix need; see `distance_kernel.close_pairs`."""

    clip_of: IntArray
    place_of: _Long
    group_stops: _Long
    frame_of: IntArray
    sketch: _Single
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
        """Group the steps of a database by their contacts, and lay frames out for the kernel."""
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
            sketch=_sketch(features, frame_of),
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
        return max(8, min(_MOST_ROWS, _PAIRS_AT_ONCE // longest))

    def jumps(self, rows: tuple[int, int]) -> _Lot:
        """Pairs of steps that the rules leave in some rows of the matrix."""
        from dynresp.locomotion.graph.frame_distance_kernel import close_pairs
        from dynresp.locomotion.graph.pruning_kernel import keep_best_of_neighbours

        # One more row on both sides, where neighbours of the pairs are.
        first, stop = max(rows[0] - 1, 0), min(rows[1] + 1, len(self.clip_of))
        offsets, second, distances = close_pairs(
            first, stop, self.place_of, self.group_stops, self.frame_of, self.sketch, self.packed,
            self.yaws, self.turned, self.cell, self.max_distance * _SLACK + _FLOOR,
            self.max_distance,
        )  # fmt: skip
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
        contact_change: Whether the rule is taken in its strict form.

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
    for apart in range(1, min(stutter, len(groups))):
        same = (groups[apart:] == groups[:-apart]) & (clip_of[apart:] == clip_of[:-apart])
        total -= int(np.count_nonzero(same & (groups[apart:] >= 0)))
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
        # About their middle, where single precision is finest.
        positions = features.positions - np.mean(features.positions, axis=0)
        plain = [*plain, features.linear[frames], positions[frames]]
    numbers = np.concatenate(plain, axis=1)
    packed.reshape(-1, PARTS * LANES)[:, 4 * LANES : 4 * LANES + numbers.shape[1]] = numbers
    return packed, turned


def _sketch(features: FrameFeatures, frames: IntArray) -> _Single:
    """`sketch` of the kernel: few numbers a frame, no farther apart than the frames are.

    Velocities and positions enter as they are, a rotation q by the matrix q q', which does not
    know q from -q: |q q' - r r'|^2 / 2 is the squared sine of half the angle between q and r, so
    never above half the angle squared. What is projected comes no farther apart, whatever the
    directions; those in which a sample of the frames spreads most separate best.
    """
    from threadpoolctl import threadpool_limits

    from dynresp.locomotion.graph.frame_distance_kernel import SKETCH

    sketch = np.empty((SKETCH, len(frames)), dtype=np.float32)
    if len(frames) == 0:
        return sketch
    rows = _embedded(features, frames[:: max(1, len(frames) // _SAMPLE)])
    middle = rows.mean(axis=0)
    # The matrices are small: threads of BLAS would only wait for each other.
    with threadpool_limits(limits=1, user_api="blas"):
        spread = ((rows - middle).T @ (rows - middle)).astype(np.float64)
        directions = np.linalg.eigh(spread)[1][:, : -SKETCH - 1 : -1].astype(np.float32)
        for start in range(0, len(frames), _BLOCK):
            block = slice(start, start + _BLOCK)
            sketch[:, block] = ((_embedded(features, frames[block]) - middle) @ directions).T
    return sketch


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


__all__ = ["Transitions", "find_transitions", "step_groups", "stutter_frames"]
