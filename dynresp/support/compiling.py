"""Compiling with numba: at the first call, and kept for the next process where that is possible.

Compiling is slow (1 to 3 s a kernel), and even loading what was compiled before takes a tenth of a
second. So a kernel is compiled, or loaded, when it is first called: a program pays for what it
uses.

Numba keeps compiled code until the file of the function changes. It does not notice that a function
of another file, which was compiled into it, has changed. So compiled code that is older than the
newest of our kernels is thrown away here. For that to be enough, every compiled function lies in a
file `*_kernel.py`, and such a file imports from no other files of ours than these and this one.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit, types
from numba.core import event

from dynresp.support.paths import PACKAGE_FOLDER
from dynresp.support.progress import announce

_LOCK = threading.RLock()
"""One for all kernels: compiling one may compile others."""


class Kernel:
    """A function that is compiled for its signature when it is first called.

    Other kernels may call it, too.

    Attributes:
        py_func: The function as it was written, for tests that run it without compiling.
    """

    def __init__(self, function: Any, signature: Any, options: dict[str, Any]) -> None:
        """Compile nothing yet.

        Args:
            function: The function.
            signature: A type of numba.
            options: Of `numba.njit`.
        """
        self.py_func = function
        self._signature, self._options = signature, options
        self._compiled: Any = None
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Run it; the first call compiles it or loads what was compiled."""
        return (self._compiled or self.compiled())(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for where another kernel calls it."""
        return types.Dispatcher(self.compiled())

    def compiled(self) -> Any:
        """What numba made of it."""
        with _LOCK:
            if self._compiled is None:
                _forget_stale(self.py_func)
                self._compiled = self._compile()
            return self._compiled

    def _compile(self) -> Any:
        try:
            dispatcher = njit(cache=True, nogil=True, no_cfunc_wrapper=True, **self._options)(
                self.py_func
            )
        except RuntimeError:
            # Numba found no place for its cache: an installation and a home that are read-only.
            dispatcher = njit(nogil=True, no_cfunc_wrapper=True, **self._options)(self.py_func)
        # The event comes where it is compiled, and not where it is loaded.
        with event.install_listener("numba:compile", _Announcer()):
            dispatcher.compile(self._signature)
        dispatcher.disable_compile()
        return dispatcher


class _Announcer(event.Listener):  # type: ignore[misc]
    """Announces that something is compiled."""

    def on_start(self, event: Any) -> None:
        """Compiling begins."""
        announce("compiling, once after installing (about 10 s in all)")

    def on_end(self, event: Any) -> None:
        """Compiling has ended."""


def compiled(signature: Any, **options: Any) -> Callable[[Any], Kernel]:
    """Compile a function for a signature at its first call; kept for the next process.

    Args:
        signature: A type of numba.
        options: Of `numba.njit`, beside `cache`, `nogil` and `no_cfunc_wrapper`.
    """

    def wrap(function: Any) -> Kernel:
        return Kernel(function, signature, options)

    return wrap


def helper(function: Any = None, **options: Any) -> Any:
    """Make a function that kernels call, and Python cannot: `@helper` or `@helper(fastmath=...)`.

    It is compiled into the kernels. That it has no entry for Python halves the time that takes.

    Args:
        function: The function.
        options: Of `numba.njit`.
    """
    make = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)
    return make if function is None else make(function)


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
