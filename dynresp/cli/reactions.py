"""`dynresp reactions`: the reactions of a library."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli.options import Json, Motions

app = typer.Typer(
    help="Reactions that can follow a hit.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.callback()
def reactions() -> None:
    """Reactions that can follow a hit."""


@app.command("list")
def list_reactions(
    library: Annotated[
        str,
        typer.Option("--library", help="core, full, builtin, or a library file (.toml)."),
    ] = "core",
    motions: Motions = None,
    as_json: Json = False,
) -> None:
    """List the reactions of a library: name, strategy, duration and source.

    If the motion capture of core is not on this machine, the built-in library takes its place.
    """
    from dynresp.motion.character import default_character
    from dynresp.motion.reactions.named_library import library_record, load_named_library
    from dynresp.motion.sources.motion_folders import motion_folders

    found = load_named_library(library, motion_folders(motions), Path(), 30.0, default_character())
    record = library_record(found, library)
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
        typer.echo(json.dumps({"library": record, "reactions": rows}, indent=2))
        return
    if "instead_of" in record:
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
