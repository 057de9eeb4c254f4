"""The result folder: names of its files, writing them, and removing those of earlier results.

Only files are replaced or removed that a record in the folder (`result.json` and the like) names as
written by an earlier result. A file that was read is never written.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Literal, get_args

from dynresp.results.result_json import versions, write_json
from dynresp.support.errors import DynrespError, MissingExtraError, UsageError
from dynresp.support.inputs import noted_inputs

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
EVALUATION, PER_STRATEGY, CONFUSION = "evaluation.json", "per_strategy.csv", "confusion.png"

WRITTEN = "written"
"""What `files` in `result.json` says of a written file."""
_NOT_WRITTEN = "not written: "
_FAILED = "failed: "
_UNFINISHED = "unfinished"

_NAMES = (*get_args(Artefact), RESULT, PLAN, OPTIONS, WATCHING, TABLE, PER_STRATEGY, CONFUSION)
_OURS = re.compile(rf"(hit_\d{{5,12}}/)?({'|'.join(map(re.escape, _NAMES))})")
_MAX_RECORD_BYTES = 64 << 20


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


def claim(
    folder: Path,
    record: str,
    names: Collection[str],
    *,
    inputs: Collection[Path] = (),
    overwrite: bool = False,
) -> set[str]:
    """Take a folder for a new result, whose record then names its files as the result's own.

    Call it before the first file is written: what an interrupted run leaves is its own, too.

    Args:
        folder: The result folder; made if it is missing.
        record: The file that will name the others, such as `RESULT`.
        names: The files that will be written, besides the record.
        inputs: See `check_claim`.
        overwrite: See `check_claim`.

    Returns:
        The names of the files that are the result's own now, those of earlier results among them.

    Raises:
        UsageError: As `check_claim`; nothing was written.
        DynrespError: The record cannot be written.
    """
    check_claim(folder, [record, *names], inputs=inputs, overwrite=overwrite)
    own = own_files(folder) | {record, *names}
    claimed = dict.fromkeys(sorted(own - {record}), _UNFINISHED)
    write_json({"files": claimed, "versions": versions()}, folder / record)
    return own


def check_claim(
    folder: Path,
    names: Collection[str],
    *,
    inputs: Collection[Path] = (),
    overwrite: bool = False,
) -> None:
    """Refuse to replace or remove a file that no earlier result in the folder names as its own.

    Args:
        folder: The result folder.
        names: The files that will be written.
        inputs: Files that were read, besides those that `inputs_noted` notes: they are never
            written, not even with `overwrite`.
        overwrite: Whether the user has said that all other files may be replaced.

    Raises:
        UsageError: There is such a file.
    """
    own = own_files(folder)
    read = {path.resolve() for path in inputs} | noted_inputs()
    there = [name for name in sorted(own.union(names)) if (folder / name).is_file()]
    for name in there:
        if (folder / name).resolve() in read:
            raise UsageError(
                f"{folder / name} is read for this result, and would be replaced or removed by it; "
                "choose another folder for the result"
            )
    foreign = [] if overwrite else [name for name in there if name not in own]
    if foreign:
        more = f" and {len(foreign) - 3} more" if len(foreign) > 3 else ""
        raise UsageError(
            f"{folder} holds {', '.join(foreign[:3])}{more}, which no earlier result there names "
            "as its own; choose another folder, or allow to replace files (--overwrite, in Python "
            "overwrite=True)"
        )


def own_files(folder: Path) -> set[str]:
    """Names of the files that the results in a folder say they have written, with their records."""
    own: set[str] = set()
    for record in (RESULT, SUMMARY, EVALUATION):
        files = _claimed(folder / record)
        if files is not None:
            own |= {record, *files}
    return own


def clear(folder: Path, old: Collection[str]) -> dict[str, str]:
    """Remove files of earlier results.

    Args:
        folder: The result folder.
        old: Names of the files, from `claim`.

    Returns:
        For each file that could not be removed, what `files` says of it.
    """
    failed = {}
    for name in sorted(old):
        path = folder / name
        # dynresp makes neither links nor folders of such names.
        if path.parent.is_symlink() or (path.is_dir() and not path.is_symlink()):
            continue
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            failed[name] = f"{_FAILED}one of an earlier run cannot be removed ({error.strerror})"
        if path.parent != folder:
            # A folder with files of the user stays.
            with suppress(OSError):
                path.parent.rmdir()
    return failed


def _claimed(record: Path) -> set[str] | None:
    """Files of a result that a record names as written; None if the record is not dynresp's."""
    try:
        with record.open("rb") as file:
            data = file.read(_MAX_RECORD_BYTES + 1)
        content = json.loads(data) if len(data) <= _MAX_RECORD_BYTES else None
    # A record of another program may hold anything.
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    files, made_with = content.get("files"), content.get("versions")
    if not (isinstance(files, dict) and isinstance(made_with, dict) and "dynresp" in made_with):
        return None
    states = (WRITTEN, _UNFINISHED)
    return {name for name, what in files.items() if what in states and _OURS.fullmatch(name)}
