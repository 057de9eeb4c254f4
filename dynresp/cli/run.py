"""`dynresp run`: runs an experiment file and writes its result folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from dynresp.cli.options import (
    Budget,
    ChosenBudget,
    ChosenClassifier,
    Json,
    Motions,
    Overwrite,
    Seed,
)
from dynresp.cli.progress_bar import progress


def run(
    experiment: Annotated[
        Path, typer.Argument(metavar="EXPERIMENT.toml", help="The experiment file.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")],
    motions: Motions = None,
    seed: Seed = None,
    budget: ChosenBudget = None,
    classifier: ChosenClassifier = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Run an experiment file: hit the character, and write how it reacts.

    One hit: result.json, motion.npz, motion.bvh, recording.html, filmstrip.png, alignment.png and,
    if this machine can render, video.mp4. Several hits: summary.json, table.csv, and those files
    for some of the hits.
    """
    choice = choice_of(budget, classifier)
    run_file(experiment, out, motions, seed, as_json, choice, overwrite=overwrite)


def choice_of(budget: Budget | None, classifier: Path | None) -> dict[str, str]:
    """Keys of `[choice]` that the command line gives."""
    choice = {} if budget is None else {"budget": budget.value}
    return choice if classifier is None else {**choice, "classifier": str(classifier.absolute())}


def run_file(
    experiment: Path,
    out: Path,
    motions: Path | None,
    seed: int | None,
    as_json: bool,
    choice: dict[str, str],
    without: Collection[str] = (),
    overwrite: bool = False,
) -> None:
    """Run an experiment file and print its results.

    Args:
        experiment: The file.
        out: Folder for the results.
        motions: Motions folder from the command line.
        seed: Used instead of the file's own.
        as_json: Print `result.json` or `summary.json` instead of text.
        choice: Keys of `[choice]` that replace the file's own.
        without: Files that are not written, even if the experiment file asks for them.
        overwrite: Whether files that no earlier result names as its own may be replaced.

    Raises:
        typer.Exit: With code 1, if every simulation diverged or a file could not be written. A
            video that this machine cannot render does not count.
        DynrespError: It could not be done.
    """
    from dynresp.cli.result_text import choice_text, result_text, substitutes_text, summary_text
    from dynresp.experiments.experiment_reader import read_experiment
    from dynresp.results.result_json import to_json

    file = read_experiment(experiment)
    write = tuple(name for name in file.output.write if name not in without)
    file = file.model_copy(update={"output": file.output.model_copy(update={"write": write})})
    check_folder(out)
    with progress() as report:
        report("loading motions", 0, 1)
        from dynresp.experiments.runner import prepare_run, run_experiment

        loaded = prepare_run(file, experiment.parent, motions, seed, choice=choice)
        content = run_experiment(loaded, out, report, overwrite=overwrite)
    for remark in (substitutes_text(content), choice_text(content)):
        if remark:
            typer.echo(f"dynresp: {remark}", err=True)
    report_unwritten(content["files"])
    if as_json:
        typer.echo(to_json(content))
    elif "outcomes" in content:
        typer.echo(summary_text(content, out))
    else:
        typer.echo(result_text(content, out))
    if _all_diverged(content):
        typer.echo(
            "dynresp: every simulation diverged; try a lighter or slower hit",
            err=True,
        )
        raise typer.Exit(1)
    exit_if_failed(content["files"])


def report_unwritten(files: Mapping[str, str]) -> None:
    """Print which files were not written; the same reason is printed once.

    Args:
        files: For each file, what `result_folder.attempt` returned.
    """
    from dynresp.results.result_folder import WRITTEN

    reasons: dict[str, list[str]] = {}
    for name, what in files.items():
        if what != WRITTEN:
            reasons.setdefault(what, []).append(name)
    for what, names in reasons.items():
        typer.echo(f"dynresp: {', '.join(names)} {what}", err=True)


def exit_if_failed(files: Mapping[str, str]) -> None:
    """Exit with code 1 if a file failed. One that this machine cannot make did not fail.

    Args:
        files: For each file, what `result_folder.attempt` returned.

    Raises:
        typer.Exit: With code 1, if one failed.
    """
    from dynresp.results.result_folder import is_failure

    if any(is_failure(what) for what in files.values()):
        raise typer.Exit(1)


def check_folder(out: Path) -> None:
    """Check, before any work, that results can be written to a folder."""
    from dynresp.support.errors import UsageError

    if out.exists() and not out.is_dir():
        raise UsageError(f"--out: {str(out)!r} is a file; expected a folder for the results")
    # The nearest folder that exists; the others are made later.
    above = next(folder for folder in [out, *out.absolute().parents] if folder.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        raise UsageError(
            f"--out: {str(out)!r} cannot be made, because {str(above)!r} is not a folder that can "
            "be written; choose another folder"
        )


def check_file(out: Path, overwrite: bool, is_ours: Callable[[Path], bool]) -> None:
    """Check, before any work, that a file can be written.

    Args:
        out: The file.
        overwrite: Whether any file may be replaced but one that was read.
        is_ours: Says of a file that exists whether the same command has written it.

    Raises:
        UsageError: It cannot.
    """
    from dynresp.support.errors import UsageError
    from dynresp.support.inputs import noted_inputs

    if not out.name or out.is_dir():
        raise UsageError(f"--out: expected a file, got {str(out)!r}, which is a folder")
    check_folder(out.absolute().parent)
    if out.resolve() in noted_inputs():
        raise UsageError(f"--out: {str(out)!r} is read by this command; choose another name")
    if out.exists() and not overwrite and not is_ours(out):
        raise UsageError(
            f"--out: {str(out)!r} exists and is something else; choose another name, or allow to "
            "replace it (--overwrite)"
        )


def check_new(files: Sequence[Path], overwrite: bool) -> None:
    """Check, before any work, that files can be written without replacing any.

    Raises:
        UsageError: One was read, or exists and may not be replaced.
    """
    from dynresp.support.errors import UsageError
    from dynresp.support.inputs import noted_inputs

    for file in files:
        if file.resolve() in noted_inputs():
            raise UsageError(
                f"{file} is read by this command and would be replaced; choose another folder"
            )
        if file.exists() and not overwrite:
            raise UsageError(
                f"{file} exists; choose another folder, or allow to replace it (--overwrite)"
            )


def _all_diverged(content: dict[str, Any]) -> bool:
    if "outcomes" in content:
        return bool(content["outcomes"]["diverged"] == content["responses"])
    return bool(content["happened"]["outcome"] == "diverged")
