"""The reaction library that a spec or a command names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import (
    BUILTIN,
    ReactionLibrary,
    default_library,
    load_library,
)
from dynresp.support.errors import UnknownNameError
from dynresp.support.paths import expanded


def load_named_library(
    which: str, folders: Sequence[Path], beside: Path, fps: float, character: Character
) -> ReactionLibrary:
    """Load the reactions that an experiment chooses from.

    Args:
        which: "core", "full", "builtin", or a library file (.toml). Without the motion capture
            of "core" it is the built-in library.
        folders: Motions folders.
        beside: Folder of the experiment file, to which a path is relative.
        fps: Frame rate of the reactions [1/s].
        character: The character.

    Raises:
        UnknownNameError: There is no such library.
        MissingMotionDataError: Its motion files are not on this machine.
        SpecError: The library file is wrong.
    """
    if which == "core":
        return default_library(folders, character, fps)
    if which in ("full", BUILTIN):
        return load_library(which, folders, character, fps)
    if not which.endswith(".toml"):
        names = ("core", "full", BUILTIN, "a library file (.toml)")
        raise UnknownNameError("library", which, names)
    return load_library(beside / expanded(which, "library"), folders, character, fps)


def library_record(library: ReactionLibrary, which: str) -> dict[str, Any]:
    """What `result.json` says of the library."""
    record: dict[str, Any] = {
        "name": library.name,
        "identity": library.identity,
        "reactions": len(library.reactions),
        "built_in": all(reaction.builtin for reaction in library.reactions),
    }
    if which == "core" and library.name == BUILTIN:
        record["instead_of"] = which
    return record
