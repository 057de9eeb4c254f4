"""`dynresp reactions`: what a hit person can go on with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli.options import Json, Motions

app = typer.Typer(
    help="Recorded reactions that a hit can be answered with.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.callback()
def reactions() -> None:
    """Recorded reactions that a hit can be answered with."""


@app.command("list")
def list_reactions(
    library: Annotated[
        str,
        typer.Option("--library", help="core, full, builtin, or a library file (.toml)."),
    ] = "core",
    motions: Motions = None,
    as_json: Json = False,
) -> None:
    """List the reactions of a library: name, strategy, length and source.

    Without its motion capture on this machine, core is the built-in library.
    """
    from dynresp.motion.character import default_character
    from dynresp.motion.reactions.named_library import library_record, load_named_library
    from dynresp.motion.sources.motion_folders import motion_folders

    found = load_named_library(library, motion_folders(motions), Path(), 30.0, default_character())
    about = library_record(found, library)
    if as_json:
        rows = [
            {
                "name": reaction.name,
                "strategy": reaction.strategy,
                "duration_s": round(reaction.motion.duration, 3),
                "mirrored": reaction.mirrored,
                "built_in": reaction.builtin,
                "source": reaction.source,
            }
            for reaction in found.reactions
        ]
        typer.echo(json.dumps({"library": about, "reactions": rows}, indent=2))
        return
    if "instead_of" in about:
        typer.echo(
            "dynresp: the motion capture of 'core' is not on this machine; these are the built-in "
            "reactions. `dynresp motions fetch core` gets it.",
            err=True,
        )
    width = max(len(reaction.name) for reaction in found.reactions)
    for reaction in found.reactions:
        typer.echo(
            f"{reaction.name:<{width}}  {reaction.strategy:<24}  "
            f"{reaction.motion.duration:5.2f} s  {reaction.source}"
        )
