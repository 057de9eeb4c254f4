"""Running an experiment: loading what it needs, all its hits, and the result folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.experiments import batch_summary as batch
from dynresp.experiments.experiment_spec import Experiment
from dynresp.experiments.response_files import response_files, write_response
from dynresp.motion.character import Character, default_character
from dynresp.motion.named_motion import NamedMotion, load_spec_motion
from dynresp.motion.reactions.named_library import library_record, load_named_library
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.physics.drawn_hits import Hit, draw_hits
from dynresp.physics.impact_spec import StrikerCut, StrikeTable
from dynresp.physics.impacts import Ball
from dynresp.physics.prepared_impact import prepare
from dynresp.response.chooser import NamedChooser, make_chooser
from dynresp.response.responder import Responder
from dynresp.response.response import Response, ResponseConfig
from dynresp.response.response_quality import Quality, measure
from dynresp.response.response_settings import response_config, settings_record
from dynresp.results.result_folder import (
    RESULT,
    SUMMARY,
    TABLE,
    attempt,
    check_claim,
    claim,
    clear,
    hit_folder,
)
from dynresp.results.result_json import versions, write_json
from dynresp.support.errors import MotionError, SpecError
from dynresp.support.inputs import inputs_noted
from dynresp.support.progress import Progress, no_progress

# Hits are simulated in groups of this size, so that memory does not grow with their number.
_GROUP = 100


@dataclass(frozen=True)
class HitResult:
    """One hit and what came of it."""

    hit: Hit
    response: Response
    quality: Quality | None


@dataclass(frozen=True)
class Run:
    """An experiment with everything it needs, loaded.

    Attributes:
        experiment: Content of the file.
        seed: Seed of its random values.
        character: The character.
        base: The base motion.
        striker: The second character's motion, of a strike.
        library: The reactions.
        choosing: What chooses among them, and its record.
        config: Settings.
        threads: Threads for the physics, 0 for all cores.
        inputs: The files that were read, which no result replaces.
    """

    experiment: Experiment
    seed: int
    character: Character
    base: NamedMotion
    striker: NamedMotion | None
    library: ReactionLibrary
    choosing: NamedChooser
    config: ResponseConfig
    threads: int = 0
    inputs: frozenset[Path] = frozenset()
    responder: Responder = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Make the responder."""
        responder = Responder(
            self.character, self.library, self.config, self.threads, self.choosing.chooser
        )
        object.__setattr__(self, "responder", responder)

    def hits(self, numbers: range) -> list[Hit]:
        """Draw hits."""
        table = self.experiment.impact[0]
        if self.striker is None:
            return draw_hits(table, self.seed, numbers)
        cut = self.striker.cut
        assert isinstance(cut, StrikerCut)
        return draw_hits(table, self.seed, numbers, self.striker.motion, cut.hit_s, cut.side)

    def results(self, numbers: range, progress: Progress) -> Iterator[HitResult]:
        """Responses to hits, one after the other.

        Args:
            numbers: Which hits.
            progress: Called with the stage, how many hits are done, and of how many.
        """
        for start in range(numbers.start, numbers.stop, _GROUP):
            hits = self.hits(range(start, min(start + _GROUP, numbers.stop)))

            def report(stage: str, done: int, of: int, start: int = start) -> None:
                progress(stage, start - numbers.start + done, len(numbers))

            responses = self.responder.respond(
                [(self.base.motion, hit.impact) for hit in hits], report
            )
            for hit, response in zip(hits, responses, strict=True):
                yield HitResult(hit, response, measure(response, self.character))

    def record(self) -> dict[str, Any]:
        """What `result.json` says about the whole experiment."""
        record: dict[str, Any] = {
            "experiment": self.experiment.experiment.name,
            "seed": self.seed,
            "count": self.experiment.experiment.count,
            "base": self.base.record,
        }
        if self.striker is not None:
            record["striker"] = self.striker.record
        return {
            **record,
            "library": library_record(self.library, self.experiment.library.which),
            "choosing": self.choosing.record,
            "settings": settings_record(self.config),
            "output": self.experiment.output.model_dump(),
            "character": self.character.identity,
            "versions": versions(),
        }


def prepare_run(
    experiment: Experiment,
    beside: Path,
    motions: Path | None = None,
    seed: int | None = None,
    threads: int = 0,
    choice: Mapping[str, str] | None = None,
) -> Run:
    """Load everything that an experiment needs.

    Args:
        experiment: Content of the file.
        beside: Its folder; relative paths count from it.
        motions: Motions folder in place of `DYNRESP_MOTIONS` and of what was fetched.
        seed: Used instead of the file's own.
        threads: Threads for the physics, 0 for all cores.
        choice: Keys of `[choice]` that replace the file's own.

    Raises:
        MissingMotionDataError: A motion is not on this machine.
        SpecError: A value does not fit the motions, such as the time of a hit.
        DynrespError: A motion or a library cannot be read.
    """
    with inputs_noted() as inputs:
        character = default_character()
        folders = motion_folders(motions)
        config = response_config(experiment.settings)
        fps = config.physics.fps
        base = load_spec_motion(
            experiment.base, experiment.base.otherwise, "base", folders, beside, fps, character
        )
        striker = None
        impact = experiment.impact[0]
        if isinstance(impact, StrikeTable):
            table = impact.striker
            key = "impact.striker"
            striker = load_spec_motion(table, table.otherwise, key, folders, beside, fps, character)
            cut = striker.cut
            assert isinstance(cut, StrikerCut)
            if cut.hit_s > striker.motion.duration:
                raise SpecError(
                    f"{key}.hit_s: expected at most {striker.motion.duration:.2f} s, which is how "
                    f"long the striker's motion lasts, got {cut.hit_s:g}"
                )
        library = load_named_library(experiment.library.which, folders, beside, fps, character)
        chosen = experiment.experiment.seed if seed is None else seed
        try:
            choice_table = experiment.choice.model_copy(update=dict(choice or {}))
            choosing = make_chooser(choice_table, character, library, config, beside)
        except MotionError as error:
            # A clip of the library that is shorter than a window.
            raise SpecError(f"settings.window_s: {error}") from None
        run = Run(experiment, chosen, character, base, striker, library, choosing, config, threads)
    run = replace(run, inputs=frozenset(inputs))
    _check_times(run)
    return run


