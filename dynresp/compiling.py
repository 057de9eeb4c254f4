"""Compiling with numba, with or without a place to keep what was compiled.

Numba keeps compiled code until the file of the function changes; that a function of another file,
which was compiled into it, has changed it does not notice. So what was kept before the newest of
our source files was written is thrown away here.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit

from dynresp.paths import PACKAGE_FOLDER


def compiled(signature: Any, **options: Any) -> Callable[[Any], Any]:
    """Compile a function for a signature; kept for the next process where a folder can be written.

    Args:
        signature: A type of numba.
        options: Of `numba.njit`, beside `cache` and `nogil`.
    """

    def compile_it(function: Any) -> Any:
        _forget_stale(function)
        try:
            return njit(signature, cache=True, nogil=True, **options)(function)
        except RuntimeError:
            # Numba found no place for its cache: an installation and a home that are read-only.
            return njit(signature, nogil=True, **options)(function)

    return compile_it


def _forget_stale(function: Any) -> None:
    """Throw away the index of what numba has kept of a function, where it may be out of date."""
    source = Path(function.__code__.co_filename)
    name = f"{source.stem}.{function.__qualname__}-{function.__code__.co_firstlineno}.*.nbi"
    for index in (source.parent / "__pycache__").glob(name):
        # A folder that cannot be written keeps what it has; another process may be faster.
        with suppress(OSError):
            if index.stat().st_mtime < _newest_source():
                index.unlink()


@functools.cache
def _newest_source() -> float:
    """When the newest of the package's source files was written [s]."""
    return max(file.stat().st_mtime for file in PACKAGE_FOLDER.rglob("*.py"))
