"""Speed and error of the alignment of one reaction, beside a search of all whole frames."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult, Contender, median_seconds
from dynresp.experiments.experiment_reader import read_experiment
from dynresp.experiments.runner import prepare_run
from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment import Aligner, Alignment, AlignmentConfig
from dynresp.response.hit_simulation import HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.search import full_search
from dynresp.response.search.full_search_choice import reaction_tracks
from dynresp.response.windows.windows import (
    LibraryWindows,
    ReactionTrack,
    WindowErrorConfig,
    WindowSet,
    library_windows,
    trace_windows,
)
from dynresp.support.errors import DynrespError
from dynresp.support.paths import example_specs

HITS = 300
"""Balls that are thrown."""
EXAMPLE = "balls_500.toml"
"""The example experiment with these balls and the character that they hit."""
NEAR = 1.02
"""An alignment whose error is within this ratio of the exhaustive one's counts as near."""
_ROUNDS = 15


@dataclass(frozen=True)
class Cases:
    """Simulated hits, and reactions to align with them.

    Attributes:
        positions: (hits, frames, bodies, 3) [m], from contact on.
        quaternions: (hits, frames, bodies, 4), w x y z.
        tracks: The reactions.
        window: The window error and the bounds of the exits.
        about: What they are.
    """

    positions: FloatArray
    quaternions: FloatArray
    tracks: list[ReactionTrack]
    window: WindowErrorConfig
    about: str


def simulated(seed: int, count: int, motions: Path | None = None) -> Cases:
    """Throw balls at a walking person, as the example experiment does.

    On the recorded walk and the core library where they are on this machine, else on what the
    product makes itself.

    Args:
        seed: Seed of the balls.
        count: How many are thrown; those that miss are left out.
        motions: Folder of motion capture.
    """
    experiment = read_experiment(example_specs("experiments") / EXAMPLE)
    run = prepare_run(experiment, example_specs("experiments"), motions, seed)
    hits = [(run.base.motion, hit.impact) for hit in run.hits(range(count))]
    (batch,) = HitStage(run.character, run.config).batches(hits)
    traces = batch.simulation.look_ahead(run.config.horizon_s)
    seen = look_ahead_of(run.character, run.config, batch.bases, batch.prepared, traces)
    return Cases(
        positions=seen.states.centers,
        quaternions=seen.states.quaternions,
        tracks=reaction_tracks(run.character, run.library, run.config),
        window=run.config.window,
        about=f"{run.base.motion.name}, {run.library.name} library",
    )


@dataclass(frozen=True)
class Exhaustive:
    """What the full search found for every hit and reaction.

    Attributes:
        errors: (hits, reactions) least errors over whole frames [m].
        exit_frames: (hits, reactions) where.
        entry_frames: (hits, reactions) where.
    """

    errors: npt.NDArray[np.float32]
    exit_frames: npt.NDArray[np.int64]
    entry_frames: npt.NDArray[np.int64]


def exhaustive(cases: Cases, windows: list[WindowSet], library: LibraryWindows) -> Exhaustive:
    """Search all reactions for every hit."""
    found = [full_search.search(cut, library) for cut in windows]
    return Exhaustive(
        *(
            np.stack([getattr(one, name) for one in found])
            for name in ("errors", "exit_frames", "entry_frames")
        )
    )


