"""Finding, loading and cutting the motions that an experiment names."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.motion.sources.catalogue import load_licences, load_sources
from dynresp.motion.sources.motion_folders import find_motion_file, motion_folders
from dynresp.specs.shared_tables import MotionCut
from dynresp.support.errors import (
    MissingMotionDataError,
    MotionFileError,
    SpecError,
)
from dynresp.support.paths import expanded

BUILTIN_PREFIX = "builtin:"
"""How the name of a built-in motion begins in an experiment file."""


@dataclass(frozen=True)
class NamedMotion:
    """A motion that an experiment uses.

    Attributes:
        motion: Cut, mirrored and at the wanted frame rate.
        record: Where it comes from, for `result.json`.
        cut: The table that names it; if a table names two, the one that was used.
    """

    motion: Motion
    record: dict[str, Any]
    cut: MotionCut


def load_spec_motion(
    cut: MotionCut,
    otherwise: MotionCut | None,
    key: str,
    folders: Sequence[Path],
    beside: Path,
    fps: float,
    character: Character,
) -> NamedMotion:
    """Load the motion that a table names, or the one that it names in case the first is missing.

    Args:
        cut: The table.
        otherwise: The table under `or`, used if no motions folder holds the first file.
        key: Place of the table in the file, for messages.
        folders: Motions folders.
        beside: Folder of the experiment file, from which relative paths count first.
        fps: Frame rate to bring it to [1/s].
        character: The character.

    Raises:
        MissingMotionDataError: Neither is on this machine.
        SpecError: The cut does not fit the motion.
        DynrespError: A file cannot be read.
    """
    found = find_motion(cut.motion, folders, beside)
    if found is None and otherwise is not None:
        other = load_spec_motion(otherwise, None, f"{key}.or", folders, beside, fps, character)
        return replace(other, record={**other.record, "instead_of": cut.motion})
    if found is None:
        looked = ", ".join(str(folder) for folder in [beside, *folders])
        raise MissingMotionDataError(
            f"{key}.motion: {cut.motion!r} is not on this machine (looked in {looked}). "
            "Name a folder that holds it with --motions or DYNRESP_MOTIONS, fetch it with "
            f'`dynresp motions fetch core`, or write or = "{BUILTIN_PREFIX}walk" beside it.'
        )
    motion = load_cut(cut, found, key, character).resampled(fps)
    return NamedMotion(motion, cut_record(cut, found), cut)


def find_motion(name: str, folders: Sequence[Path], beside: Path) -> Path | str | None:
    """Find what a motion's name stands for.

    Args:
        name: "builtin:walk" and the like, a file, or a path inside a motions folder.
        folders: Motions folders.
        beside: Folder from which a relative path counts first.

    Returns:
        The file, the name of a built-in motion, or None where no motions folder holds it.

    Raises:
        MotionFileError: It can only be a file, and there is none.
        SpecError: The path leads out of the motions folders.
        UsageError: It begins with the home folder of an unknown user.
    """
    if name.startswith(BUILTIN_PREFIX):
        return name.removeprefix(BUILTIN_PREFIX)
    given = expanded(name, "motion")
    own = beside / given
    # os.path.isfile answers False where Path.is_file raises, as for a name that is too long.
    if os.path.isfile(own):
        return own
    if given.is_absolute() or ".." in given.parts:
        raise MotionFileError(f"{name}: no such file; expected a motion file")
    return find_motion_file(given.as_posix(), folders)


def load_named_motion(
    name: str,
    motions: Path | str | None = None,
    character: Character | None = None,
    options: LoadOptions | None = None,
) -> tuple[Motion, Path | None]:
    """Find a motion by its name and load it.

    Args:
        name: A file, a path inside a motions folder, or "builtin:walk" and the like.
        motions: Motions folder, in place of `DYNRESP_MOTIONS` and of what was fetched.
        character: The character, by default the product's.
        options: How to read the file.

    Returns:
        The motion at its own frame rate, and its file; None for a built-in motion.

    Raises:
        MissingMotionDataError: It is not on this machine.
        DynrespError: It cannot be read.
    """
    folders = motion_folders(None if motions is None else Path(motions))
    found = find_motion(name, folders, Path())
    if found is None:
        looked = ", ".join(str(folder) for folder in [Path().absolute(), *folders])
        raise MissingMotionDataError(
            f"{name}: no such motion in {looked}. `dynresp motions list` shows what is there; "
            "--motions or DYNRESP_MOTIONS names another folder."
        )
    if isinstance(found, str):
        return load_builtin(found, character), None
    return load_motion(found, character, options), found


def load_cut(cut: MotionCut, found: Path | str, key: str, character: Character) -> Motion:
    """Load a motion, and cut and mirror it as its table says.

    Args:
        cut: The table.
        found: What `find_motion` found.
        key: Place of the table in the file, for messages.
        character: The character.

    Returns:
        The motion at its own frame rate.

    Raises:
        SpecError: The cut does not fit the motion.
        DynrespError: The file cannot be read.
    """
    motion = _load(cut, found, character)
    stop_s = motion.duration if cut.stop_s is None else cut.stop_s
    if cut.start_s >= motion.duration or stop_s > motion.duration + 0.5 / motion.fps:
        cut_key = "start_s" if cut.start_s >= motion.duration else "stop_s"
        raise SpecError(
            f"{key}.{cut_key}: expected at most {motion.duration:.2f} s, which is how long "
            f"{cut.motion!r} lasts{' without its T-poses' if cut.trim_t_pose else ''}, "
            f"got {getattr(cut, cut_key):g}"
        )
    first, last = round(cut.start_s * motion.fps), round(stop_s * motion.fps)
    part = motion.slice(first, min(last + 1, len(motion)))
    return part.mirrored(character) if cut.mirrored else part


def _load(cut: MotionCut, found: Path | str, character: Character) -> Motion:
    if isinstance(found, str):
        return load_builtin(found, character)
    options = LoadOptions(
        unit=cut.unit_m,
        up=cut.up,
        fps=cut.fps,
        asf=None if cut.asf is None else found.parent / expanded(cut.asf, "asf"),
        flat_floor=not cut.uneven_floor,
        trim_t_poses=cut.trim_t_pose,
    )
    return load_motion(found, character, options)


def cut_record(cut: MotionCut, found: Path | str) -> dict[str, Any]:
    """Where a motion comes from, for `result.json`, without saying where on this machine.

    Args:
        cut: The table that names it.
        found: What `find_motion` found.
    """
    given = cut.model_dump(exclude_defaults=True, by_alias=True, exclude={"otherwise", "hit_s"})
    if isinstance(found, str):
        return {**given, "built_in": True}
    record: dict[str, Any] = {
        **given,
        "built_in": False,
        "sha256": hashlib.sha256(found.read_bytes()).hexdigest(),
    }
    source = load_sources().get(cut.motion)
    if source is not None and source.sha256 == record["sha256"]:
        record["credit"] = load_licences()[source.source_repo].credit
        record["licence"] = source.licence
    return record
