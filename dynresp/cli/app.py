"""All commands, and how their errors become messages and exit codes."""

from __future__ import annotations

import errno
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from dynresp import __version__
from dynresp.cli import bench, demo, evaluate, generate, graph, motions, reactions, run, train
from dynresp.cli.interruption import INTERRUPTED
from dynresp.support.errors import DynrespError
from dynresp.support.inputs import inputs_noted


class Commands(TyperGroup):
    """Turns errors into a message and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            with inputs_noted():
                return super().invoke(ctx)
        except DynrespError as error:
            typer.echo(f"dynresp: {error}", err=True)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            # `dynresp.cli.main` prints the message.
            raise typer.Exit(INTERRUPTED) from None
        except OSError as error:
            # Output to a closed pipe, as with `dynresp ... | head`: typer handles it.
            if error.errno == errno.EPIPE:
                raise
            typer.echo(f"dynresp: {error}", err=True)
            raise typer.Exit(DynrespError.exit_code) from None
        except MemoryError:
            typer.echo(
                "dynresp: this machine has not enough memory; try fewer hits or a shorter motion",
                err=True,
            )
            raise typer.Exit(DynrespError.exit_code) from None


app = typer.Typer(
    name="dynresp",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"dynresp {__version__}")
        raise typer.Exit


@app.callback()
def dynresp(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    """Hit a simulated person; dynresp computes how the person reacts and goes on moving."""


app.command("run")(run.run)
app.command("demo")(demo.demo)
app.command("generate")(generate.generate)
app.command("train")(train.train)
app.command("evaluate")(evaluate.evaluate)
app.add_typer(graph.app, name="graph")
app.add_typer(motions.app, name="motions")
app.add_typer(reactions.app, name="reactions")
app.add_typer(bench.app, name="bench")
