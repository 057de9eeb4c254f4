"""Speed: benchmarks, each with the targets that it has to reach."""

from __future__ import annotations

from collections.abc import Callable

from dynresp.bench.measure import BenchResult
from studies.choosing import walk_classifier
from studies.study import Columns, Options, Study, Target, Value

MEASURED = "measured"
"""The only column of a study that measures one thing."""


def _physics(options: Options) -> BenchResult:
    from dynresp.bench import physics_speed

    return physics_speed.run(options.seed)


def _full_search(options: Options) -> BenchResult:
    from studies.benchmarks import full_search_speed

    return full_search_speed.run(options.seed)


def _prediction(options: Options) -> BenchResult:
    from studies.benchmarks import prediction_speed

    return prediction_speed.run(options.seed, model=walk_classifier())


def _alignment(options: Options) -> BenchResult:
    from studies.benchmarks import alignment_speed

    return alignment_speed.run(options.seed)


def _response(options: Options) -> BenchResult:
    from dynresp.bench import response_speed

    return response_speed.run(options.seed, motions=options.motions)


def _generation(options: Options) -> BenchResult:
    from dynresp.bench import generation_speed

    return generation_speed.run(options.seed, options.motions)


def _graph_building(options: Options) -> BenchResult:
    from studies.benchmarks import graph_speed

    sizes = () if options.quick else (25_000, 50_000, 100_000)
    return graph_speed.run(options.seed, options.motions, sizes=sizes)


def _column(run: Callable[[Options], BenchResult]) -> Callable[[Options], Columns]:
    """The values of a benchmark as a column."""

    def measured(options: Options) -> Columns:
        result = run(options)
        column: dict[str, Value] = {
            "value": result.value,
            "baseline": result.baseline,
            "ratio": result.ratio,
        }
        return {MEASURED: column | dict(result.more)}

    return measured


STUDIES = (
    Study(
        "physics",
        "steps of simulated hits a second on all cores, beside one thread of mujoco.rollout",
        "15 s",
        _column(_physics),
        (Target("ratio_per_core", "at least 0.9", at_least=0.9),),
    ),
    Study(
        "full-search",
        "time of the full search for a reaction, beside vectorised NumPy and the readable twin",
        "10 s",
        _column(_full_search),
        (
            Target("value", "at most 0.45 ms", at_most=0.45),
            Target("ratio", "at least 5", at_least=5.0),
            Target("ratio_twin", "at least 1,000", at_least=1000.0),
        ),
    ),
    Study(
        "prediction",
        "time to predict which reaction fits, beside scikit-learn's own predict",
        "10 s",
        _column(_prediction),
        (
            Target("value", "at most 20 us", at_most=20.0),
            Target("exact_alone", "at most 300 us", at_most=300.0),
            Target("exact_batch", "at most 150 us", at_most=150.0),
            Target("reduced_batch", "at most 5 us", at_most=5.0),
        ),
        ("numpy", "numba", "scikit-learn"),
        (
            "value is the reduced model alone. The model is DYNRESP_DATASETS/walk.skops where it "
            "is on this machine, else a synthetic one.",
        ),
    ),
    Study(
        "alignment",
        "time to align one reaction, and its mismatch, beside exhaustive alignment",
        "15 s",
        _column(_alignment),
        (
            Target("value", "at most 100 us", at_most=100.0),
            Target("within_2_percent", "at least 95 %", at_least=0.95),
        ),
    ),
    Study(
        "response",
        "from a hit to a finished response on one core, with every budget",
        "30 s",
        _column(_response),
        (
            Target("fast_ms", "at most 16.7 ms", at_most=16.7),
            Target("search_over_prediction_and_alignment", "at least 50", at_least=50.0),
        ),
    ),
    Study(
        "generation",
        "labelled samples a second on one core, beside a loop that answers hit by hit",
        "15 s",
        _column(_generation),
        (Target("value", "at least 40", at_least=40.0),),
    ),
    Study(
        "graph-building",
        "time to build a motion graph, beside blocked NumPy, and how it grows with the frames",
        "1 min",
        _column(_graph_building),
        (
            Target("value", "at most 2 s", at_most=2.0),
            Target("peak_memory_mib", "at most 1,024 MiB", at_most=1024.0),
        ),
        ("numpy", "numba", "scipy"),
    ),
)
