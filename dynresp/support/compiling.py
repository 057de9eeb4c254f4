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
import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import event

from dynresp.support.paths import PACKAGE_FOLDER
from dynresp.support.progress import announce

_PATIENCE = 50_000
"""Numbers in the arguments of calls that Python runs before a kernel is compiled: some ten hits, or
a third of a second."""

_LOCK = threading.RLock()
"""One for all kernels: compiling one may compile others."""


class Kernel:
    """A function that is compiled for its signature when it is needed.

    Other kernels may call it, too.

    Attributes:
        py_func: The function as it was written. It calls helpers as they were written, too.
    """

    def __init__(
        self, function: Any, signature: Any, interpreted_first: bool, options: dict[str, Any]
    ) -> None:
        """Compile nothing yet.

        Args:
            function: The function.
            signature: A type of numba.
            interpreted_first: See `compiled`.
            options: Of `numba.njit`.
        """
        self.py_func = function
        self._signature, self._options = signature, options
        self._compiled: Any = None
        self._patience = _PATIENCE if interpreted_first else 0
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Run it: compiled, or as it was written where there is little to do."""
        if self._compiled is None and self._patience > 0:
            self._patience -= sum(map(_numbers, arguments))
            if self._patience > 0:
                return self.py_func(*arguments)
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
        with event.install_listener("numba:compile", _Announcer()), _uncollected():
            dispatcher.compile(self._signature)
        dispatcher.disable_compile()
        return dispatcher


def _numbers(argument: Any) -> int:
    """How many numbers an argument holds: an array, a number or a tuple of them."""
    if isinstance(argument, tuple):
        return sum(map(_numbers, argument))
    return int(np.size(argument))


class _Announcer(event.Listener):  # type: ignore[misc]
    """Announces that something is compiled."""

    def on_start(self, event: Any) -> None:
        """Compiling begins."""
        announce("compiling, once after installing (about 10 s in all)")

    def on_end(self, event: Any) -> None:
        """Compiling has ended."""


@contextmanager
def _uncollected() -> Iterator[None]:
    """Look for no garbage meanwhile: that takes a sixth of the time, and finds little."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def compiled(
    signature: Any, *, interpreted_first: bool = False, **options: Any
) -> Callable[[Any], Kernel]:
    """Compile a function for a signature when it is needed; kept for the next process.

    Args:
        signature: A type of numba.
        interpreted_first: Let Python run it as it was written until that has seen so many numbers
            that compiling would have been faster. Only for kernels that give the same bits either
            way: double precision, no fast math, no `**` and no `math.hypot` (`numpy.hypot` is the
            C library's, as in compiled code).
        options: Of `numba.njit`, beside `cache`, `nogil` and `no_cfunc_wrapper`.
    """

    def wrap(function: Any) -> Kernel:
        return Kernel(function, signature, interpreted_first, options)

    return wrap


class _Helper:
    """A function that is compiled into the kernels that call it; Python runs it as written."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self.py_func = function
        self._options = options
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)

    @functools.cached_property
    def _dispatcher(self) -> Any:
        # That it has no entry for Python halves the time of compiling it. Numba's type of it does
        # not keep it alive.
        options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **self._options}
        return njit(**options)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for where a kernel calls it."""
        return types.Dispatcher(self._dispatcher)


def helper(function: Any = None, **options: Any) -> Any:
    """Make a function that kernels call: `@helper` or `@helper(fastmath=...)`.

    Args:
        function: The function.
        options: Of `numba.njit`.
    """
    if function is None:
        return lambda function: _Helper(function, options)
    return _Helper(function, options)


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
