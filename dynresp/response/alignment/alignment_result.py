"""The result of a time alignment (exit and entry), and its settings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number

LEAST_GAIN = 1e-4
"""A descent ends where a step lowers the mismatch by no more than this share of it."""


@dataclass(frozen=True)
class AlignmentConfig:
    """Settings that weigh quality against speed.

    Attributes:
        step_s: Largest step of the samples along both times [s]; both ends of a range are always
            sampled. The paper's ten frames at 120 a second.
        sets_without_gain: Sampling ends after this many sets, each with all entries of one exit,
            that have no better sample than the sets before. Fewer are faster and need less of the
            simulation; as many as there are exits sample all. With two, the choices of a classifier
            had twice the regret of those with three (1,000 hits; most had the right reaction with
            a mismatch up to 40 % larger); the third costs two microseconds.
        starts: Number of samples, no two of them neighbours, from which a descent begins; the best
            result counts.
        refine: Whether to descend at all; if not, the best sample is the result.
        most_iterations: Steps of a descent, at most.
    """

    step_s: float = 1.0 / 12.0
    sets_without_gain: int = 3
    starts: int = 1
    refine: bool = True
    most_iterations: int = 20

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            UsageError: A value is out of range; the message names it.
        """
        check_number("step_s", self.step_s, 0.0, unit="s", above_low=True)
        for name in ("sets_without_gain", "starts", "most_iterations"):
            check_number(name, getattr(self, name), 1, whole=True)


@dataclass(frozen=True)
class Alignment:
    """Exit and entry where one reaction fits a simulated trace best.

    Attributes:
        reaction: Name of the reaction.
        error: Mismatch (window error) [m].
        exit_frame: Exit, in frames after contact; usually between two frames.
        entry_frame: Entry, in frames of the reaction's clip; usually between two frames.
        evaluations: Mismatches computed.
        sets: Sets sampled.
        complete: Whether sampling ended by itself. False where it ended because the trace did; a
            longer trace may then fit better.
        refined: Whether a descent improved on the best sample.
    """

    reaction: str
    error: float
    exit_frame: float
    entry_frame: float
    evaluations: int
    sets: int
    complete: bool
    refined: bool


@dataclass(frozen=True)
class Alignments:
    """Alignments of many traces; all arrays have the shape of `rows`, fields as in `Alignment`.

    Attributes:
        names: Names of all reactions.
        rows: Which reactions were aligned, as indices into `names`.
        errors: Mismatches (window errors) [m].
        exit_frames: Frames after contact.
        entry_frames: Frames of the reactions' clips.
        evaluations: Mismatches computed.
        sets: Sets sampled.
        complete: Whether sampling ended by itself.
        refined: Whether a descent improved on the best sample.
    """

    names: tuple[str, ...]
    rows: npt.NDArray[np.int64]
    errors: FloatArray
    exit_frames: FloatArray
    entry_frames: FloatArray
    evaluations: npt.NDArray[np.int64]
    sets: npt.NDArray[np.int64]
    complete: npt.NDArray[np.bool_]
    refined: npt.NDArray[np.bool_]
