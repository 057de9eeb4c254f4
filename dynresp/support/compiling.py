"""Compiling functions with numba, and keeping the compiled code if a folder can be written.

Numba keeps compiled code until the file of the function changes. It does not notice if a function
of another file, which was compiled into it, has changed. So compiled code that is older than the
newest kernel file is removed here. For that to be enough, every compiled function is in a file
`*_kernel.py`, and such a file imports from dynresp only other kernel files and this one.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit

from dynresp.support.paths import PACKAGE_FOLDER


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
            if index.stat().st_mtime < _newest_kernel():
                index.unlink()


@functools.cache
def _newest_kernel() -> float:
    """When the newest of the package's kernels was written [s]."""
    return max(file.stat().st_mtime for file in PACKAGE_FOLDER.rglob("*_kernel.py"))
