"""Which files were read, so that no result is written over them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path

_NOTED: ContextVar[set[Path] | None] = ContextVar("inputs", default=None)


@contextmanager
def inputs_noted() -> Iterator[set[Path]]:
    """Note which files the block reads; a block inside another notes for both.

    Yields:
        The files, resolved; it grows while the block runs.
    """
    there = _NOTED.get()
    if there is not None:
        yield there
        return
    files: set[Path] = set()
    token = _NOTED.set(files)
    try:
        yield files
    finally:
        _NOTED.reset(token)


def noted_inputs() -> set[Path]:
    """What was noted so far; nothing outside a block of `inputs_noted`."""
    return _NOTED.get() or set()


def note_input(path: Path) -> None:
    """Note that a file is read by something that opens it itself."""
    noted = _NOTED.get()
    if noted is not None:
        noted.add(path.resolve())


def open_input(path: Path) -> BufferedReader:
    """Open a user's file for reading bytes, and note it.

    Raises:
        OSError: It cannot be opened.
    """
    file = path.open("rb")
    note_input(path)
    return file
