"""`dynresp bench`: how fast dynresp is on this machine."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

from dynresp.cli.options import ChosenClassifier, Json, Motions, Seed

if TYPE_CHECKING:
    from dynresp.bench.measure import BenchResult

app = typer.Typer(
    help="Measure how fast dynresp is on this machine.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.command()
def physics(seed: Seed = None, as_json: Json = False) -> None:
    """Measure simulation steps a second, beside mujoco.rollout on one thread."""
    typer.echo("stepping for about ten seconds ...", err=True)
    from dynresp.bench import physics_speed as bench

    _print(bench.run(seed or 0), as_json)


@app.command()
def respond(
    classifier: ChosenClassifier = None,
    motions: Motions = None,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """Measure the time from a hit to a planned response, for each budget."""
    typer.echo("throwing balls for about half a minute ...", err=True)
    from dynresp.bench import response_speed as bench

    _print(bench.run(seed or 0, classifier, motions), as_json)


@app.command()
def generate(motions: Motions = None, seed: Seed = None, as_json: Json = False) -> None:
    """Measure training samples a second, beside making them one by one."""
    typer.echo("labelling for about ten seconds ...", err=True)
    from dynresp.bench import generation_speed as bench

    _print(bench.run(seed or 0, motions), as_json)


def _print(result: BenchResult, as_json: bool) -> None:
    typer.echo(json.dumps(result.to_json(), indent=2) if as_json else result.to_text())
