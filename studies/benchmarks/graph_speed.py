"""Speed of building a motion graph, and of walking through it.

The size is that of the terrain example of Lee et al. 2002 (table 1), 12,879 frames, and the first
pruning rule is in its loose form: about forty times as many pairs are compared as in the strict
one, and the third rule is in force.
"""

from __future__ import annotations

import functools
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult, Contender, median_seconds
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.graph_file import load_graph, save_graph
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.pruning import find_jumps
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.character import Character, default_character
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import DynrespError, MotionError
from studies.benchmarks.graph_database import about, database_of, recorded_database
from studies.benchmarks.numpy_pruning_twin import Block, NumpyPruning

FRAMES = 12_879
"""Frames of the database."""
WALKED, PLAYED, FITTED = 1_000_000, 200_000, 10_000
"""Frames that are walked, played with blends, and given feet that stand."""
LOOSE, STRICT = GraphConfig(contact_change=False), GraphConfig()

_ROUNDS, _SLOW_EVERY = 3, 3
# Rows that NumPy compares: lots of so many, spread over the database.
_LOTS, _LOT = 8, 24
# Float32 differs from float64 by less than half of this, for distances that are kept.
_ROUNDING = 2e-5
# Frames that are played at a time, and that warm up what is compiled.
_STRETCH, _WARM = 20_000, 300


def run(
    seed: int = 0,
    motions: Path | None = None,
    *,
    frames: int = FRAMES,
    sizes: Sequence[int] = (),
) -> BenchResult:
    """Measure; takes about twenty seconds, most of it for the baseline and for reading motions.

    Args:
        seed: Seed of walks, and of deviations where motions are repeated.
        motions: Motions folder.
        frames: Frames of the database.
        sizes: Further numbers of frames whose graphs are built, once each; clips are repeated with
            deviations where there are too few. 100,000 frames take half a minute.

    Returns:
        `value` is the time from a database to a graph of one component, on all cores.

    Raises:
        DynrespError: NumPy finds other jumps, or motions cannot be read.
    """
    character = default_character()
    plan, recorded = recorded_database(motions, character)
    database = database_of(recorded, frames, np.random.default_rng(seed))
    pruning = NumpyPruning.of(database, LOOSE)
    blocks: list[Block] = []

    def numpy_part() -> list[BoolArray]:
        blocks[:] = [
            pruning.block(start, min(start + _LOT, frames))
            for start in np.linspace(0, max(frames - _LOT, 0), _LOTS).astype(int).tolist()
        ]
        return [pruning.jumps(block) for block in blocks]

    def build(config: GraphConfig, threads: int = 0) -> MotionGraph:
        return MotionGraph.from_database(database, config, threads=threads)

    graph, strict = build(LOOSE), build(STRICT)
    times = median_seconds(
        [
            Contender("loose", functools.partial(build, LOOSE)),
            Contender("one thread", functools.partial(build, LOOSE, 1), every=_SLOW_EVERY),
            Contender("strict", functools.partial(build, STRICT)),
            Contender("numpy", numpy_part, every=_SLOW_EVERY),
        ],
        _ROUNDS,
    )
    _check_agreement(database, pruning, blocks)
    compared = sum(block.compared for block in blocks)
    part = compared / (graph.counts.contact / 2)
    baseline = times["numpy"] / part
    return BenchResult(
        name="graph",
        value=times["loose"],
        unit="s",
        baseline=baseline,
        baseline_name="vectorised NumPy on one core, the first three rules alone",
        ratio=baseline / times["loose"],
        machine=describe_machine(("numpy", "numba", "scipy")),
        more={
            "frames": frames,
            "motions": plan,
            "repeated_frames": max(0, frames - len(recorded)),
            "one_thread_s": times["one thread"],
            "strict_s": times["strict"],
            "numpy_part": part,
            "pairs": graph.counts.pairs,
            "left_by_contact": graph.counts.contact,
            "left_by_likelihood": graph.counts.likelihood,
            "left_by_similarity": graph.counts.similarity or 0,
            "left_by_footing": graph.counts.footing,
            "jumps": graph.counts.component,
            "component_frames": graph.counts.component_frames,
            "strict_jumps": strict.counts.component,
            "strict_component_frames": strict.counts.component_frames,
            **_memory(database),
            **_file(graph),
            **_walking(strict, character, np.random.default_rng(seed)),
            **_growth(recorded, sizes, seed),
        },
        notes=(
            about(plan, frames, len(recorded)),
            "Measured: from a database to one component by all rules, the first in its loose form, "
            "on all cores; strict_s is the form that graphs have by default.",
            f"NumPy was timed on {100 * part:.1f} % of the pairs and scaled; there it finds the "
            "same jumps.",
            "walk_per_s, played_per_s (with blends) and fitted_per_s (feet fitted, too) are frames "
            "a second on one core, at 15 frames a second of motion, through the strict graph.",
        ),
    )


