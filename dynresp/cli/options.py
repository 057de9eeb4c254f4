"""Options that mean the same with every command."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

Motions: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--motions",
        metavar="DIR",
        help="Folder of motion files; by default DYNRESP_MOTIONS, else the fetched files.",
    ),
]
Seed: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--seed",
        min=0,
        max=2**63 - 1,
        help="Seed of all random values: the same seed gives the same result.",
    ),
]
Json: TypeAlias = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object instead of text."),
]

Overwrite: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--overwrite",
        help="Also replace files that no earlier result in the folder names as its own.",
    ),
]
OverwriteFile: TypeAlias = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace what is there, even if it is something else."),
]
OverwriteFiles: TypeAlias = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that exist.")
]


class Budget(StrEnum):
    """How much time the choice of a reaction may take."""

    fast = "fast"
    better = "better"
    best = "best"


ChosenBudget: TypeAlias = Annotated[
    Budget | None,
    typer.Option(
        "--budget",
        help="How to choose the reaction. fast: the classifier's first choice (default); better: "
        "the better of its two best; best: full search (oracle), which compares all reactions.",
    ),
]
ChosenClassifier: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--classifier",
        metavar="MODEL",
        help="A classifier file from `dynresp train`; by default the one trained or shipped for "
        "the library.",
    ),
]
