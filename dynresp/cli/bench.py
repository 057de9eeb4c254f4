"""`dynresp bench`: how fast it is on this machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dynresp.bench.graph_parts import Part, run_part
from dynresp.cli.options import ChosenClassifier, Json, Motions, Seed
from dynresp.support.errors import UsageError

if TYPE_CHECKING:
    from dynresp.bench.graph_figures import GraphFigures
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
    from dynresp.bench import physics_speed as bench

    _print(bench.run(seed or 0), as_json)


@app.command()
def oracle(seed: Seed = None, as_json: Json = False) -> None:
    """Search time a reaction, against vectorised NumPy and a readable twin."""
    typer.echo("searching for about five seconds ...", err=True)
    from dynresp.bench import full_search_speed as bench

    _print(bench.run(seed or 0), as_json)


@app.command()
def align(seed: Seed = None, as_json: Json = False) -> None:
    """Time to align one reaction, and its error, against exhaustive alignment."""
    typer.echo("simulating and aligning for about ten seconds ...", err=True)
    from dynresp.bench import alignment_speed as bench

    _print(bench.run(seed or 0), as_json)


@app.command()
def select(
    classifier: Annotated[
        Path | None,
        typer.Option(
            "--classifier",
            metavar="MODEL",
            help="A classifier with its pipelines; by default a synthetic problem.",
        ),
    ] = None,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """Time to predict which reaction fits, against scikit-learn's own predict."""
    typer.echo("training and predicting for about ten seconds ...", err=True)
    from dynresp.bench import prediction_speed as bench

    _print(bench.run(seed or 0, model=classifier), as_json)


@app.command()
def respond(
    classifier: ChosenClassifier = None,
    motions: Motions = None,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """Time from a hit to a finished plan on one core, with every budget."""
    typer.echo("throwing balls for about half a minute ...", err=True)
    from dynresp.bench import response_speed as bench

    _print(bench.run(seed or 0, classifier, motions), as_json)


@app.command()
def generate(motions: Motions = None, seed: Seed = None, as_json: Json = False) -> None:
    """Labelled samples a second on one core, against a loop hit by hit."""
    typer.echo("labelling for about ten seconds ...", err=True)
    from dynresp.bench import generation_speed as bench

    _print(bench.run(seed or 0, motions), as_json)


@app.command()
def graph(
    part: Annotated[
        Part,
        typer.Option("--part", help="What is measured: building a graph, or what is done with it."),
    ] = Part.build,
    plan: Annotated[
        str | None,
        typer.Option(
            "--plan",
            metavar="PLAN",
            help="Name or file of the graph plan to measure; by default all that the part is for "
            "and whose motions are here. Not for build.",
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            "--count",
            min=3,
            max=100_000_000,
            help="Frames, moments, starts, paths, terrains or hits, as the part has them; by "
            "default as many as its figures are stated for. Not for build and all.",
        ),
    ] = None,
    sizes: Annotated[
        list[int] | None,
        typer.Option(
            "--sizes",
            min=1000,
            max=1_000_000,
            metavar="N",
            help="With build: a further number of frames whose graph is built; may be repeated.",
        ),
    ] = None,
    motions: Motions = None,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """Time to build a motion graph, against vectorised NumPy, and figures of its use."""
    _refuse_unused(part, plan, count, sizes)
    parts = [one for one in Part if one is not Part.all] if part is Part.all else [part]
    results: dict[str, BenchResult | GraphFigures] = {}
    for one in parts:
        typer.echo(f"measuring: {one.value} ...", err=True)
        if one is Part.build:
            from dynresp.bench import graph_speed as bench

            results[one] = bench.run(seed or 0, motions, sizes=sizes or ())
        else:
            results[one] = run_part(one, seed or 0, motions, plan=plan, count=count or 0)
        if not as_json:
            typer.echo(results[one].to_text())
    if as_json:
        told = {name: result.to_json() for name, result in results.items()}
        typer.echo(json.dumps(told if part is Part.all else told[part], indent=2))


def _refuse_unused(
    part: Part, plan: str | None, count: int | None, sizes: list[int] | None
) -> None:
    """Refuse options that the part has no use for.

    Raises:
        UsageError: There is one.
    """
    whole = part in (Part.build, Part.all)
    for name, given, unused in (
        ("--plan", plan, part is Part.build),
        ("--count", count, whole or part is Part.rules),
        ("--sizes", sizes, not whole),
    ):
        if given and unused:
            raise UsageError(f"{name} says nothing to --part {part.value}; leave it out")


@app.command()
def video(
    clusters: Annotated[
        list[int] | None,
        typer.Option(
            "--clusters",
            min=2,
            max=50,
            metavar="K",
            help="How many clusters at most; may be repeated. By default 5.",
        ),
    ] = None,
    motions: Motions = None,
    seed: Seed = None,
    as_json: Json = False,
) -> None:
    """How well an avatar follows strangers in videos, one studio left out at a time."""
    typer.echo("filming and watching people for about twelve minutes ...", err=True)
    from dynresp.bench import video as bench
    from dynresp.locomotion.vision.visible_clusters import MAX_VISIBLE_CLUSTERS

    def progress(doing: str) -> None:
        typer.echo(doing, err=True)

    counts = clusters or [MAX_VISIBLE_CLUSTERS]
    _print(bench.run(seed or 0, motions, clusters=counts, progress=progress), as_json)


def _print(result: BenchResult, as_json: bool) -> None:
    typer.echo(json.dumps(result.to_json(), indent=2) if as_json else result.to_text())
