"""`dynresp demo`: the example that comes with dynresp."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli.options import ChosenBudget, Json, Motions, Overwrite, Seed
from dynresp.cli.run import choice_of, run_file

EXAMPLE = "walk_ball.toml"
"""The example, among `examples/specs/experiments`."""


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")
    ] = Path("dynresp-demo"),
    motions: Motions = None,
    seed: Seed = None,
    budget: ChosenBudget = None,
    as_json: Json = False,
    video: Annotated[
        bool, typer.Option("--video", help="Also draw video.mp4, which takes about 10 s more.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Run an example: a heavy ball hits a walking person.

    It writes the motion, a 3D recording and pictures, and a video only with --video. It needs no
    network: without motion capture on this machine it uses built-in motions.
    """
    from dynresp.support.paths import example_specs

    file = example_specs("experiments") / EXAMPLE
    choice = choice_of(budget, None)
    without = () if video else ("video.mp4",)
    run_file(file, out, motions, seed, as_json, choice, without, overwrite)
