"""The full search (oracle): compares all exits with all entries of all reactions.

It compares them by the mismatch (window error) of Zordan et al. 2007 (section 5). It labels the
training data of the classifier, and faster alignments are measured against it.

A mismatch in float32 agrees with exact arithmetic within 1e-4 relative plus `ERROR_FLOOR`; two
searches of the same windows agree in every bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.response.windows.windows import LANES, LibraryWindows, WindowSet
from dynresp.support.arrays import frozen
from dynresp.support.errors import MotionError

if TYPE_CHECKING:
    from dynresp.response.windows.window_kernel import Best

ERROR_FLOOR = 2e-5
"""Absolute uncertainty of a mismatch [m], for 14 bodies a few metres from the pelvis and weights of
about one: what float32 leaves where two windows are equal."""


@dataclass(frozen=True)
class Match:
    """Exit and entry where a reaction fits the simulation best.

    Attributes:
        reaction: Name of the reaction.
        error: Mismatch (window error) [m], weighted and summed over the bodies.
        exit_frame: Frame of the trace, counted from contact.
        entry_frame: Frame of the reaction clip.
    """

    reaction: str
    error: float
    exit_frame: int
    entry_frame: int


@dataclass(frozen=True)
class ErrorSurface:
    """Mismatches (window errors) of one reaction for all exits and entries.

    Attributes:
        errors: (exits, entries) [m], float32.
        exit_frames: (exits,) frames of the trace.
        entry_frames: (entries,) frames of the reaction clip.
    """

    errors: npt.NDArray[np.float32]
    exit_frames: npt.NDArray[np.int64]
    entry_frames: npt.NDArray[np.int64]


@dataclass(frozen=True)
class FullSearchResult:
    """What a full search found.

    Attributes:
        names: Names of the reactions, in the order of the library.
        errors: (reactions,) least mismatch of each [m], float32.
        exit_frames: (reactions,) its exit, a frame of the trace.
        entry_frames: (reactions,) its entry, a frame of the reaction clip.
        trace: Windows of the simulated trace.
        library: Windows of the reactions.
    """

    names: tuple[str, ...]
    errors: npt.NDArray[np.float32]
    exit_frames: npt.NDArray[np.int64]
    entry_frames: npt.NDArray[np.int64]
    trace: WindowSet
    library: LibraryWindows

    @property
    def best(self) -> Match:
        """The best of all reactions.

        Of equal mismatches the lowest exit wins, then the lowest entry, then the first reaction.
        """
        return self._match(int(np.lexsort((self.entry_frames, self.exit_frames, self.errors))[0]))

    def match(self, reaction: str) -> Match:
        """The best match of one reaction.

        Raises:
            UnknownNameError: There is no such reaction.
        """
        return self._match(self.library.index(reaction))

    def surface(self, reaction: str) -> ErrorSurface:
        """Compute all mismatches of one reaction.

        Raises:
            UnknownNameError: There is no such reaction.
        """
        library = self.library.subset([reaction])
        _, errors = _run(self.trace, library, early_stop=False)
        entries = library.windows[0].starts
        return ErrorSurface(errors[:, : len(entries)], self.trace.starts, entries)

    def _match(self, row: int) -> Match:
        return Match(
            reaction=self.names[row],
            error=float(self.errors[row]),
            exit_frame=int(self.exit_frames[row]),
            entry_frame=int(self.entry_frames[row]),
        )


def search(
    trace: WindowSet, library: LibraryWindows, *, early_stop: bool = True
) -> FullSearchResult:
    """Find the best exit and entry for every reaction, on one thread.

    Args:
        trace: Windows of the simulated trace (`windows.trace_windows`).
        library: Windows of the reactions (`windows.library_windows`), cut with the same settings.
        early_stop: Skip pairs of windows as soon as they can no longer win. The result has the
            same bits; False is for measuring what all pairs cost.

    Returns:
        The best match of every reaction; of equal mismatches the lowest exit, then the lowest
        entry.

    Raises:
        MotionError: Trace and library have different settings or numbers of bodies.
    """
    if trace.config != library.config:
        raise MotionError(
            f"the trace was cut with {trace.config}, the library with {library.config}; "
            "cut both with the same settings"
        )
    if trace.bodies != library.windows[0].bodies:
        raise MotionError(
            f"the trace has {trace.bodies} bodies, the library {library.windows[0].bodies}; "
            "both must be of one character"
        )
    best, _ = _run(trace, library, early_stop=early_stop)
    starts = [w.starts[at] for w, at in zip(library.windows, best.entries, strict=True)]
    return FullSearchResult(
        names=library.names,
        errors=best.errors,
        exit_frames=trace.starts[best.exits],
        entry_frames=np.array(starts, dtype=np.int64),
        trace=trace,
        library=library,
    )


def _run(
    trace: WindowSet, library: LibraryWindows, *, early_stop: bool
) -> tuple[Best, npt.NDArray[np.float32]]:
    """Call the kernel: the best of every reaction, and its scratch."""
    # Importing numba takes a third of a second.
    from dynresp.response.windows import window_kernel as kernel

    config = library.config
    frame_weights = config.frame_weights()[:, None]
    position_weight, angle_weight = config.body_weights(trace.bodies)
    reactions = len(library.names)
    best = kernel.Best(
        np.empty(reactions, np.float32),
        np.empty(reactions, np.int64),
        np.empty(reactions, np.int64),
    )
    widest = max(windows.data.shape[3] for windows in library.windows)
    scratch = np.empty((len(trace), widest), np.float32)
    counts = np.array([len(windows) for windows in library.windows], np.int64)
    weights = kernel.BodyWeights(
        (frame_weights * position_weight).astype(np.float32),
        (frame_weights * angle_weight).astype(np.float32),
    )
    # The kernel's signature knows read-only ones; unpickled arrays can be written.
    arrays = [frozen(array.view()) for array in (library.buffer, library.offsets, counts)]
    entries = kernel.Entries(*arrays)
    kernel.search_kernel(trace.data, len(trace), entries, weights, LANES, early_stop, best, scratch)
    return best, scratch
