"""The reaction library: which stretches of motion capture a hit person can go on with.

A library is a TOML file of `[[reaction]]` tables; `reactions/README.md` describes it.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dynresp.errors import MissingMotionDataError, SpecError, UnknownNameError
from dynresp.motion.builtin import builtin_info, builtin_names, load_builtin
from dynresp.motion.character import Character, default_character
from dynresp.motion.load import load_motion
from dynresp.motion.motion import Motion
from dynresp.motion.sources import find_motion_file, motion_folders
from dynresp.paths import reactions_folder

STRATEGIES = (
    "step_forward_small",
    "step_forward_large",
    "multiple_steps_forward",
    "forward_roll",
    "side_fall",
    "step_backward_small",
    "step_backward_large",
    "multiple_steps_backward",
    "backward_roll",
    "upper_body_front",
    "upper_body_side",
    "upper_body_back",
)
"""The strategies of Zordan et al. 2007, section 7.1. Front, side and back are where a blow to the
upper body comes from; forward and backward are where the person goes."""

BUILTIN = "builtin"
"""Name of the library of the motions that this project makes itself."""

MIRRORED = "_mirrored"
"""What the name of a reaction's mirror image ends in."""

_MAX_BYTES = 4 * 2**20
_KEYS = {"name", "strategy", "file", "frames", "builtin", "note"}


@dataclass(frozen=True)
class Reaction:
    """One way to go on.

    Attributes:
        name: Unique in its library.
        strategy: One of `STRATEGIES`.
        motion: The stretch, at the library's frame rate; its first frame is close to the hit.
        mirrored: Whether left and right are exchanged.
        builtin: Whether this project made the motion; it is then no motion capture.
        source: Where it comes from, for people.
    """

    name: str
    strategy: str
    motion: Motion
    mirrored: bool
    builtin: bool
    source: str


@dataclass(frozen=True)
class ReactionLibrary:
    """Reactions of one character at one frame rate.

    Attributes:
        name: Its file's name without suffix, or `BUILTIN`.
        reactions: The reactions, each followed by its mirror image.
        identity: Hash of contents, frame rate and character; another library has another.
    """

    name: str
    reactions: tuple[Reaction, ...]
    identity: str

    def reaction(self, name: str) -> Reaction:
        """A reaction by name.

        Raises:
            UnknownNameError: There is none of that name.
        """
        for reaction in self.reactions:
            if reaction.name == name:
                return reaction
        raise UnknownNameError("reaction", name, [r.name for r in self.reactions])


@dataclass(frozen=True)
class _Entry:
    """One `[[reaction]]` table, checked."""

    name: str
    strategy: str
    file: str | None
    frames: tuple[int, int] | None
    builtin: str | None


def load_library(
    which: str | Path = "core",
    folders: Sequence[Path] | None = None,
    character: Character | None = None,
    fps: float = 30.0,
    mirrors: bool = True,
) -> ReactionLibrary:
    """Load a reaction library.

    Args:
        which: "core", "full", `BUILTIN`, or the path of a library file.
        folders: Where its motion files are looked for, by default `motion_folders()`.
        character: The character, by default the product's.
        fps: Frame rate of the reactions.
        mirrors: Whether each reaction is followed by its mirror image.

    Raises:
        SpecError: The library file is wrong.
        MissingMotionDataError: Motion files are not on this machine.
    """
    character = character or default_character()
    if which == BUILTIN:
        entries = [
            _Entry(name, builtin_info(name).strategy or "", None, None, name)
            for name in builtin_names()
            if builtin_info(name).strategy
        ]
        return _build(BUILTIN, entries, [], character, fps, mirrors, Path(BUILTIN))
    path = Path(which)
    if path.suffix != ".toml":
        path = reactions_folder() / f"{which}.toml"
    entries = _read_entries(path)
    found = motion_folders() if folders is None else list(folders)
    return _build(path.stem, entries, found, character, fps, mirrors, path)


def default_library(
    folders: Sequence[Path] | None = None, character: Character | None = None, fps: float = 30.0
) -> ReactionLibrary:
    """The core library where its motion capture is on this machine, else the built-in one."""
    try:
        return load_library("core", folders, character, fps)
    except MissingMotionDataError:
        return load_library(BUILTIN, folders, character, fps)


