"""How fast labelled samples are made on one core, against a loop that answers hit by hit."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult
from dynresp.experiments.experiment_reader import read_experiment
from dynresp.experiments.runner import prepare_run
from dynresp.response.responder import Responder
from dynresp.response.search.hit_labels import OUTCOMES, HitLabeller
from dynresp.support.errors import DynrespError
from dynresp.support.paths import example_specs

SAMPLES = 500
"""Samples that are labelled, as many as a shard of a dataset holds."""
LOOPED = 60
"""Hits that the loop answers."""
EXAMPLE = "balls_500.toml"
"""The example experiment with the balls and the character that they hit."""


def run(
    seed: int = 0, motions: Path | None = None, samples: int = SAMPLES, looped: int = LOOPED
) -> BenchResult:
    """Measure on one thread; takes about ten seconds.

    The loop answers one hit after another with the full search and a finished motion, as
    `dynresp run` does for each; both give the same labels.

    Args:
        seed: Seed of the hits.
        motions: Folder of motion capture; without, all is built in.
        samples: How many are labelled together.
        looped: How many the loop answers.

    Raises:
        DynrespError: The two sides differ, which would make their times meaningless.
    """
    experiment = read_experiment(example_specs("experiments") / EXAMPLE)
    loaded = prepare_run(
        experiment, example_specs("experiments"), motions, seed, 1, {"budget": "best"}
    )
    hits = [(loaded.base.motion, hit.impact) for hit in loaded.hits(range(samples))]
    labeller = HitLabeller(loaded.character, loaded.library, loaded.config, threads=1)
    responder = Responder(loaded.character, loaded.library, loaded.config, threads=1)
    # Kernels and scenes are compiled once.
    labeller.label(hits[:2])
    responder.respond(hits[:1])
    start = time.perf_counter()
    labelled = labeller.label(hits)
    together = (time.perf_counter() - start) / samples
    start = time.perf_counter()
    responses = [responder.respond([hit])[0] for hit in hits[:looped]]
    one_by_one = (time.perf_counter() - start) / looped
    for label, response in zip(labelled.label, responses, strict=False):
        name = labeller.classes[label] if label >= 0 else None
        if response.diverged is None and name != response.choice:
            raise DynrespError(f"a sample is labelled {name}, the loop chose {response.choice}")
    return BenchResult(
        name="generate",
        value=1.0 / together,
        unit="samples/s",
        baseline=1.0 / one_by_one,
        baseline_name="a plain loop over hits",
        ratio=one_by_one / together,
        machine=describe_machine(("numpy", "numba", "mujoco")),
        more={
            "samples": samples,
            "hits": int(np.sum(labelled.outcome == OUTCOMES.index("hit"))),
            "library": loaded.library.name,
            "classes": len(labeller.classes),
        },
        notes=("one core; `dynresp generate` runs one such process a core",),
    )
