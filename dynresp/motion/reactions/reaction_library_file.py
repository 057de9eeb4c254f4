"""Reading reaction library files: their tables, and what is wrong with a file.

`reactions/README.md` explains the format to the people who write such files.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PlainValidator, model_validator

from dynresp.motion.builtin import builtin_info, builtin_names
from dynresp.motion.reactions.strategies import STRATEGIES, Strategy
from dynresp.motion.sources.motion_folders import MOTION_SUFFIXES, checked_relative_path
from dynresp.specs.shared_tables import Strict
from dynresp.specs.toml_errors import Hints, read_spec
from dynresp.specs.values import shown
from dynresp.support.errors import SpecError

MIRRORED = "_mirrored"
"""What the name of a reaction's mirror image ends in."""

_MAX_TEXT = 200


def _check_line(given: Any) -> str:
    if not isinstance(given, str) or not given.isprintable() or not 0 < len(given) <= _MAX_TEXT:
        raise ValueError(f"expected a line of 1 to {_MAX_TEXT} characters, got {shown(given)}")
    return given


def _check_name(given: str) -> str:
    if given.endswith(MIRRORED):
        raise ValueError(f"{given!r} must not end in {MIRRORED!r}; mirrors get that ending")
    return given


def _check_file(given: str) -> str:
    try:
        file = checked_relative_path(given)
    except SpecError as error:
        raise ValueError(str(error)) from None
    if PurePosixPath(file).suffix.lower() not in MOTION_SUFFIXES:
        raise ValueError(
            f"{file!r} is not a motion file; its name must end in {', '.join(MOTION_SUFFIXES)}"
        )
    return file


def _check_frames(given: Any) -> tuple[int, int]:
    # type(), since True is an int too.
    if isinstance(given, list | tuple) and [type(x) for x in given] == [int, int]:
        start, stop = given
        if 0 <= start < stop - 1:
            return start, stop
    raise ValueError(
        "expected [first, one past the last] in the file's own frames, at least two, such as "
        f"[100, 161]; got {shown(given)}"
    )


def _check_builtin(given: str) -> str:
    slugs = [slug for slug in builtin_names() if builtin_info(slug).strategy]
    if given not in slugs:
        raise ValueError(f"got {given!r}; allowed: {', '.join(slugs)}")
    return given


_HINTS = Hints(
    missing={
        "reaction": "add [[reaction]] with name, strategy, and file and frames or builtin",
        "strategy": f"expected one of {', '.join(STRATEGIES)}",
    }
)

Line = Annotated[str, PlainValidator(_check_line)]


class Entry(Strict):
    """A `[[reaction]]`: either a range of frames of a file, or a built-in motion.

    Attributes:
        name: Unique in its library.
        strategy: One of `STRATEGIES`.
        file: Path inside a motions folder, with forward slashes; None for a built-in motion.
        frames: First frame and one past the last, in the file's own frames; None likewise.
        builtin: Slug of a built-in motion; None for a file.
        note: For readers of the file.
    """

    name: Annotated[Line, AfterValidator(_check_name)]
    strategy: Strategy
    file: Annotated[Line, AfterValidator(_check_file)] | None = None
    frames: Annotated[tuple[int, int], PlainValidator(_check_frames)] | None = None
    builtin: Annotated[Line, AfterValidator(_check_builtin)] | None = None
    note: Line | None = None

    @model_validator(mode="after")
    def _has_one_source(self) -> Entry:
        if self.builtin is not None:
            if self.file is not None or self.frames is not None:
                raise ValueError("give either builtin, or file and frames, not both")
            own = builtin_info(self.builtin).strategy
            if own != self.strategy:
                raise ValueError(
                    f"strategy: got {self.strategy!r}, but the built-in motion {self.builtin!r} "
                    f"is {own!r}"
                )
        elif self.file is None:
            raise ValueError("file is missing; give file and frames, or builtin")
        elif self.frames is None:
            raise ValueError("frames is missing; expected [first, one past the last]")
        return self


class LibraryFile(Strict):
    """A whole file."""

    reaction: Annotated[list[Entry], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_differ(self) -> LibraryFile:
        names = [entry.name for entry in self.reaction]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"the name {twice[0]!r} is given to more than one reaction")
        return self


def read_entries(path: Path) -> tuple[Entry, ...]:
    """Read and check a library file.

    Args:
        path: A TOML file of `[[reaction]]` tables.

    Returns:
        Its entries, in the order of the file.

    Raises:
        SpecError: It cannot be read, is not TOML, or holds something that is not allowed; the
            message names the file, the reaction, the key, what was given and what is allowed.
    """
    return tuple(read_spec(LibraryFile, path, "a reaction library", _HINTS).reaction)


def builtin_entries() -> tuple[Entry, ...]:
    """The built-in reactions as entries, in the order of `STRATEGIES`."""
    infos = [builtin_info(name) for name in builtin_names()]
    return tuple(
        Entry.model_validate({"name": info.slug, "strategy": strategy, "builtin": info.slug})
        for strategy in STRATEGIES
        for info in infos
        if info.strategy == strategy
    )
