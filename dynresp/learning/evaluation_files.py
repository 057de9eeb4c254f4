"""Write the folder of an evaluation: `evaluation.json`, `per_strategy.csv` and `confusion.png`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynresp.results.result_folder import (
    CONFUSION,
    EVALUATION,
    PER_STRATEGY,
    WRITTEN,
    attempt,
    claim,
)
from dynresp.results.result_json import versions, write_json
from dynresp.support.extras import require
from dynresp.support.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_DPI = 150
_INK = "#23272e"
# Above these numbers of classes, names or numbers would be too small to read and are left out.
_MAX_NAMED, _MAX_NUMBERED = 80, 40


FILES = (EVALUATION, PER_STRATEGY, CONFUSION)


def write_report(
    folder: Path, content: dict[str, Any], *, overwrite: bool = False
) -> dict[str, Any]:
    """Write an evaluation.

    Args:
        folder: The folder; made if it is missing.
        content: What `evaluate` gives.
        overwrite: Whether files that no earlier result names as its own may be replaced.

    Returns:
        What was written to `evaluation.json`: the content, and under `files` for each other file
        what became of it, as `result_folder.attempt` returns it.

    Raises:
        UsageError: A file of somebody else would be replaced; nothing was written.
        DynrespError: `evaluation.json` or `per_strategy.csv` cannot be written.
    """
    claim(folder, EVALUATION, FILES[1:], overwrite=overwrite)
    _write_table(folder / PER_STRATEGY, content["per_strategy"])
    files = {
        PER_STRATEGY: WRITTEN,
        CONFUSION: attempt(lambda path: write_confusion(path, content), folder / CONFUSION),
    }
    whole = {**content, "files": files, "versions": versions()}
    write_json(whole, folder / EVALUATION)
    return whole


def _write_table(path: Path, per_strategy: dict[str, dict[str, Any]]) -> None:
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        figures = next(iter(per_strategy.values()))
        writer = csv.DictWriter(file, ["strategy", *figures], lineterminator="\n")
        writer.writeheader()
        writer.writerows({"strategy": name, **row} for name, row in per_strategy.items())


def write_confusion(path: Path, content: dict[str, Any]) -> None:
    """Write the confusion matrix as a PNG; classes that were never chosen are left out.

    Args:
        path: The file; missing folders are made.
        content: What `evaluate` gives.

    Raises:
        DynrespError: The file cannot be written.
    """
    require("matplotlib")
    from matplotlib.figure import Figure

    counts = np.array(content["confusion"]["counts"])
    seen = np.flatnonzero(counts.sum(axis=0) + counts.sum(axis=1))
    counts = counts[np.ix_(seen, seen)]
    names = [content["confusion"]["classes"][i].replace("_", " ") for i in seen]
    rows = [f"{name} ({n})" for name, n in zip(names, counts.sum(axis=1), strict=True)]
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    size = 3.2 + 0.3 * min(len(seen), _MAX_NUMBERED)
    figure = Figure((size + 0.8, size), dpi=_DPI, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    image = axes.imshow(shares, cmap="Greens", vmin=0.0, vmax=1.0)
    if len(seen) <= _MAX_NAMED:
        axes.set_xticks(range(len(seen)), names, rotation=90, fontsize=7, parse_math=False)
        axes.set_yticks(range(len(seen)), rows, fontsize=7, parse_math=False)
    if len(seen) <= _MAX_NUMBERED:
        _number(axes, shares)
    axes.set_xlabel("chosen with the classifier, in use", fontsize=8.5)
    axes.set_ylabel("chosen by the full search (how often)", fontsize=8.5)
    bar = figure.colorbar(image, ax=axes, shrink=0.7, pad=0.02)
    bar.set_label("share of the row", fontsize=8.5)
    bar.ax.tick_params(labelsize=8)
    figure.suptitle(
        f"{content['accuracy']:.1%} of {content['samples']} samples as the full search chose",
        x=0.012, ha="left", fontsize=11, fontweight="bold", color=_INK,
    )  # fmt: skip
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _number(axes: Axes, shares: np.ndarray[Any, np.dtype[np.float64]]) -> None:
    """Per cent in every cell that rounds to at least one."""
    for row, column in zip(*np.nonzero(shares >= 0.005), strict=True):
        share = shares[row, column]
        axes.text(
            column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=6,
            color="white" if share > 0.55 else _INK,
        )  # fmt: skip