def _check_agreement(
    database: MotionDatabase, pruning: NumpyPruning, blocks: Sequence[Block]
) -> None:
    """Refuse times of results that differ; where rounding decides, both are accepted.

    Raises:
        DynrespError: The jumps differ.
    """
    found = find_jumps(database, LOOSE)
    matched = found.targets - 1
    limit = LOOSE.max_distance - _ROUNDING
    for block in blocks:
        distances = block.distances[1:-1]
        own = (found.sources >= block.start) & (found.sources < block.start + len(distances))
        own &= matched > found.sources
        pairs = found.sources[own] - block.start, matched[own]
        kept, uncertain = np.zeros((2, *distances.shape), dtype=bool)
        kept[pairs] = True
        uncertain[pairs] = found.distances[own] > limit
        surely = pruning.jumps(block, _ROUNDING) & (distances < limit)
        perhaps = pruning.jumps(block, -_ROUNDING) | uncertain
        wrong = int(np.count_nonzero((surely & ~kept) | (kept & ~perhaps)))
        if wrong:
            raise DynrespError(
                f"in rows {block.start} to {block.start + len(distances)} NumPy finds other jumps: "
                f"{wrong} of {len(pairs[0])} differ"
            )


def _memory(database: MotionDatabase) -> dict[str, float]:
    """Peak memory of a fresh process that builds a graph [MiB]; empty where it is unknown."""
    if not sys.platform.startswith("linux"):
        return {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        before, peak = pool.submit(_peaks, database).result()
    return {"peak_memory_mib": peak, "memory_added_mib": peak - before}


def _peaks(database: MotionDatabase) -> tuple[float, float]:
    """Memory before a graph is built, everything loaded; and the highest after it [MiB]."""
    warm = database_of(database, _WARM, np.random.default_rng(0))
    with suppress(MotionError):
        MotionGraph.from_database(warm, LOOSE)
    before = _status_mib("VmRSS")
    MotionGraph.from_database(database, LOOSE)
    return before, _status_mib("VmHWM")


def _status_mib(name: str) -> float:
    """A figure that Linux keeps of this process. getrusage would count the parent's peak, too."""
    lines = Path("/proc/self/status").read_text().splitlines()
    values = dict(line.split(":", 1) for line in lines)
    return int(values[name].split()[0]) / 1024.0


def _file(graph: MotionGraph) -> dict[str, float]:
    """Size of a graph's file, and how long it takes to write and to read it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "graph.npz"
        start = time.perf_counter()
        save_graph(graph, path)
        saved = time.perf_counter()
        load_graph(path)
        loaded = time.perf_counter()
        size = path.stat().st_size / 2**20
    return {"file_mib": size, "save_s": saved - start, "load_s": loaded - saved}


def _walking(
    graph: MotionGraph, character: Character, rng: np.random.Generator
) -> dict[str, float]:
    """Frames a second: walked, played, and with feet fitted."""
    path = random_walk(graph, _WARM, rng)
    compose(graph, character, path)
    start = time.perf_counter()
    path = random_walk(graph, WALKED, rng)
    walked = time.perf_counter()
    playback = Playback(graph, int(path[0]))
    for at in range(1, PLAYED, _STRETCH):
        playback.play(path[at : min(at + _STRETCH, PLAYED)])
    played = time.perf_counter()
    compose(graph, character, path[:FITTED])
    fitted = time.perf_counter()
    return {
        "walk_per_s": WALKED / (walked - start),
        "played_per_s": PLAYED / (played - walked),
        "fitted_per_s": FITTED / (fitted - played),
    }


def _growth(recorded: MotionDatabase, sizes: Sequence[int], seed: int) -> dict[str, float | int]:
    """Times of larger databases, and what their graphs hold."""
    more: dict[str, float | int] = {}
    for frames in sizes:
        database = database_of(recorded, frames, np.random.default_rng(seed))
        for name, config in (("loose", LOOSE), ("strict", STRICT)):
            start = time.perf_counter()
            graph = MotionGraph.from_database(database, config)
            more[f"{name}_{frames}_s"] = time.perf_counter() - start
            more[f"{name}_{frames}_jumps"] = graph.counts.component
        for key, value in _memory(database).items():
            more[f"{key}_{frames}"] = value
    return more
