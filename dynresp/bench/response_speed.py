"""Time from a hit to a finished response on one core: the frame in which the hit happens."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult
from dynresp.experiments.experiment_reader import read_experiment
from dynresp.experiments.runner import Run, prepare_run
from dynresp.motion.reactions.reaction_library import builtin_library
from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment import Aligner
from dynresp.response.budget import BUDGETS, chooser_for
from dynresp.response.choice import Chooser
from dynresp.response.chooser import find_classifier
from dynresp.response.hit_simulation import HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.prediction.classifier import Classifier
from dynresp.response.prediction.hit_features import extract
from dynresp.response.response import ResponseConfig
from dynresp.response.runtime.crowd import Crowd
from dynresp.response.runtime.dynamic_responder import Phase
from dynresp.response.search.full_search_choice import reaction_tracks
from dynresp.support.errors import DynrespError
from dynresp.support.paths import example_specs

HITS = 60
"""Balls that are thrown, with every budget the same."""
EXAMPLE = "balls_500.toml"
"""The example experiment with these balls and the character that they hit."""
FRAME_MS = 1000.0 / 60.0
"""A frame at 60 a second [ms]."""
WAITED = 10
"""How many frames a ball may be late."""


def run(
    seed: int = 0,
    classifier: Path | None = None,
    motions: Path | None = None,
    hits: int = HITS,
) -> BenchResult:
    """Hit a character at run time, one ball after another, on one thread.

    The time is of the whole frame in which the ball hits: one frame of the simulation, the
    look-ahead, the choice, the alignment and the rewind.

    Args:
        seed: Seed of the balls.
        classifier: File of a classifier; None for the one kept for the library, and the built-in
            library where there is none.
        motions: Folder of motion capture.
        hits: How many balls.

    Returns:
        `value` is the median with the budget "fast", `baseline` that of the full search. The
        further values hold the 95th percentiles, the other budgets, those with a second pass, and
        the stages.

    Raises:
        DynrespError: Fewer than two balls hit.
    """
    experiment = read_experiment(example_specs("experiments") / EXAMPLE)
    loaded = prepare_run(
        experiment, example_specs("experiments"), motions, seed, 1, {"budget": "best"}
    )
    trained = find_classifier(loaded.library, loaded.character, classifier)
    if trained is None:
        # No classifier for the library on this machine: use the built-in one.
        library = builtin_library(loaded.character, loaded.config.physics.fps)
        loaded = replace(loaded, library=library)
        trained = find_classifier(library, loaded.character)
        if trained is None:
            raise DynrespError("the installation is incomplete: it has no built-in classifier")
    times: dict[str, FloatArray] = {}
    for second_pass in (False, True):
        transition = replace(loaded.config.transition, second_pass=second_pass)
        config = replace(loaded.config, transition=transition)
        for budget in BUDGETS:
            name = f"{budget}, second pass" if second_pass else budget
            chooser = chooser_for(budget, loaded.character, loaded.library, config, trained)
            times[name] = _contact_frames(loaded, config, chooser, hits)
    more: dict[str, float | int | str] = {}
    for name, seconds in times.items():
        key = name.replace(", ", "_").replace(" ", "_")
        more[f"{key}_ms"] = 1e3 * float(np.median(seconds))
        more[f"{key}_p95_ms"] = 1e3 * float(np.percentile(seconds, 95))
    stages = _stages(loaded, trained, hits)
    more |= {f"{name}_ms": 1e3 * value for name, value in stages.items()}
    predicted = stages["stage_predict_reduced"] + stages["stage_align"]
    more["search_over_prediction_and_alignment"] = stages["stage_search"] / predicted
    more["search_over_whole_choice"] = stages["stage_search"] / stages["stage_choice"]
    fast = 1e3 * times["fast"]
    return BenchResult(
        name="respond",
        value=float(np.median(fast)),
        unit="ms",
        baseline=float(more["best_ms"]),
        baseline_name="the full search, with exhaustive alignment",
        ratio=float(more["best_ms"]) / float(np.median(fast)),
        machine=describe_machine(("numpy", "numba", "mujoco")),
        more={
            "within_a_60_hz_frame": float(np.mean(fast <= FRAME_MS)),
            "hits": len(fast),
            "look_ahead_s": loaded.config.horizon_s,
            "library": loaded.library.name,
            "trained_on": trained.trained_on.samples,
            **more,
        },
        notes=(
            f"one core; a 60 Hz frame is {FRAME_MS:.1f} ms",
            "with a second pass the rest of the simulation is done in the same frame, too",
            "stage_choice: features, prediction, the base motion's fit, alignment, with all Python",
        ),
    )


def _contact_frames(loaded: Run, config: ResponseConfig, chooser: Chooser, hits: int) -> FloatArray:
    """Durations of the frames in which hits were answered [s]."""
    stage = HitStage(loaded.character, config, 1)
    base, seconds = loaded.base.motion, []
    for hit in loaded.hits(range(hits + 1)):
        crowd = Crowd(loaded.character, loaded.library, [base], config, chooser, stage=stage)
        (responder,) = crowd.responders
        responder.hit(hit.impact)
        last = int(np.ceil(hit.impact.time * base.fps)) + WAITED
        while responder.frame < last and responder.phase is not Phase.PHYSICS:
            start = time.perf_counter()
            crowd.advance()
            passed = time.perf_counter() - start
        if responder.phase is Phase.PHYSICS:
            seconds.append(passed)
    if len(seconds) < 2:
        raise DynrespError(
            "fewer than two balls have hit, so there is nothing to time; try another --seed"
        )
    # The first compiles kernels and scenes.
    return np.array(seconds[1:])


def _stages(loaded: Run, classifier: Classifier, hits: int) -> dict[str, float]:
    """Median durations of what happens after contact, each timed by itself [s]."""
    config, character = loaded.config, loaded.character
    stage = HitStage(character, config, 1)
    aligner = Aligner(reaction_tracks(character, loaded.library, config), config.window)
    fast = chooser_for("fast", character, loaded.library, config, classifier)
    search = chooser_for("best", character, loaded.library, config)
    seconds: dict[str, list[float]] = {}

    def timed(name: str, call: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        result = call()
        seconds.setdefault(f"stage_{name}", []).append(time.perf_counter() - start)
        return result

    for hit in loaded.hits(range(hits)):
        (batch,) = stage.batches([(loaded.base.motion, hit.impact)])
        simulation = batch.simulation
        while simulation.contact(0) is None and simulation.frame(0) < simulation.due(0):
            simulation.approach([0])
        contact = simulation.contact(0)
        if contact is None:
            continue
        left = contact.frame + simulation.frames_of(config.horizon_s) - simulation.frame(0)
        timed("physics", functools.partial(simulation.go_on, [0], left))
        traces = [simulation.trace(0)]
        hit_so_far = (character, config, batch.bases, batch.prepared, traces)
        seen = timed("bodies", functools.partial(look_ahead_of, *hit_so_far))
        if not len(seen):
            continue
        fps = config.physics.fps
        features = timed(
            "features", functools.partial(extract, character, seen.poses, seen.velocities, fps)
        )
        timed("predict", functools.partial(classifier.rank, features))
        timed("predict_reduced", functools.partial(classifier.rank, features, reduced=True))
        trace = seen.states.centers[0], seen.states.quaternions[0]
        timed("align", functools.partial(aligner.align, *trace, aligner.names[:1]))
        timed("choice", functools.partial(fast.choose, seen))
        timed("search", functools.partial(search.choose, seen))
        timed("rewind", functools.partial(simulation.rewind, 0, contact.frame))
    return {name: float(np.median(values)) for name, values in seconds.items()}