def _build(
    name: str,
    entries: Sequence[_Entry],
    folders: list[Path],
    character: Character,
    fps: float,
    mirrors: bool,
    path: Path,
) -> ReactionLibrary:
    files = {e.file: find_motion_file(e.file, folders) for e in entries if e.file}
    missing = sorted(file for file, found in files.items() if found is None)
    if missing:
        where = ", ".join(str(folder) for folder in folders) or "no folder"
        raise MissingMotionDataError(
            f"{len(missing)} of {len(files)} motion files of the library {name!r} are missing, "
            f"the first {missing[0]!r}; looked in {where}. Run `dynresp motions fetch {name}`, or "
            "name a folder that holds them with --motions or DYNRESP_MOTIONS."
        )
    reactions: list[Reaction] = []
    for entry in entries:
        reaction = _load_entry(entry, files, character, fps, path)
        reactions.append(reaction)
        if mirrors:
            mirrored = reaction.motion.mirrored(character)
            reactions.append(
                replace(reaction, name=entry.name + MIRRORED, motion=mirrored, mirrored=True)
            )
    digest = hashlib.sha256(f"{character.identity} {fps!r}".encode())
    for reaction in reactions:
        digest.update(f"{reaction.name} {reaction.strategy}".encode())
        digest.update(reaction.motion.poses.round(6).tobytes())
    return ReactionLibrary(name, tuple(reactions), digest.hexdigest()[:16])


def _load_entry(
    entry: _Entry,
    files: dict[str, Path | None],
    character: Character,
    fps: float,
    path: Path,
) -> Reaction:
    if entry.builtin is not None:
        motion = load_builtin(entry.builtin, character).resampled(fps)
        return Reaction(entry.name, entry.strategy, motion, False, True, motion.name)
    assert entry.file is not None
    assert entry.frames is not None
    found = files[entry.file]
    assert found is not None
    # Cut after the whole clip has been set on the floor: a stretch alone may not show it.
    whole = load_motion(found, character)
    start, stop = entry.frames
    if stop > len(whole):
        raise SpecError(
            f"{path}: reaction {entry.name!r}: frames {start} to {stop}, but {entry.file} has "
            f"frames 0 to {len(whole)}"
        )
    source = f"{entry.file} frames {start}-{stop}"
    motion = replace(whole.slice(start, stop).resampled(fps), name=source)
    return Reaction(entry.name, entry.strategy, motion, False, False, source)


def _read_entries(path: Path) -> list[_Entry]:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise SpecError(f"{path}: larger than {_MAX_BYTES} bytes; that is no reaction library")
        with path.open("rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise SpecError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SpecError(f"{path}: not valid TOML: {error}") from error
    tables = content.get("reaction")
    unknown = sorted(set(content) - {"reaction"})
    if unknown:
        raise SpecError(f"{path}: unknown key {unknown[0]!r}; allowed: reaction")
    if not isinstance(tables, list) or not tables or not all(isinstance(t, dict) for t in tables):
        raise SpecError(f"{path}: expected one or more [[reaction]] tables")
    entries = [_entry(path, i, table) for i, table in enumerate(tables)]
    names = [entry.name for entry in entries]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SpecError(f"{path}: the name {twice[0]!r} is given to more than one reaction")
    return entries


def _entry(path: Path, index: int, table: dict[str, Any]) -> _Entry:
    """Check one table."""
    where = f"{path}: reaction {table.get('name', index + 1)!r}"
    for key in table:
        if key not in _KEYS:
            raise SpecError(f"{where}: unknown key {key!r}; allowed: {', '.join(sorted(_KEYS))}")
    for key in ("name", "strategy"):
        if not isinstance(table.get(key), str) or not table[key]:
            raise SpecError(f"{where}: {key} must be a text, got {table.get(key)!r}")
    if table["name"].endswith(MIRRORED):
        raise SpecError(f"{where}: a name must not end in {MIRRORED!r}; mirrors are made from it")
    if table["strategy"] not in STRATEGIES:
        raise SpecError(
            f"{where}: strategy {table['strategy']!r} is not one of {', '.join(STRATEGIES)}"
        )
    builtin = table.get("builtin")
    if builtin is not None:
        if "file" in table or "frames" in table:
            raise SpecError(f"{where}: give either builtin, or file and frames")
        if builtin not in builtin_names():
            raise SpecError(
                f"{where}: builtin {builtin!r} is not one of {', '.join(builtin_names())}"
            )
        return _Entry(table["name"], table["strategy"], None, None, builtin)
    file, frames = table.get("file"), table.get("frames")
    if not isinstance(file, str) or not file:
        raise SpecError(f"{where}: file must be the relative path of a motion file, got {file!r}")
    good = isinstance(frames, list) and len(frames) == 2 and all(type(x) is int for x in frames)
    if not good or not 0 <= frames[0] < frames[1]:  # type: ignore[index]
        raise SpecError(
            f"{where}: frames must be [first, one past the last] in the file's own frames, "
            f"got {frames!r}"
        )
    assert frames is not None
    return _Entry(table["name"], table["strategy"], file, (frames[0], frames[1]), None)
