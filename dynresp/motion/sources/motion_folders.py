"""Where motion files are found: the user's own folders, or the cache that `fetch` fills.

Reaction libraries and experiments name motion files by paths relative to a motions folder, with
forward slashes. Nothing here uses the network.
"""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Iterable
from pathlib import Path, PurePosixPath, PureWindowsPath

from dynresp.support.errors import SpecError, UsageError
from dynresp.support.paths import cache_folder, expanded

MOTIONS_VARIABLE = "DYNRESP_MOTIONS"
"""Environment variable that names the motions folder, or several with `os.pathsep` between."""

MOTION_SUFFIXES = (".amc", ".bvh", ".json", ".npz", ".txt")
"""Suffixes of the motion files dynresp reads, in lower case."""

_AMBIGUOUS_SUFFIXES = (".json", ".txt")
_FRAMES_KEY = b'"Frames"'
_BYTES_LOOKED_AT = 4096


def fetched_folder() -> Path:
    """Folder that holds fetched motion files, inside the user's cache; may not exist yet."""
    return cache_folder() / "motions"


def motion_folders(explicit: Path | None = None) -> list[Path]:
    """Choose the folders to look for motion files in.

    The first of these that is given decides, and the later ones are not looked at:
    the explicit folder, the folders in the environment variable `DYNRESP_MOTIONS`, the cache
    of fetched files.

    Args:
        explicit: Folder named by the user on the command line.

    Returns:
        Existing folders, in the order to search; empty where nothing is named and nothing was
        fetched yet.

    Raises:
        UsageError: A folder that the user named does not exist or is not a folder.
    """
    if explicit is not None:
        return [_existing_folder(explicit, "the motions folder (--motions)")]
    named = [part for part in os.environ.get(MOTIONS_VARIABLE, "").split(os.pathsep) if part]
    if named:
        return [_existing_folder(Path(part), MOTIONS_VARIABLE) for part in named]
    fetched = fetched_folder()
    return [fetched] if fetched.is_dir() else []


def checked_relative_path(given: str) -> str:
    """Check that a path of a library, experiment or source table stays inside its folder.

    Args:
        given: Path relative to a motions folder, with forward slashes.

    Returns:
        The same path.

    Raises:
        SpecError: It is empty, absolute, names a drive, climbs with "..", or holds a backslash
            or a control character.
    """
    parts = given.split("/")
    if (
        not given
        or not given.isprintable()
        or "\\" in given
        or PureWindowsPath(given).drive
        or PurePosixPath(given).is_absolute()
        or any(part in ("", ".", "..") for part in parts)
    ):
        raise SpecError(
            f"{given!r} is not a path inside a motions folder; expected a relative path with "
            "forward slashes and without '..', such as 'walking/walk_01.bvh'."
        )
    return given


def find_motion_file(relative_path: str, folders: Iterable[Path]) -> Path | None:
    """Find a motion file by its relative path.

    Args:
        relative_path: Path inside a motions folder, with forward slashes.
        folders: Folders to look in, the first that holds the file wins.

    Returns:
        The existing file, or None where no folder holds it.

    Raises:
        SpecError: The path would lead out of the folders.
    """
    checked_relative_path(relative_path)
    for folder in folders:
        candidate = folder / relative_path
        # os.path.isfile answers False where Path.is_file raises, as for a name that is too long
        if os.path.isfile(candidate):
            return candidate
    return None


def fits_pattern(relative_path: str, pattern: str) -> bool:
    """Whether a path is one that a name with wildcards stands for.

    Args:
        relative_path: Path inside a motions folder, with forward slashes.
        pattern: The same with `*`, `?` or `[...]`, none of which stands for a slash.
    """
    parts, patterns = relative_path.split("/"), pattern.split("/")
    return len(parts) == len(patterns) and all(map(fnmatch.fnmatchcase, parts, patterns))


def list_motion_files(folder: Path, levels: int | None = None) -> list[Path]:
    """List the motion files below a folder.

    A file counts by its suffix; `.txt` and `.json` files count only if they begin like a
    DeepMimic motion, so that notes and settings are left out. Hidden files and folders are left
    out, and linked folders are not entered.

    Args:
        folder: Folder to look through.
        levels: How deep: 1 for the folder itself alone, None for all that is below it.

    Returns:
        Paths that begin with `folder`, sorted.

    Raises:
        UsageError: The folder does not exist, is not a folder or cannot be read.
    """
    _existing_folder(folder, "the motions folder")
    found: list[Path] = []
    for root, subfolders, names in os.walk(folder, onerror=_refuse_unreadable):
        deep = len(Path(root).relative_to(folder).parts) + 1
        inner = [name for name in subfolders if not name.startswith(".")]
        subfolders[:] = inner if levels is None or deep < levels else []
        for name in names:
            path = Path(root, name)
            if not name.startswith(".") and _looks_like_motion(path):
                found.append(path)
    return sorted(found)


def _existing_folder(folder: Path, named_by: str) -> Path:
    """Return the folder, or say that what the user named is not there."""
    found = expanded(folder, named_by)
    if not os.path.isdir(found):
        what = "is a file" if os.path.isfile(found) else "does not exist"
        raise UsageError(
            f"{named_by}: {str(folder)!r} {what}; expected an existing folder of motion files."
        )
    return found


def _refuse_unreadable(error: OSError) -> None:
    raise UsageError(
        f"the folder {error.filename!r} cannot be read ({error.strerror}); "
        "check its permissions or name another folder."
    )


def _looks_like_motion(path: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix not in MOTION_SUFFIXES or not path.is_file():
        return False
    if suffix not in _AMBIGUOUS_SUFFIXES:
        return True
    try:
        with path.open("rb") as stream:
            start = stream.read(_BYTES_LOOKED_AT)
    except OSError:
        return False
    return start.lstrip().startswith(b"{") and _FRAMES_KEY in start
