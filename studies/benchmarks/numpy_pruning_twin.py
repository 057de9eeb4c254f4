"""Pruning of a motion graph in vectorised NumPy: what `graph_speed` compares with.

Blocks of rows of the matrix, every pair that the first rule allows, the same distances and rules
as `dynresp.locomotion.graph.pruning`, in float64. As there, a pair is compared once for its two
jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.frame_distance import FrameFeatures, frame_distances, frame_features
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.pruning import step_groups, stutter_frames
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray

# Pairs compared at once: what is gathered for them, about 200 MiB, is reused.
_AT_ONCE = 100_000
# Of the eight neighbours of a pair those that come before it and after it.
_BEFORE = ((-1, -1), (-1, 0), (-1, 1), (0, -1))
_AFTER = ((0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, eq=False)
class Block:
    """Pairs that the first two rules leave in some rows.

    Attributes:
        start: The first row.
        distances: (rows + 2, n) with one more row on both sides; infinite where a pair is left out.
        compared: How many pairs were compared.
    """

    start: int
    distances: FloatArray
    compared: int


@dataclass(frozen=True, eq=False)
class NumpyPruning:
    """The first three rules, block by block.

    Attributes:
        config: Settings.
        features: Of all frames.
        groups: (n,) see `step_groups`.
        clip_of: (n,) clip of each frame.
    """

    config: GraphConfig
    features: FrameFeatures
    groups: npt.NDArray[np.int64]
    clip_of: IntArray

    @classmethod
    def of(cls, database: MotionDatabase, config: GraphConfig) -> NumpyPruning:
        """Prepare the frames of a database."""
        features = frame_features(database.poses, database.velocities, config)
        groups = step_groups(database.contact_states, database.successors, config.contact_change)
        return cls(config, features, groups, database.clip_of)

    def block(self, start: int, stop: int) -> Block:
        """Compare the frames of some rows with all that come after them."""
        n = len(self.groups)
        rows = np.arange(max(start - 1, 0), min(stop + 1, n))
        allowed = (self.groups[rows, None] == self.groups) & (self.groups[rows, None] >= 0)
        allowed &= np.arange(n) > rows[:, None]
        first, second = np.nonzero(allowed)
        distances = np.full((stop - start + 2, n), np.inf)
        for at in range(0, len(first), _AT_ONCE):
            i, j = first[at : at + _AT_ONCE], second[at : at + _AT_ONCE]
            found = frame_distances(self.features, rows[i], j)
            found[found > self.config.max_distance] = np.inf
            distances[rows[i] - (start - 1), j] = found
        return Block(start, distances, len(first))

    def jumps(self, block: Block, margin: float = 0.0) -> BoolArray:
        """Which pairs of a block's own rows the third rule leaves, where it is in force.

        Args:
            block: The pairs.
            margin: How much the distance of a pair must be below those of its neighbours.

        Returns:
            (rows, n).
        """
        own = block.distances[1:-1]
        rows = np.arange(block.start, block.start + len(own))[:, None]
        columns = np.arange(own.shape[1])
        far = columns - rows >= stutter_frames(self.config)
        left = np.isfinite(own) & (far | (self.clip_of[rows] != self.clip_of))
        if self.config.keeps_local_maxima:
            left &= own < self._least(block, _BEFORE) - margin
            left &= own <= self._least(block, _AFTER) - margin
        return left

    def _least(self, block: Block, neighbours: tuple[tuple[int, int], ...]) -> FloatArray:
        """(rows, n) least distance of some neighbours in the same clips."""
        own = block.distances[1:-1]
        rows = np.arange(block.start, block.start + len(own))
        least = np.full(own.shape, np.inf)
        padded = np.pad(block.distances, ((0, 0), (1, 1)), constant_values=np.inf)
        for down, along in neighbours:
            near = padded[1 + down : 1 + down + len(own), 1 + along : 1 + along + own.shape[1]]
            same = self._same_clip(rows, down)[:, None] & self._same_clip(
                np.arange(own.shape[1]), along
            )
            np.minimum(least, np.where(same, near, np.inf), out=least)
        return least

    def _same_clip(self, frames: npt.NDArray[np.intp], shift: int) -> BoolArray:
        """Whether frames are in one clip with those a little before or after them."""
        shifted = np.clip(frames + shift, 0, len(self.clip_of) - 1)
        return self.clip_of[frames] == self.clip_of[shifted]
