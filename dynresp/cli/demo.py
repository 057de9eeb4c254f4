"""`dynresp demo`: the shipped example."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli.options import ChosenBudget, Json, Motions, Seed
from dynresp.cli.run import answer, choice_of

EXAMPLE = "walk_ball.toml"
"""The example that is shown, in the folder of examples."""


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")
    ] = Path("dynresp-demo"),
    motions: Motions = None,
    seed: Seed = None,
    budget: ChosenBudget = None,
    as_json: Json = False,
) -> None:
    """Run the shipped example: a heavy ball, a walking person.

    Needs no network: without motion capture on this machine it shows the built-in motions.
    """
    from dynresp.support.paths import example_specs

    answer(
        example_specs("experiments") / EXAMPLE, out, motions, seed, as_json, choice_of(budget, None)
    )
