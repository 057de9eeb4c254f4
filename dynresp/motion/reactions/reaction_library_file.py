"""The files of reaction libraries: what may stand in them, and how a wrong one is refused.

`reactions/README.md` explains the format to the people who write such files.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from dynresp.motion.builtin import builtin_info, builtin_names
from dynresp.motion.reactions.strategies import STRATEGIES
from dynresp.motion.sources.motion_folders import MOTION_SUFFIXES, checked_relative_path
from dynresp.support.errors import SpecError

MIRRORED = "_mirrored"
"""What the name of a reaction's mirror image ends in."""

_MAX_BYTES = 4 * 2**20
_KEYS = ("name", "strategy", "file", "frames", "builtin", "note")
_MAX_TEXT = 200


@dataclass(frozen=True)
class Entry:
    """One `[[reaction]]` table, checked: either a stretch of a file or a built-in motion.

    Attributes:
        name: Unique in its library.
        strategy: One of `STRATEGIES`.
        file: Path inside a motions folder, with forward slashes; None for a built-in motion.
        frames: First frame and one past the last, in the file's own frames; None likewise.
        builtin: Slug of a built-in motion; None for a file.
    """

    name: str
    strategy: str
    file: str | None = None
    frames: tuple[int, int] | None = None
    builtin: str | None = None


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
    content = _parse(path)
    unknown = sorted(set(content) - {"reaction"})
    if unknown:
        raise SpecError(f"{path}: unknown key {unknown[0]!r}; allowed: reaction")
    tables = content.get("reaction")
    if not isinstance(tables, list) or not tables or not all(isinstance(t, dict) for t in tables):
        raise SpecError(f"{path}: expected one or more [[reaction]] tables, got {_shown(tables)}")
    entries = []
    for number, table in enumerate(tables, start=1):
        try:
            entries.append(_entry(table))
        except SpecError as error:
            name = table.get("name")
            told = f"{number} ({name})" if isinstance(name, str) and name else f"{number}"
            raise SpecError(f"{path}: reaction {told}: {error}") from None
    names = [entry.name for entry in entries]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SpecError(f"{path}: the name {twice[0]!r} is given to more than one reaction")
    return tuple(entries)


def builtin_entries() -> tuple[Entry, ...]:
    """The built-in reactions as entries, in the order of `STRATEGIES`."""
    infos = [builtin_info(name) for name in builtin_names()]
    return tuple(
        Entry(info.slug, strategy, builtin=info.slug)
        for strategy in STRATEGIES
        for info in infos
        if info.strategy == strategy
    )


def _parse(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_BYTES + 1)
        if len(data) > _MAX_BYTES:
            raise SpecError(f"{path}: larger than {_MAX_BYTES} bytes; that is no reaction library")
        return tomllib.loads(data.decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        if isinstance(error, OSError):
            raise SpecError(f"{path}: cannot be read ({error.strerror})") from error
        raise SpecError(f"{path}: not valid TOML: {error}") from error


def _entry(table: Mapping[str, Any]) -> Entry:
    for key in table:
        if key not in _KEYS:
            raise SpecError(f"unknown key {key!r}; allowed: {', '.join(_KEYS)}")
    name, strategy = _text(table, "name"), _text(table, "strategy")
    if name.endswith(MIRRORED):
        raise SpecError(f"name: {name!r} must not end in {MIRRORED!r}; mirrors get that ending")
    if strategy not in STRATEGIES:
        raise SpecError(f"strategy: got {strategy!r}; allowed: {', '.join(STRATEGIES)}")
    if "note" in table:
        _text(table, "note")
    if "builtin" in table:
        if "file" in table or "frames" in table:
            raise SpecError("give either builtin, or file and frames, not both")
        return Entry(name, strategy, builtin=_builtin(_text(table, "builtin"), strategy))
    file = checked_relative_path(_text(table, "file"))
    if PurePosixPath(file).suffix.lower() not in MOTION_SUFFIXES:
        raise SpecError(
            f"file: {file!r} is no motion file; its name must end in {', '.join(MOTION_SUFFIXES)}"
        )
    return Entry(name, strategy, file, _frames(table.get("frames")))


def _text(table: Mapping[str, Any], key: str) -> str:
    if key not in table:
        hint = ", or builtin in its place" if key == "file" else ""
        raise SpecError(f"{key} is missing{hint}")
    value = table[key]
    if not isinstance(value, str) or not value.isprintable() or not 0 < len(value) <= _MAX_TEXT:
        raise SpecError(
            f"{key}: expected a line of 1 to {_MAX_TEXT} characters, got {_shown(value)}"
        )
    return value


def _builtin(slug: str, strategy: str) -> str:
    names = [entry.builtin for entry in builtin_entries() if entry.builtin]
    if slug not in names:
        raise SpecError(f"builtin: got {slug!r}; allowed: {', '.join(names) or 'none'}")
    own = builtin_info(slug).strategy
    if own != strategy:
        raise SpecError(f"strategy: got {strategy!r}, but the built-in motion {slug!r} is {own!r}")
    return slug


def _frames(value: Any) -> tuple[int, int]:
    # type(), since True is an int too.
    if isinstance(value, list) and [type(x) for x in value] == [int, int]:
        start, stop = value
        if 0 <= start < stop - 1:
            return start, stop
    raise SpecError(
        "frames: expected [first, one past the last] in the file's own frames, at least two, "
        f"such as [100, 161]; got {_shown(value)}"
    )


def _shown(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
