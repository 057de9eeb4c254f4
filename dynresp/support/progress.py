"""Reporting the progress of long work."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the stage, how many steps are done, and of how many."""


def no_progress(stage: str, done: int, of: int) -> None:
    """Show nothing."""
