"""`dynresp train`: train a classifier on a dataset."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynresp.cli.options import Json, OverwriteFile, Seed
from dynresp.cli.progress_bar import progress
from dynresp.support.progress import Progress

if TYPE_CHECKING:
    from dynresp.response.prediction.classifier import Classifier

# Without a terminal, progress writes a line this often [s].
_LINE_S = 20.0


class Vector(StrEnum):
    """The feature vectors."""

    large = "large"
    small = "small"


class Grouping(StrEnum):
    """What a class stands for."""

    reactions = "reactions"
    strategies = "strategies"


def train(
    dataset: Annotated[
        Path, typer.Argument(metavar="DATASET", help="Folder that `dynresp generate` has written.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="MODEL",
            help="File to write, *.skops; by default where `dynresp run` finds it.",
        ),
    ] = None,
    vector: Annotated[
        Vector,
        typer.Option(
            "--vector", help="Features: states of the bodies (large), or 20 numbers (small)."
        ),
    ] = Vector.large,
    slices: Annotated[
        str | None,
        typer.Option(
            "--slices",
            metavar="S,S,...",
            help="Use only features of these times after contact [s], such as 0,0.1,0.2,0.3.",
        ),
    ] = None,
    classes: Annotated[
        Grouping,
        typer.Option("--classes", help="One class per reaction, or one per strategy."),
    ] = Grouping.reactions,
    samples: Annotated[
        int | None,
        typer.Option("--samples", min=2, help="Train on at most this many samples."),
    ] = None,
    held_out: Annotated[
        float,
        typer.Option(
            "--held-out", min=0.0, max=0.9, help="Share of the samples kept for the evaluation."
        ),
    ] = 0.1,
    compiled_only: Annotated[
        bool,
        typer.Option(
            "--compiled-only",
            help="Leave out the scikit-learn pipelines, and so all training samples; single "
            "precision. A smaller file that can be passed on.",
        ),
    ] = False,
    overwrite: OverwriteFile = False,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """Train a classifier to choose the reaction that the full search chose.

    Then measure it on samples that were not trained on.
    """
    from dynresp.cli.run import check_file
    from dynresp.support.errors import UsageError
    from dynresp.support.extras import require

    require("pyarrow", "sklearn", "skops")
    if out is not None and (out.suffix != ".skops" or out.is_dir()):
        raise UsageError(f"--out: {str(out)!r}: expected a file name that ends in .skops")
    if out is not None:
        check_file(out, overwrite, _is_classifier)
    with progress() as plain:
        report = with_elapsed(plain)
        report("reading", 0, 1)
        from dynresp.datasets.dataset_reader import load_dataset
        from dynresp.learning import training as learning
        from dynresp.learning.holdout import Split
        from dynresp.response.prediction.classifier_file import save_classifier
        from dynresp.response.prediction.hit_features import SLICES_S
        from dynresp.support.paths import classifier_file

        config = learning.TrainConfig(
            vector=vector.value,
            slices_s=SLICES_S if slices is None else _slices(slices),
            grouping=classes.value,
            samples=samples,
            split=Split(seed or 0, held_out),
        )
        data = load_dataset(dataset)
        file = out or classifier_file(data.facts.library_identity)
        check_file(file, overwrite, _is_classifier)
        trained = learning.train(data, config, report)
        report("writing", 0, 1)
        if compiled_only:
            exact = trained.classifier.exact.single_precision()
            save_classifier(file, replace(trained.classifier, exact=exact), None)
        else:
            save_classifier(file, trained.classifier, trained.pipelines)
    if as_json:
        typer.echo(json.dumps(_content(trained.classifier, file), indent=2))
    else:
        typer.echo(_text(trained.classifier, file))


def _is_classifier(file: Path) -> bool:
    from dynresp.response.prediction.classifier_file import load_classifier
    from dynresp.support.errors import DynrespError

    try:
        load_classifier(file)
    except DynrespError:
        return False
    return True


def with_elapsed(report: Progress, clock: Callable[[], float] = time.monotonic) -> Progress:
    """Progress with the time that a stage has taken; without a terminal only every 20 s.

    Args:
        report: The progress to call.
        clock: Gives seconds.
    """
    every = 0.0 if sys.stderr.isatty() else _LINE_S
    stage, began, written_at = "", 0.0, 0.0

    def with_time(current: str, done: int, of: int) -> None:
        nonlocal stage, began, written_at
        now = clock()
        if current != stage:
            stage, began, written_at = current, now, now
            report(stage, done, of)
        elif now - written_at >= every:
            written_at = now
            report(f"{stage}, {now - began:.0f} s", done, of)

    return with_time


def _slices(given: str) -> tuple[float, ...]:
    from dynresp.support.errors import UsageError

    try:
        return tuple(float(part) for part in given.split(","))
    except ValueError:
        raise UsageError(
            f"--slices: expected times in seconds such as 0,0.1,0.2,0.3, got {given!r}"
        ) from None


def _content(classifier: Classifier, file: Path) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "file": str(file),
        "grouping": classifier.grouping,
        "classes": list(classifier.classes),
        "absent": list(classifier.absent),
        "trained_for": asdict(classifier.trained_for),
        "trained_on": asdict(classifier.trained_on),
        **classifier.facts,
    }


def _text(classifier: Classifier, file: Path) -> str:
    facts, on = classifier.facts, classifier.trained_on
    slices = ", ".join(f"{slice_s:g}" for slice_s in facts["slices_s"])
    best = facts["models"]["exact"]
    lines = [
        f"trained on {on.samples} samples for the library {classifier.trained_for.library_name!r} "
        f"in {facts['training_s']:.0f} s",
        f"  left out   {facts['left_out']} samples: missed, diverged or incomplete",
        f"  classes    {len(classifier.classes)} {classifier.grouping}",
        f"  features   {len(classifier.feature_names)}, {facts['vector']}, at {slices} s",
        f"  parameters C {best['penalty']:g}, gamma {best['gamma_factor']:g} of scale",
    ]
    if classifier.absent:
        lines.append(f"  never seen {', '.join(classifier.absent)}")
    for name, model in facts["models"].items():
        lines.append(
            f"  {name:<10} {model['components']} components, {model['support_vectors']} support "
            "vectors"
        )
        held = model["held_out"]
        if held is not None:
            lines.append(f"    of {held['samples']} held out, in use   {choice_metrics_text(held)}")
            lines.append(f"    alone            {choice_metrics_text(held['alone'])}")
    lines.append(f"  written    {file}")
    return "\n".join(lines)


def choice_metrics_text(figures: dict[str, Any]) -> str:
    """Accuracy and regret in one line."""
    return (
        f"accuracy {figures['accuracy']:.1%}, two best {figures['top2_accuracy']:.1%}, "
        f"within 1 % {figures['within_1_percent']:.1%}, regret {figures['regret']:.2%}, "
        f"two best {figures['regret_top2']:.3%}"
    )
