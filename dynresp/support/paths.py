"""Where dynresp finds the data that it ships, and where it keeps what it fetches.

`models` and `reactions` are beside the package in a checkout, and inside it, at
``dynresp/_data``, in an installed wheel.
"""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from dynresp.support.errors import DynrespError, UsageError

PACKAGE_FOLDER = Path(__file__).resolve().parent.parent
"""Folder of the imported `dynresp` package."""

CACHE_VARIABLE = "DYNRESP_CACHE"
"""Environment variable that moves the user's cache folder."""


def data_folder(name: str, package: Path = PACKAGE_FOLDER) -> Path:
    """Find a folder of shipped data, in a plain install and in an editable checkout alike.

    The folder beside the package counts only where `pyproject.toml` is there too: in
    `site-packages` a folder called `models` would be somebody else's.

    Args:
        name: Name of the folder, such as "models".
        package: Folder of the package to look from.

    Returns:
        The existing folder.

    Raises:
        DynrespError: It is in neither place; the installation is incomplete.
    """
    installed = package / "_data" / name
    if installed.is_dir():
        return installed
    beside = package.parent / name
    if beside.is_dir() and (package.parent / "pyproject.toml").is_file():
        return beside
    raise DynrespError(
        f"dynresp's own folder {name!r} is missing: expected {installed} (installed) or "
        f"{beside} (checkout). The installation is incomplete; install dynresp again."
    )


def models_folder() -> Path:
    """Folder of the MuJoCo models (`ragdoll.xml` and its kin).

    Raises:
        DynrespError: The installation is incomplete.
    """
    return data_folder("models")


def reactions_folder() -> Path:
    """Folder of the reaction libraries, built-in motions and `sources.csv`.

    Raises:
        DynrespError: The installation is incomplete.
    """
    return data_folder("reactions")


def example_specs(kind: str = "") -> Path:
    """Folder of the specs that come with dynresp.

    Args:
        kind: "experiments", "graphs" or "datasets"; by default the folder above all three.

    Raises:
        DynrespError: The installation is incomplete.
    """
    return data_folder("examples/specs") / kind


def expanded(path: Path | str, named_by: str) -> Path:
    """A path that a user named, its leading `~` or `~user` replaced by the home folder.

    Args:
        path: As it was given.
        named_by: The option, variable or key that named it, for the message.

    Raises:
        UsageError: There is no such user.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:
        home = Path(path).parts[0]
        raise UsageError(
            f"{named_by}: {str(path)!r}: {home!r} is nobody's home folder on this machine; write "
            "the whole path"
        ) from None


def cache_folder() -> Path:
    """Folder where dynresp keeps what it fetched or computed for this user; may not exist yet.

    It is the one named by the environment variable `DYNRESP_CACHE` if that is set and not
    empty, else the operating system's usual cache folder.

    Returns:
        An absolute path; nothing is created.

    Raises:
        UsageError: `DYNRESP_CACHE` names something that is not a folder.
    """
    given = os.environ.get(CACHE_VARIABLE, "")
    if not given:
        return platformdirs.user_cache_path("dynresp", appauthor=False)
    folder = Path(os.path.abspath(expanded(given, CACHE_VARIABLE)))
    if folder.exists() and not folder.is_dir():
        raise UsageError(
            f"{CACHE_VARIABLE} is {given!r}, which is not a folder; "
            "name a folder (it is made when needed) or unset the variable."
        )
    return folder


def classifier_file(library_identity: str) -> Path:
    """Where the classifier of a library is kept for this user; may not exist yet.

    Args:
        library_identity: Of the reaction library, which includes the character's.

    Raises:
        UsageError: `DYNRESP_CACHE` names something that is not a folder.
    """
    return cache_folder() / "classifiers" / f"{library_identity}.skops"