def _check_times(run: Run) -> None:
    """Check, before anything is simulated, that all hits come during the base motion.

    Raises:
        SpecError: One does not.
    """
    hits = run.hits(range(run.experiment.experiment.count))
    if not isinstance(hits[0].impact, Ball):
        # Other impacts need the same lead in all hits, so checking the first and last is enough.
        hits = [min(hits, key=_time), max(hits, key=_time)]
    for hit in hits:
        try:
            prepare(hit.impact, run.base.motion, run.character, run.config.physics)
        except SpecError as error:
            which = f" of hit {hit.number}" if run.experiment.experiment.count > 1 else ""
            what, _, why = str(error).partition(":")
            key = "impact.time_s" if what == "time" else f"impact.{what}"
            raise SpecError(f"{key}{which}:{why}") from None


def _time(hit: Hit) -> float:
    return hit.impact.time


def run_experiment(
    run: Run, out: Path, progress: Progress | None = None, *, overwrite: bool = False
) -> dict[str, Any]:
    """Simulate all hits of an experiment and write the result folder.

    Args:
        run: The experiment, loaded.
        out: Folder to write to; made if it is missing.
        progress: Called with the stage, how many are done, and of how many.
        overwrite: See `write_results`.

    Returns:
        See `write_results`.

    Raises:
        UsageError: As `write_results`, before anything is simulated.
        DynrespError: `result.json` or `summary.json` cannot be written.
    """
    progress = progress or no_progress
    count = run.experiment.experiment.count
    check_claim(out, _names(run), inputs=run.inputs, overwrite=overwrite)
    results = run.results(range(count), progress)
    return write_results(run, results, out, progress, overwrite=overwrite)


def write_results(
    run: Run,
    results: Iterable[HitResult],
    out: Path,
    progress: Progress,
    *,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write the result folder of an experiment.

    Files of an earlier result are removed, so that all files of results in the folder belong
    together.

    Args:
        run: The experiment, loaded.
        results: Of all its hits, in order. Those that are not written in full are not kept.
        out: Folder to write to; made if it is missing.
        progress: Called with the stage, how many are done, and of how many.
        overwrite: Whether files that no earlier result names as its own may be replaced.

    Returns:
        The content of `result.json`; of a batch, of `summary.json`.

    Raises:
        UsageError: A file of somebody else would be replaced, or an input; nothing was written.
        DynrespError: `result.json` or `summary.json` cannot be written.
    """
    table = run.experiment.experiment
    record = run.record()
    rights: Any = {"inputs": run.inputs, "overwrite": overwrite}

    def write(result: HitResult, where: Path, title: str) -> dict[str, Any]:
        return write_response(
            where, title, result.hit, result.response, result.quality, record,
            run.experiment.output, run.responder, progress, **rights,
        )  # fmt: skip

    if table.count == 1:
        (result,) = results
        return write(result, out, table.name)

    shown = chosen_hits(run.seed, table.count, table.show)
    names = _names(run)
    own = claim(out, SUMMARY, names, **rights)
    rows, picked = [], []
    for result in results:
        rows.append(batch.row(result.hit, result.response, result.quality))
        if result.hit.number in shown:
            picked.append(result)
    files = clear(out, own - {SUMMARY, *names})
    files[TABLE] = attempt(lambda path: batch.write_table(rows, path), out / TABLE)
    for result in picked:
        number = result.hit.number
        written: dict[str, str] = {}

        def hit(path: Path, result: HitResult = result, written: dict[str, str] = written) -> None:
            title = f"{table.name}, hit {result.hit.number}"
            written |= write(result, path.parent, title)["files"]

        name = hit_folder(number)
        files[f"{name}/{RESULT}"] = attempt(hit, out / name / RESULT)
        files |= {f"{name}/{file}": what for file, what in written.items()}
    summary = {**record, "shown": shown, **batch.summarise(rows), "files": files}
    write_json(summary, out / SUMMARY)
    return summary


def _names(run: Run) -> list[str]:
    """Names of the files of an experiment's result folder."""
    table, each = run.experiment.experiment, response_files(run.experiment.output)
    if table.count == 1:
        return [RESULT, *each]
    hits = [hit_folder(number) for number in chosen_hits(run.seed, table.count, table.show)]
    return [SUMMARY, TABLE, *(f"{hit}/{name}" for hit in hits for name in (RESULT, *each))]


def chosen_hits(seed: int, count: int, show: int) -> list[int]:
    """Which hits of a batch are written in full: chosen by the seed, in order."""
    rng = np.random.default_rng((seed, count))
    return sorted(int(n) for n in rng.choice(count, min(show, count), replace=False))
