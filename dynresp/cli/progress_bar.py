"""Progress on standard error: a bar on a terminal, a line for each stage elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from dynresp.support.progress import Progress, hearing


@contextmanager
def progress() -> Iterator[Progress]:
    """What shows progress while the block runs."""
    if sys.stderr.isatty():
        with _bar() as report:
            yield report
    else:
        with hearing(lambda work: typer.echo(f"{work} ...", err=True)):
            yield _lines()


def _lines() -> Progress:
    """A line when a stage begins."""
    last = ""

    def report(stage: str, done: int, of: int) -> None:
        nonlocal last
        if stage != last:
            typer.echo(f"{stage} ...", err=True)
            last = stage

    return report


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("starting", total=None)

        def report(stage: str, done: int, of: int) -> None:
            bars.update(task, description=stage, completed=done, total=max(of, 1))

        with hearing(lambda work: bars.console.print(f"{work} ...", highlight=False)):
            yield report
