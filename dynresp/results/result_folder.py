"""The result folder: names of its files, writing them, and removing those of earlier runs.

Only files that dynresp writes itself are ever removed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Literal, get_args

from dynresp.support.errors import DynrespError, MissingExtraError

Artefact = Literal[
    "motion.npz",
    "motion.bvh",
    "recording.html",
    "filmstrip.png",
    "alignment.png",
    "video.mp4",
]
"""What can be written for each response, besides `result.json`."""

PLAN, OPTIONS, WATCHING = "plan.png", "options.png", "watching.png"
"""Pictures of a path on the ground, of the actions offered, and of the video followed."""
RESULT, SUMMARY, TABLE = "result.json", "summary.json", "table.csv"

WRITTEN = "written"
"""What `files` in `result.json` says of a written file."""
_NOT_WRITTEN = "not written: "
_FAILED = "failed: "

_ARTEFACTS: tuple[str, ...] = get_args(Artefact)
_OF_A_RESPONSE = (RESULT, *_ARTEFACTS, PLAN, OPTIONS, WATCHING)
_HIT = re.compile(r"hit_\d{5,}")


class NothingToShowError(DynrespError):
    """A file would have nothing to show; the message says why."""


def hit_folder(number: int) -> str:
    """Name of a hit's folder in the folder of a batch."""
    return f"hit_{number:05d}"


def is_failure(what: str) -> bool:
    """Whether `files` says that a file could not be written."""
    return what.startswith(_FAILED)


def attempt(write: Callable[[Path], None], path: Path) -> str:
    """Write a file; an error becomes its text, and is not raised.

    Args:
        write: Writes it to a path.
        path: The file.

    Returns:
        What `files` in `result.json` says: `WRITTEN`; why there is none for this response, on a
        machine that cannot draw, or without an optional package; or why it failed.
    """
    from dynresp.view.video_writer import RenderingUnavailableError

    try:
        write(path)
    except (RenderingUnavailableError, MissingExtraError, NothingToShowError) as error:
        return f"{_NOT_WRITTEN}{error}"
    # If one picture fails, the others and the numbers are still written.
    except Exception as error:
        return f"{_FAILED}{error if isinstance(error, DynrespError) else _in_a_line(error)}"
    return WRITTEN


def _in_a_line(error: Exception) -> str:
    """An unexpected exception in a line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}" if text else type(error).__name__


def clear_response(folder: Path, written: Collection[str]) -> dict[str, str]:
    """Remove files of earlier runs from the folder of a response.

    Args:
        folder: The folder.
        written: Names of this run's files, which stay.

    Returns:
        For each file that could not be removed, what `files` says of it.
    """
    old = [name for name in (*_OF_A_RESPONSE, SUMMARY, TABLE) if name not in written]
    return _remove(folder, old) | _remove_hits(folder, ())


def clear_batch(folder: Path, shown: Collection[int]) -> dict[str, str]:
    """Remove files of earlier runs from the folder of a batch.

    Args:
        folder: The folder.
        shown: The hits that this run writes in full; their folders stay.

    Returns:
        For each file that could not be removed, what `files` says of it.
    """
    return _remove(folder, _OF_A_RESPONSE) | _remove_hits(folder, shown)


def _remove_hits(out: Path, shown: Collection[int]) -> dict[str, str]:
    """Remove the folders of hits that are not shown."""
    ours = {hit_folder(number) for number in shown}
    try:
        entries = sorted(out.iterdir())
    except OSError:
        return {}
    failed: dict[str, str] = {}
    for entry in entries:
        old = _HIT.fullmatch(entry.name) and entry.name not in ours
        if not old or entry.is_symlink() or not entry.is_dir():
            continue
        kept = _remove(entry, _OF_A_RESPONSE)
        failed |= {f"{entry.name}/{name}": what for name, what in kept.items()}
        # A folder with files of the user stays.
        with suppress(OSError):
            entry.rmdir()
    return failed


def _remove(folder: Path, names: Collection[str]) -> dict[str, str]:
    failed = {}
    for name in names:
        path = folder / name
        # dynresp makes no folder of that name.
        if path.is_dir() and not path.is_symlink():
            continue
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            failed[name] = f"{_FAILED}one of an earlier run cannot be removed ({error.strerror})"
    return failed
