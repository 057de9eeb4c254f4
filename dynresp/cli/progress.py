"""Progress on standard error: a bar on a terminal, a line for each stage elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer

Tell = Callable[[str, int, int], None]
"""Told the stage, how many are done, and of how many."""


@contextmanager
def progress() -> Iterator[Tell]:
    """What to tell progress to, while the block runs."""
    if sys.stderr.isatty():
        with _bar() as tell:
            yield tell
    else:
        yield _lines()


def _lines() -> Tell:
    """A line whenever another stage begins."""
    last = ""

    def tell(stage: str, done: int, of: int) -> None:
        nonlocal last
        if stage != last:
            typer.echo(f"{stage} ...", err=True)
            last = stage

    return tell


@contextmanager
def _bar() -> Iterator[Tell]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("starting", total=None)

        def tell(stage: str, done: int, of: int) -> None:
            bars.update(task, description=stage, completed=done, total=max(of, 1))

        yield tell
