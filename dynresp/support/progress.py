"""How far something that takes long has come, and what is done only once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the stage, how many are done, and of how many."""

_listeners: list[Callable[[str], None]] = []


def no_progress(stage: str, done: int, of: int) -> None:
    """Show nothing."""


def announce(work: str) -> None:
    """Say what is being done now and not again on this machine, such as compiling.

    Args:
        work: What is done, and about how long it takes. Heard only inside `hearing`.
    """
    for listener in _listeners[-1:]:
        listener(work)


@contextmanager
def hearing(listener: Callable[[str], None]) -> Iterator[None]:
    """Pass to a listener what is announced while the block runs; each text once."""
    heard: set[str] = set()

    def hear(work: str) -> None:
        if work not in heard:
            heard.add(work)
            listener(work)

    _listeners.append(hear)
    try:
        yield
    finally:
        _listeners.remove(hear)