def run(
    seed: int = 0, cases: Cases | None = None, config: AlignmentConfig | None = None
) -> BenchResult:
    """Measure on one thread; takes about ten seconds, most of it for the simulation of the hits.

    Both sides begin with the bodies of a simulated trace and end with the alignment of one
    reaction, the one that the full search would choose. The exhaustive side cuts the windows of the
    trace and searches them; `search_alone` is without the cutting, which a search of many
    reactions does once.

    Args:
        seed: Seed of the hits and of the random reactions.
        cases: Hits and reactions; None to simulate `HITS` balls.
        config: Settings of the alignment.

    Raises:
        DynrespError: The two sides differ where both look at the same whole frames, which would
            make their times meaningless.
    """
    cases = cases or simulated(seed, HITS)
    window, count = cases.window, len(cases.positions)
    aligner = Aligner(cases.tracks, window, config)
    library = library_windows(cases.tracks, window)
    alone = [library.subset([name]) for name in library.names]
    traces = list(zip(cases.positions, cases.quaternions, strict=True))
    windows = [trace_windows(*trace, window) for trace in traces]
    best = exhaustive(cases, windows, library)
    _check_agreement(aligner, traces, best)
    chosen = best.errors.argmin(axis=1)
    names = [aligner.names[row] for row in chosen]
    work = list(zip(traces, names, chosen.tolist(), windows, strict=True))

    def align() -> list[Alignment]:
        return [aligner.align(*trace, [name])[0] for trace, name, *_ in work]

    def search() -> None:
        for trace, _, row, _ in work:
            full_search.search(trace_windows(*trace, window), alone[row])

    def search_alone() -> None:
        for _, _, row, cut in work:
            full_search.search(cut, alone[row])

    aligned = align()
    times = median_seconds(
        [
            Contender("align", align),
            Contender(
                "batch",
                lambda: aligner.align_many(cases.positions, cases.quaternions, chosen),
            ),
            Contender("search", search),
            Contender("search alone", search_alone),
        ],
        _ROUNDS,
    )
    micro = {name: 1e6 * seconds / count for name, seconds in times.items()}
    rows = np.arange(count)
    least = best.errors[rows, chosen]
    ratios = np.array([one.error for one in aligned]) / least
    whole = [aligner.snap(*trace, one) for trace, one in zip(traces, aligned, strict=True)]
    snapped = np.array([one.error for one in whole]) / least
    other = np.random.default_rng(seed).integers(len(aligner.names), size=count)
    other_errors = aligner.align_many(cases.positions, cases.quaternions, other).errors
    random = other_errors / best.errors[rows, other]
    return BenchResult(
        name="align",
        value=micro["align"],
        unit="us/alignment",
        baseline=micro["search"],
        baseline_name="exhaustive alignment: the full search of the one reaction",
        ratio=micro["search"] / micro["align"],
        machine=describe_machine(("numpy", "numba")),
        more={
            "batch": micro["batch"],
            "search_alone": micro["search alone"],
            "search_alone_ratio": micro["search alone"] / micro["align"],
            "within_2_percent": float(np.mean(ratios <= NEAR)),
            "within_2_percent_random": float(np.mean(random <= NEAR)),
            "within_2_percent_whole_exit": float(np.mean(snapped <= NEAR)),
            "error_ratio_median": float(np.median(ratios)),
            "error_ratio_95": float(np.percentile(ratios, 95)),
            "evaluations": float(np.mean([one.evaluations for one in aligned])),
            "sets": float(np.mean([one.sets for one in aligned])),
            "pairs_exhaustive": sum(len(windows[0]) * len(alone[row].windows[0]) for row in chosen)
            / count,
            "hits": count,
            "reactions": len(aligner.names),
            "motion": cases.about,
            "seed": seed,
        },
        notes=(
            "All times in us for one reaction on one thread, medians of interleaved rounds; batch: "
            "many traces in one call.",
            "The reaction is the choice of the full search, or a random one; ratios are of window "
            "errors to the exhaustive ones, which use whole frames only; whole_exit: moved to a "
            "whole exit frame.",
        ),
    )


def _check_agreement(
    aligner: Aligner, traces: list[tuple[FloatArray, FloatArray]], best: Exhaustive
) -> None:
    """Refuse to report times of sides that do not compute the same."""
    for trace, errors, exits, entries in zip(
        traces, best.errors, best.exit_frames, best.entry_frames, strict=True
    ):
        for name, error, at, entry in zip(aligner.names, errors, exits, entries, strict=True):
            found = aligner.errors(*trace, name, at, entry)
            if not np.allclose(found, error, rtol=1e-4, atol=full_search.ERROR_FLOOR):
                raise DynrespError(
                    f"{name}: the aligner finds an error of {found:.6g} m, the full search one of "
                    f"{error:.6g} m; expected at most 1e-4 relative plus "
                    f"{full_search.ERROR_FLOOR} m between them. Please report this with the "
                    "machine it happened on."
                )
