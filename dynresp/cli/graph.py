"""`dynresp graph`: motion graphs, and avatars that walk through them."""

from __future__ import annotations

import typer

from dynresp.cli.graph_build import build
from dynresp.cli.graph_info import info
from dynresp.cli.graph_sketch import sketch
from dynresp.cli.graph_walk import walk
from dynresp.cli.graph_watch import watch

app = typer.Typer(
    help="Motion graphs: avatars that walk without end through recorded motion.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.command()(build)
app.command()(info)
app.command()(walk)
app.command()(sketch)
app.command()(watch)
