"""Compiling with numba, with or without a place to keep what was compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(signature: Any, **options: Any) -> Callable[[Any], Any]:
    """Compile a function for a signature; kept for the next process where a folder can be written.

    Args:
        signature: A type of numba.
        options: Of `numba.njit`, beside `cache` and `nogil`.
    """

    def compile_it(function: Any) -> Any:
        try:
            return njit(signature, cache=True, nogil=True, **options)(function)
        except RuntimeError:
            # Numba found no place for its cache: an installation and a home that are read-only.
            return njit(signature, nogil=True, **options)(function)

    return compile_it
