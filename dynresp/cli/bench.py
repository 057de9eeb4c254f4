"""`dynresp bench`: how fast it is on this machine."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

from dynresp.cli.options import Json, Seed

if TYPE_CHECKING:
    from dynresp.bench.measure import BenchResult

app = typer.Typer(
    help="Measure how fast it is on this machine.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.command()
def physics(seed: Seed = None, as_json: Json = False) -> None:
    """Steps a second of simulated hits, against one thread of mujoco.rollout."""
    typer.echo("stepping for about ten seconds ...", err=True)
    from dynresp.bench import physics as bench

    _print(bench.run(seed or 0), as_json)


@app.command()
def oracle(seed: Seed = None, as_json: Json = False) -> None:
    """Search time a reaction, against vectorised NumPy and a readable twin."""
    typer.echo("searching for about five seconds ...", err=True)
    from dynresp.bench import oracle as bench

    _print(bench.run(seed or 0), as_json)


def _print(result: BenchResult, as_json: bool) -> None:
    typer.echo(json.dumps(result.to_json(), indent=2) if as_json else result.to_text())
