"""Reaction libraries: recorded answers to a hit, loaded from files or made by dynresp.

A library is a TOML file of `[[reaction]]` tables; `reactions/README.md` describes it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character, default_character
from dynresp.motion.load import load_motion
from dynresp.motion.motion import Label, Motion
from dynresp.motion.reactions.reaction_library_file import (
    MIRRORED,
    Entry,
    builtin_entries,
    read_entries,
)
from dynresp.motion.reactions.strategies import STRATEGIES
from dynresp.motion.sources.catalogue import load_sources
from dynresp.motion.sources.motion_folders import find_motion_file, motion_folders
from dynresp.support.errors import MissingMotionDataError, SpecError, UnknownNameError
from dynresp.support.paths import reactions_folder

__all__ = [
    "BUILTIN",
    "MIRRORED",
    "RECORDED",
    "STRATEGIES",
    "Reaction",
    "ReactionLibrary",
    "builtin_library",
    "default_library",
    "load_library",
]

BUILTIN = "builtin"
"""Name of the library of built-in motions, which dynresp makes itself."""

RECORDED = ("core", "full")
"""Names of the shipped libraries of motion capture, the smaller first."""

_NAMED_MISSING = 5


@dataclass(frozen=True)
class Reaction:
    """One recorded or built-in answer to a hit.

    Attributes:
        name: Unique in its library.
        strategy: One of `STRATEGIES`.
        motion: The stretch, at the library's frame rate, its first frame close to the hit; it
            starts over the origin facing +X and has its strategy as a label.
        mirrored: Whether left and right are exchanged.
        builtin: Whether dynresp made the motion; then it is not motion capture.
        source: Where it comes from, for users to read.
        start_s: Where in its file the motion begins [s]; 0 for a built-in motion.
    """

    name: str
    strategy: str
    motion: Motion
    mirrored: bool
    builtin: bool
    source: str
    start_s: float = 0.0


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


def load_library(
    which: str | Path = "core",
    folders: Sequence[Path] | None = None,
    character: Character | None = None,
    fps: float = 30.0,
    mirrors: bool = True,
) -> ReactionLibrary:
    """Load a reaction library.

    Args:
        which: "core", "full", `BUILTIN`, or the path of a library file (.toml).
        folders: Where its motion files are looked for, by default `motion_folders()`.
        character: The character, by default the product's.
        fps: Frame rate of the reactions [1/s].
        mirrors: Whether each reaction is followed by its mirror image.

    Raises:
        UnknownNameError: There is no library of that name.
        SpecError: The library file is wrong.
        MissingMotionDataError: Motion files are not on this machine.
        MotionFileError: A motion file cannot be read.
    """
    if which == BUILTIN:
        return builtin_library(character, fps, mirrors)
    if which in RECORDED:
        path = reactions_folder() / f"{which}.toml"
    else:
        path = Path(which)
        if path.suffix != ".toml":
            valid = [*RECORDED, BUILTIN, "a library file (.toml)"]
            raise UnknownNameError("library", str(which), valid)
    entries = read_entries(path)
    folders = motion_folders() if folders is None else folders
    files = _find_files(entries, folders, str(which))
    character = character or default_character()
    reactions = [_recorded_or_builtin(e, files, character, fps, path) for e in entries]
    return _library(path.stem, reactions, character, fps, mirrors)


def builtin_library(
    character: Character | None = None, fps: float = 30.0, mirrors: bool = True
) -> ReactionLibrary:
    """The library of built-in motions: all twelve strategies.

    Args:
        character: The character, by default the product's.
        fps: Frame rate of the reactions [1/s].
        mirrors: Whether each reaction is followed by its mirror image.

    Raises:
        SpecError: A built-in motion's file is wrong.
    """
    character = character or default_character()
    reactions = [_builtin(entry, entry.name, character, fps) for entry in builtin_entries()]
    return _library(BUILTIN, reactions, character, fps, mirrors)


def default_library(
    folders: Sequence[Path] | None = None,
    character: Character | None = None,
    fps: float = 30.0,
    mirrors: bool = True,
) -> ReactionLibrary:
    """The core library where its motion capture is on this machine, else the built-in one.

    Args:
        folders: Where motion files are looked for, by default `motion_folders()`.
        character: The character, by default the product's.
        fps: Frame rate of the reactions [1/s].
        mirrors: Whether each reaction is followed by its mirror image.

    Raises:
        MotionFileError: A motion file is there but cannot be read.
    """
    try:
        return load_library(RECORDED[0], folders, character, fps, mirrors)
    except MissingMotionDataError:
        return builtin_library(character, fps, mirrors)


def _find_files(
    entries: Iterable[Entry], folders: Sequence[Path], which: str
) -> Mapping[str, Path]:
    """Where the motion files are, by the name the library gives them; none may be missing."""
    names = sorted({entry.file for entry in entries if entry.file})
    found = {name: find_motion_file(name, folders) for name in names}
    missing = [name for name, path in found.items() if path is None]
    # An AMC file needs its skeleton, which an interrupted fetch may have left out.
    sources = load_sources()
    skeletons = {sources[n].skeleton for n in names if n in sources} - {None}
    missing += sorted(s for s in skeletons if s and find_motion_file(s, folders) is None)
    if missing:
        looked = ", ".join(str(folder) for folder in folders) or "no folder: none is known"
        more = len(missing) - _NAMED_MISSING
        named = ", ".join(missing[:_NAMED_MISSING]) + (f" and {more} more" if more > 0 else "")
        fetch = f"fetch them with `dynresp motions fetch {which}`, or " if which in RECORDED else ""
        raise MissingMotionDataError(
            f"the library {which!r} needs motion files that are not on this machine: {named} "
            f"(looked in {looked}); {fetch}name a folder that holds them with --motions or "
            "DYNRESP_MOTIONS."
        )
    return {name: path for name, path in found.items() if path is not None}


def _recorded_or_builtin(
    entry: Entry, files: Mapping[str, Path], character: Character, fps: float, path: Path
) -> Reaction:
    if entry.builtin is not None:
        return _builtin(entry, entry.builtin, character, fps)
    assert entry.file is not None
    assert entry.frames is not None
    # Cut after the whole clip has been set on the floor: a part alone may not show where it is.
    whole = load_motion(files[entry.file], character)
    start, stop = entry.frames
    if stop > len(whole):
        raise SpecError(
            f"{path}: reaction {entry.name!r}: frames: expected at most {len(whole)}, the number "
            f"of frames of {entry.file}, got [{start}, {stop}]"
        )
    source = f"{entry.file} frames {start}-{stop}"
    reaction = _reaction(entry, whole.slice(start, stop), source, fps, builtin=False)
    return replace(reaction, start_s=start / whole.fps)


def _builtin(entry: Entry, slug: str, character: Character, fps: float) -> Reaction:
    motion = load_builtin(slug, character)
    return _reaction(entry, motion, motion.name, fps, builtin=True)


def _reaction(entry: Entry, motion: Motion, source: str, fps: float, builtin: bool) -> Reaction:
    motion = motion.resampled(fps).placed()
    labels = (Label(entry.strategy, 0, len(motion)),)
    motion = replace(motion, name=source, labels=labels)
    return Reaction(entry.name, entry.strategy, motion, False, builtin, source)


def _library(
    name: str, originals: Iterable[Reaction], character: Character, fps: float, mirrors: bool
) -> ReactionLibrary:
    """Add mirror images and the identity."""
    reactions = []
    for reaction in originals:
        reactions.append(reaction)
        if mirrors:
            mirrored = reaction.motion.mirrored(character)
            reactions.append(
                replace(reaction, name=reaction.name + MIRRORED, motion=mirrored, mirrored=True)
            )
    digest = hashlib.sha256(f"{character.identity} {fps!r}".encode())
    for reaction in reactions:
        digest.update(f"{reaction.name} {reaction.strategy} {len(reaction.motion)}".encode())
        # Rounded, since the last digits may differ from machine to machine; 0.0 takes away -0.
        digest.update((reaction.motion.poses.round(4) + 0.0).astype("<f8").tobytes())
    return ReactionLibrary(name, tuple(reactions), digest.hexdigest()[:16])
