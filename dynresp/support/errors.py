"""The one error tree of dynresp.

Every message says what was given, what was expected and what to do. The command line turns an
error into a message on standard error and the exit code of its class: 2 for a
wrong request (a bad file, name or value), 1 if a right request could not be done.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import ClassVar


class DynrespError(Exception):
    """Root of all errors that dynresp raises on purpose; the request could not be done."""

    exit_code: ClassVar[int] = 1


class UsageError(DynrespError):
    """The request itself is wrong: an unknown name, a value out of range, a bad file."""

    exit_code: ClassVar[int] = 2


class UnknownNameError(UsageError):
    """A name that is not among the valid ones; the message lists them, the nearest first."""

    def __init__(self, kind: str, given: str, valid: Iterable[str]) -> None:
        """State the wrong name and the valid ones.

        Args:
            kind: What the name stands for, such as "body" or "reaction".
            given: The name that was given.
            valid: The names that would have been accepted.
        """
        names = sorted(valid)
        near = difflib.get_close_matches(given, names, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        super().__init__(f"unknown {kind} {given!r}.{hint} Valid: {', '.join(names) or 'none'}.")


class MotionFileError(UsageError):
    """A motion file that cannot be read: damaged, of another format, or out of bounds."""


class MotionError(UsageError):
    """A motion, or an operation on motions, that makes no sense (shapes, frame rates, ranges)."""


class MissingMotionDataError(DynrespError):
    """Motion files that are needed are not on this machine; the message says how to get them."""


class GraphFileError(UsageError):
    """A motion graph's file that cannot be read: damaged, of another format, or out of bounds."""


class MissingExtraError(DynrespError):
    """An optional package is not installed; the message names the command that installs it."""


class FetchError(DynrespError):
    """Motion data could not be fetched or failed its checksum."""


class SpecError(UsageError):
    """A spec or library file that is wrong; the message names the key."""


class SimulationError(DynrespError):
    """A simulation diverged or could not be set up."""
