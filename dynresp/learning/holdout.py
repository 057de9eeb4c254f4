"""Split samples into held-out and training samples, by a hash of each sample's index.

The part of a sample does not depend on the number or the order of the samples. So a classifier is
measured on the same samples after the dataset has grown, or when it is trained on fewer samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

IndexArray = npt.NDArray[np.intp]

_HELD_OUT, _TAKEN, _SEARCHED = 1, 2, 3
# The finaliser and the increment of SplitMix64 (Steele, Lea, Flood 2014: Fast splittable
# pseudorandom number generators).
_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB))


@dataclass(frozen=True)
class Split:
    """How samples are split.

    Attributes:
        seed: Of the random split.
        held_out: Share of the samples that are not trained on, at least 0 and below 1.
    """

    seed: int = 0
    held_out: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is out of range.
        """
        if not 0.0 <= self.held_out < 1.0:
            raise UsageError(
                f"the share held out must be at least 0 and below 1, got {self.held_out:g}"
            )
        if not 0 <= self.seed < 2**63:
            raise UsageError(f"the seed must be from 0 to 2^63 - 1, got {self.seed}")

    def is_held_out(self, index: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether samples are held out.

        Args:
            index: (n,) their numbers in the dataset.
        """
        return self._random(index, _HELD_OUT) < self.held_out

    def trained(self, index: npt.ArrayLike, samples: int | None = None) -> IndexArray:
        """Rows to train on, in the order of the samples' indices.

        Fewer samples are always a subset of more.

        Args:
            index: (n,) numbers in the dataset.
            samples: At most this many; None for all that are not held out.

        Returns:
            Rows of `index`.
        """
        numbers = np.asarray(index)
        rows = np.flatnonzero(~self.is_held_out(numbers))
        return rows[self._first(numbers[rows], samples, _TAKEN)]

    def searched(self, index: npt.ArrayLike, samples: int) -> IndexArray:
        """At most this many rows to search parameters on, in the order of the samples' indices."""
        return self._first(np.asarray(index), samples, _SEARCHED)

    def folds(self, index: npt.ArrayLike, labels: npt.ArrayLike, count: int) -> IndexArray:
        """The fold of each sample, every class spread evenly over the folds.

        Args:
            index: (n,) numbers in the dataset.
            labels: (n,) classes.
            count: How many folds.

        Returns:
            (n,) from 0 to `count` - 1. Two samples of one class that has no others are in
            different folds.
        """
        order = np.lexsort((self._random(index, _SEARCHED), np.asarray(labels)))
        folds = np.empty(len(order), dtype=np.intp)
        folds[order] = np.arange(len(order)) % count
        return folds

    def _first(self, index: npt.NDArray[np.integer], samples: int | None, use: int) -> IndexArray:
        """At most this many random rows, or all, in the order of their indices."""
        rows = np.lexsort((index, self._random(index, use)))[:samples]
        return rows[np.argsort(index[rows], kind="stable")]

    def _random(self, index: npt.ArrayLike, use: int) -> FloatArray:
        """A random number from 0 to below 1 for each sample and use."""
        state = _mix_bits(np.array([self.seed], dtype=np.uint64) + np.uint64(use) * _steps(1))
        bits = _mix_bits(np.asarray(index).astype(np.uint64) * _STEP + state)
        return (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53


def _steps(count: int) -> npt.NDArray[np.uint64]:
    return np.full(count, _STEP)


def _mix_bits(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Every bit of the result depends on every bit given; arithmetic is modulo 2^64."""
    for shift, factor in _MIX:
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    return bits ^ (bits >> np.uint64(31))
