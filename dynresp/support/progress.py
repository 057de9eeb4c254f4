"""Who is told how far something that takes long has come."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Told the stage, how many are done, and of how many."""
