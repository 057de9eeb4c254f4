"""Collections: named sets of public motion files that are fetched together.

What they hold is read from the files that need them, so that it is always up to date.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from dynresp.motion.sources.catalogue import SourceFile, load_sources
from dynresp.motion.sources.motion_folders import (
    MOTION_SUFFIXES,
    checked_relative_path,
    fits_pattern,
)
from dynresp.specs.toml_reader import read_toml
from dynresp.support.errors import SpecError, UnknownNameError
from dynresp.support.paths import example_specs, reactions_folder

GRAPHS = "graphs"
"""Name of the folder of graph plans among the examples, and of the collection that they need."""

COLLECTIONS: Mapping[str, str] = {
    "core": "what reactions/core.toml, the example experiments and the plans use",
    "full": "core, and what reactions/full.toml uses",
    GRAPHS: "what the motion graphs of `dynresp graph build` use",
    "all": "every file in reactions/sources.csv",
}
"""Names of the collections and what each holds."""


def collection_files(
    name: str,
    sources: Mapping[str, SourceFile] | None = None,
    *,
    reactions: Path | None = None,
    examples: Path | None = None,
) -> list[SourceFile]:
    """List what a collection holds: clips, the skeletons they need, and the licence texts.

    All but "all" hold every motion file that library files, examples and plans name, as
    `files_named_in` finds them; a name with wildcards stands for all that it matches.

    Args:
        name: A name in `COLLECTIONS`.
        sources: The known source files; by default the shipped table.
        reactions: Folder of `core.toml` and `full.toml`; by default the shipped one.
        examples: Folder of the example experiments and plans; by default the shipped one.

    Returns:
        Source files, sorted by path.

    Raises:
        UnknownNameError: There is no such collection.
        SpecError: A library file is missing or damaged, or names a motion file that the source
            table does not know.
    """
    if name not in COLLECTIONS:
        raise UnknownNameError("collection", name, COLLECTIONS)
    sources = load_sources() if sources is None else sources
    if name == "all":
        return [sources[file] for file in sorted(sources)]
    reactions = reactions or reactions_folder()
    specs = sorted((examples or example_specs()).rglob("*.toml"))
    if name == GRAPHS:
        libraries = [file for file in specs if file.parent.name == GRAPHS]
    else:
        specs = [file for file in specs if file.parent.name != GRAPHS]
        libraries = [reactions / "core.toml", *specs]
    if name == "full":
        libraries.append(reactions / "full.toml")
    wanted: set[str] = set()
    for library in libraries:
        for given in files_named_in(library):
            clips = [file for file, source in sources.items() if source.kind == "clip"]
            files = [c for c in clips if fits_pattern(c, given)] if "*" in given else [given]
            file = next((file for file in files or [given] if file not in sources), None)
            if file is not None:
                raise SpecError(
                    f"{library} names the motion file {file!r}, which is not in the source "
                    "table; correct the name or add a row to reactions/sources.csv."
                )
            wanted.update(files)
    return _with_companions(wanted, sources)


def files_named_in(library: Path) -> set[str]:
    """Collect the motion files that a reaction library or experiment names.

    These are the texts under keys `file` or `motion`, at any depth, that end with the suffix of
    a motion file. Names without one are built-in motions, which need no fetching.

    Args:
        library: A TOML file.

    Returns:
        Paths inside a motions folder, with forward slashes.

    Raises:
        SpecError: The file is missing, cannot be read, is not TOML, or names a path that leads
            out of a motions folder.
    """
    hint = (
        ". A collection of motion files is made from it; restore the file or install dynresp again."
    )
    content = read_toml(library, "a library or spec", hint)
    named: set[str] = set()
    for text in _texts_under(content, ("file", "motion")):
        if PurePosixPath(text).suffix.lower() in MOTION_SUFFIXES:
            try:
                named.add(checked_relative_path(text))
            except SpecError as error:
                raise SpecError(f"{library}: {error}") from None
    return named


def _with_companions(files: set[str], sources: Mapping[str, SourceFile]) -> list[SourceFile]:
    """Add the skeletons of AMC clips and the licence texts of all repositories involved."""
    skeletons = {sources[file].skeleton for file in files} - {None}
    repos = {sources[file].source_repo for file in files}
    return [
        source
        for file, source in sorted(sources.items())
        if file in files
        or file in skeletons
        or (source.kind == "licence" and source.source_repo in repos)
    ]


def _texts_under(content: Any, keys: tuple[str, ...]) -> Iterator[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            if key in keys and isinstance(value, str):
                yield value
            else:
                yield from _texts_under(value, keys)
    elif isinstance(content, list):
        for value in content:
            yield from _texts_under(value, keys)
