"""What a time alignment is, and the settings by which it is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class AlignmentConfig:
    """Quality against speed.

    Attributes:
        step_s: Largest distance of the samples along both times [s]; both ends of a range are
            always sampled. The paper's ten frames at 120 a second.
        sets_without_gain: Sampling is cut after this many sets, each with all entries of one exit,
            that hold no better sample than those before. Fewer are faster and need less of the
            simulation; as many as there are exits sample all. With two, the choices of a classifier
            had twice the regret of those with three (1,000 hits, most of them the right reaction
            at a moment up to 40 % worse); the third costs two microseconds.
        starts: From how many samples, none beside another, the descent begins; its best is taken.
        refine: Whether to descend at all; without it the best sample is taken.
        most_iterations: Steps of a descent, at most.
        least_gain: A descent ends where a step brings no more than this share of the error.
    """

    step_s: float = 1.0 / 12.0
    sets_without_gain: int = 3
    starts: int = 1
    refine: bool = True
    most_iterations: int = 20
    least_gain: float = 1e-4

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            UsageError: A value is out of range; the message names it.
        """
        if not 0.0 < self.step_s < math.inf:
            raise UsageError(f"step_s is {self.step_s}; expected a finite number above 0.")
        for name in ("sets_without_gain", "starts", "most_iterations"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} is {getattr(self, name)}; expected at least 1.")
        if not 0.0 <= self.least_gain < 1.0:
            raise UsageError(f"least_gain is {self.least_gain}; expected 0 or more, below 1.")


@dataclass(frozen=True)
class Alignment:
    """Where one reaction fits a simulated trace.

    Attributes:
        reaction: Name of the reaction.
        error: Window error [m].
        exit_frame: When to leave the simulation, in frames after contact; between frames, as a
            rule.
        entry_frame: Where to enter the reaction, in frames of its clip; likewise.
        evaluations: Window errors computed.
        sets: Sets sampled.
        complete: Whether the search ended by itself. False where it ended with the trace: then a
            longer trace may fit better.
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
        errors: Window errors [m].
        exit_frames: Frames after contact.
        entry_frames: Frames of the reactions' clips.
        evaluations: Window errors computed.
        sets: Sets sampled.
        complete: Whether the search ended by itself.
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
