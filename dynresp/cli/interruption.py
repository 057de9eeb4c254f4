"""Control-C (SIGINT) ends the program cleanly, with its own exit code."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType

INTERRUPTED = 130
"""Exit code of an interrupted program, as in shells: 128 plus the number of the signal."""

# An interruption that got lost is raised again after this time [s].
_AGAIN_S = 0.05


class Interrupted(KeyboardInterrupt):
    """SIGINT was received.

    Not `KeyboardInterrupt` itself: the interpreter remembers one that has left any `exec`, such as
    a dataclass's during an import, and at its end kills itself by the signal, although the
    exception was caught.
    """


class Interruption:
    """Watches for SIGINT.

    Attributes:
        came: Whether it was received.
    """

    def __init__(self) -> None:
        """Not received yet."""
        self.came = False
        self._watching = False

    def watch(self) -> None:
        """Raise `Interrupted` in the main thread when SIGINT is received.

        If the signal is ignored or handled already, as under `nohup`, it stays so.
        """
        if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
            return
        self._watching = True
        self._hook, sys.unraisablehook = sys.unraisablehook, self._lost
        signal.signal(signal.SIGINT, self._handle)

    def ignore(self) -> None:
        """Let the program end undisturbed."""
        if self._watching:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise Interrupted

    def _lost(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Handle an exception from a place that cannot raise: a callback from C, or a `__del__`."""
        if unraisable.exc_type is not Interrupted:
            self._hook(unraisable)
            return
        again = threading.Timer(_AGAIN_S, _interrupt_main_thread)
        again.daemon = True
        again.start()


def _interrupt_main_thread() -> None:
    """Send SIGINT to the main thread; unlike `_thread.interrupt_main`, it also ends a wait."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:  # Windows
        _thread.interrupt_main()
