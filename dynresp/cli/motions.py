"""`dynresp motions`: list, show, import, export and fetch motions."""

from __future__ import annotations

import typer

from dynresp.cli import motions_exchange, motions_fetch, motions_list, motions_show

app = typer.Typer(
    help="List, show, import, export and fetch motions.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.command("list")(motions_list.list_motions)
app.command("show")(motions_show.show)
app.command("import")(motions_exchange.import_motions)
app.command("export")(motions_exchange.export)
app.command("fetch")(motions_fetch.fetch)
