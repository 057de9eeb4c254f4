"""`dynresp evaluate`: measure how well a classifier chooses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dynresp.cli.options import Json, Overwrite
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
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Measure how well a classifier chooses, beside simple baselines.

    Of its own training dataset only the held-out samples count; of any other dataset all.
    """
    from dynresp.cli.run import check_folder, exit_if_failed, report_unwritten
    from dynresp.cli.train import with_elapsed
    from dynresp.support.extras import require

    require("pyarrow", "sklearn")
    if out is not None:
        from dynresp.learning.evaluation_files import FILES
        from dynresp.results.result_folder import check_claim

        check_folder(out)
        check_claim(out, FILES, overwrite=overwrite)
    with progress() as plain:
        report = with_elapsed(plain)
        report("reading", 0, 1)
        from dynresp.datasets.dataset_reader import load_dataset
        from dynresp.learning import evaluation
        from dynresp.response.prediction.classifier_file import load_classifier
        from dynresp.results.result_folder import EVALUATION, WRITTEN
        from dynresp.results.result_json import to_json

        content = evaluation.evaluate(load_classifier(model), load_dataset(dataset), report)
        if out is not None:
            report("writing", 0, 1)
            from dynresp.learning.evaluation_files import write_report

            content = write_report(out, content, overwrite=overwrite)
    if content["differing_settings"]:
        typer.echo(
            "dynresp: the dataset was made with other settings than the training data: "
            f"{', '.join(content['differing_settings'])}",
            err=True,
        )
    files: dict[str, str] = content.get("files", {})
    report_unwritten(files)
    if as_json:
        typer.echo(to_json(content))
    else:
        typer.echo(_text(content))
        if out is not None:
            written = [EVALUATION, *(name for name, what in files.items() if what == WRITTEN)]
            typer.echo(f"  written    {out}: {', '.join(written)}")
    exit_if_failed(files)


def _text(content: dict[str, Any]) -> str:
    from dynresp.cli.train import choice_metrics_text

    model, dataset, left = content["model"], content["dataset"], content["left_out"]
    which = "held-out samples" if content["held_out_only"] else "samples"
    lines = [
        f"{model['grouping']} of the library {dataset['library']!r}, trained on "
        f"{model['trained_on']['samples']} samples",
        f"  measured   {content['samples']} {which} of {dataset['plan']!r}; left out: "
        f"{left['nothing_hit']} missed or diverged, {left['features_missing']} with missing "
        f"features, {left['not_held_out']} trained on",
    ]
    rows = {
        "exact": content,
        "reduced": content["reduced"],
        **{name.replace("_", " "): row for name, row in content["baselines"].items()},
    }
    for name, row in rows.items():
        if row is None:
            lines.append(f"  {name}: needs the training samples, which are not in this dataset")
            continue
        as_one = row["mirrors_as_one"]
        lines += [
            f"  {name}",
            f"    in use           {choice_metrics_text(row)}",
            f"    alone            {choice_metrics_text(row['alone'])}",
            f"    mirrors as one   accuracy {as_one['accuracy']:.1%}, two best "
            f"{as_one['top2_accuracy']:.1%}; strategy {row['strategy_accuracy']:.1%}",
        ]
    lines.append(f"  reduced and exact agree in {content['reduced']['agreement']:.1%}")
    for name, took in content["latency_us"].items():
        lines.append(
            f"  {name:<10} {took['alone']:.1f} us alone, {took['in_batch']:.1f} us each in batches"
        )
    lines.append(f"  {'strategy':<26}{'samples':>9}{'accuracy':>10}{'two best':>10}{'regret':>9}")
    for name, row in content["per_strategy"].items():
        lines.append(
            f"  {name:<26}{row['samples']:>9}{row['accuracy']:>10.1%}"
            f"{row['top2_accuracy']:>10.1%}{row['regret']:>9.2%}"
        )
    lines += [
        "  in use: the responder itself measures whether a reaction is needed; alone: not",
        "  regret: mean excess of the mismatch of the choice over that of the full search",
    ]
    return "\n".join(lines)
