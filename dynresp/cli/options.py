"""Options that mean the same with every command."""

from __future__ import annotations

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
