"""`dynresp evaluate`: how well a classifier chooses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dynresp.cli.options import Json
from dynresp.cli.progress_bar import progress


def evaluate(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="File that `dynresp train` has written.")
    ],
    dataset: Annotated[
        Path, typer.Argument(metavar="DATASET", help="Folder that `dynresp generate` has written.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for evaluation.json, per_strategy.csv and confusion.png.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Judge a classifier by samples that it was not trained on, with baselines beside it.

    Of the dataset that it was trained on, only the samples held out count; of any other, all.
    """
    from dynresp.cli.run import check_folder, exit_if_failed, report_unwritten
    from dynresp.cli.train import with_elapsed
    from dynresp.support.extras import require

    require("pyarrow", "sklearn")
    if out is not None:
        check_folder(out)
    with progress() as told:
        tell = with_elapsed(told)
        tell("reading", 0, 1)
        from dynresp.datasets.dataset_reader import load_dataset
        from dynresp.learning import evaluation as judging
        from dynresp.response.prediction.classifier_file import load_classifier
        from dynresp.results.result_folder import WRITTEN
        from dynresp.results.result_json import to_json

        files: dict[str, str] = {}
        content = judging.evaluate(load_classifier(model), load_dataset(dataset), tell)
        if out is not None:
            tell("writing", 0, 1)
            from dynresp.learning.evaluation_files import write_report

            files = write_report(out, content)
    if content["differing_settings"]:
        typer.echo(
            "dynresp: the dataset was made under other settings than the classifier was trained "
            f"for: {', '.join(content['differing_settings'])}",
            err=True,
        )
    report_unwritten(files)
    if as_json:
        typer.echo(to_json(content))
    else:
        typer.echo(_told(content))
        if out is not None:
            written = [name for name, what in files.items() if what == WRITTEN]
            typer.echo(f"  written    {out}: {', '.join(written)}")
    exit_if_failed(files)


def _told(content: dict[str, Any]) -> str:
    from dynresp.cli.train import figures_told

    model, dataset, left = content["model"], content["dataset"], content["left_out"]
    which = "held-out samples" if content["held_out_only"] else "samples"
    lines = [
        f"{model['grouping']} of the library {dataset['library']!r}, trained on "
        f"{model['trained_on']['samples']} samples",
        f"  judged by  {content['samples']} {which} of {dataset['plan']!r}; left out: "
        f"{left['nothing_hit']} in which nothing was hit, {left['features_missing']} with features "
        f"missing, {left['not_held_out']} not held out",
    ]
    rows = {
        "exact": content,
        "reduced": content["reduced"],
        **{name.replace("_", " "): row for name, row in content["baselines"].items()},
    }
    for name, row in rows.items():
        if row is None:
            lines.append(f"  {name}: needs the samples trained on, which are not in this dataset")
            continue
        as_one = row["mirrors_as_one"]
        lines += [
            f"  {name}",
            f"    in use           {figures_told(row)}",
            f"    alone            {figures_told(row['alone'])}",
            f"    mirrors as one   accuracy {as_one['accuracy']:.1%}, two best "
            f"{as_one['top2_accuracy']:.1%}; strategy {row['strategy_accuracy']:.1%}",
        ]
    lines.append(f"  reduced and exact agree in {content['reduced']['agreement']:.1%}")
    for name, took in content["latency_us"].items():
        lines.append(
            f"  {name:<10} {took['alone']:.1f} us alone, {took['in_batch']:.1f} us each of a "
            "thousand"
        )
    lines.append(f"  {'strategy':<26}{'samples':>9}{'accuracy':>10}{'two best':>10}{'regret':>9}")
    for name, row in content["per_strategy"].items():
        lines.append(
            f"  {name:<26}{row['samples']:>9}{row['accuracy']:>10.1%}"
            f"{row['top2_accuracy']:>10.1%}{row['regret']:>9.2%}"
        )
    return "\n".join(lines)
