"""All commands together, and what becomes of their errors."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from dynresp import __version__
from dynresp.cli import bench, demo, motions, reactions, run
from dynresp.errors import DynrespError

INTERRUPTED = 130


class Commands(TyperGroup):
    """Turns the product's errors into a message and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except DynrespError as error:
            typer.echo(f"dynresp: {error}", err=True)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            typer.echo("dynresp: interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except MemoryError:
            typer.echo("dynresp: not enough memory on this machine for that", err=True)
            raise typer.Exit(DynrespError.exit_code) from None


app = typer.Typer(
    name="dynresp",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"dynresp {__version__}")
        raise typer.Exit


@app.callback()
def dynresp(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """Simulated people who take a hit and go on moving like people."""


app.command("run")(run.run)
app.command("demo")(demo.demo)
app.add_typer(motions.app, name="motions")
app.add_typer(reactions.app, name="reactions")
app.add_typer(bench.app, name="bench")
