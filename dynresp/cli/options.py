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
        help="Folder of motion files; by default DYNRESP_MOTIONS, else what was fetched.",
    ),
]
Seed: TypeAlias = Annotated[
    int | None,
    typer.Option("--seed", min=0, max=2**63 - 1, help="Seed of all that is random."),
]
Json: TypeAlias = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object instead of text."),
]


class Budget(StrEnum):
    """How much is spent on choosing a reaction."""

    fast = "fast"
    better = "better"
    best = "best"


ChosenBudget: TypeAlias = Annotated[
    Budget | None,
    typer.Option(
        "--budget",
        help="fast: the classifier's first choice (the default); better: the better one of its "
        "two best; best: the oracle searches all reactions.",
    ),
]
ChosenClassifier: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--classifier",
        metavar="MODEL",
        help="A classifier that `dynresp train` has written; by default the one kept for the "
        "library.",
    ),
]
