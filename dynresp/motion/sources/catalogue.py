"""The public motion files that dynresp can fetch: where they are published, and their terms.

`reactions/sources.csv` holds facts about the files (where they are published, size, SHA-256) and
`reactions/licences.csv` the terms of each repository; `reactions/SOURCES.md` explains both.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from dynresp.motion.sources.motion_folders import checked_relative_path
from dynresp.support.errors import SpecError
from dynresp.support.paths import reactions_folder

MAX_FILE_BYTES = 1 << 30
"""Largest file a source table may announce [bytes]."""

_KINDS = ("clip", "skeleton", "licence")
_SOURCE_COLUMNS = (
    "kind",
    "file",
    "source_repo",
    "commit",
    "original_path",
    "licence",
    "bytes",
    "sha256",
    "fps",
    "unit_m",
    "skeleton",
)
_LICENCE_COLUMNS = ("source_repo", "licence", "name", "credit", "terms", "url")
_REPOSITORY = re.compile(r"[A-Za-z0-9_.-]+/[A-Za-z0-9_.-]+")
_COMMIT = re.compile(r"[0-9a-f]{40}")
_SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class Licence:
    """Terms under which one public repository gives its motion files.

    Attributes:
        source_repo: Repository on github.com, as "owner/name".
        spdx: SPDX identifier, or a `LicenseRef-` name where SPDX has none.
        name: Name of the licence or of the data set in words.
        credit: Line to show and to print with results.
        terms: The main terms in a sentence.
        url: Page to read more.
    """

    source_repo: str
    spdx: str
    name: str
    credit: str
    terms: str
    url: str


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A public file that can be fetched, and how to know that it is the right one.

    Attributes:
        kind: "clip", "skeleton" or "licence".
        file: Path inside a motions folder, with forward slashes.
        source_repo: Repository on github.com, as "owner/name".
        commit: Pinned commit, 40 hexadecimal digits.
        original_path: Path inside the repository.
        licence: SPDX identifier, the one of the repository's `Licence`.
        size: Size of the file [bytes].
        sha256: SHA-256 of the file, 64 hexadecimal digits.
        fps: Frames per second of a clip; None for other kinds.
        unit_m: Length unit of a clip or skeleton [m]; None for licences.
        skeleton: For an AMC clip, the `file` of its ASF skeleton; else None.
    """

    kind: str
    file: str
    source_repo: str
    commit: str
    original_path: str
    licence: str
    size: int
    sha256: str
    fps: float | None
    unit_m: float | None
    skeleton: str | None


def load_licences(path: Path | None = None) -> dict[str, Licence]:
    """Read the table of licences.

    Args:
        path: A licence table; by default the shipped one.

    Returns:
        Licences by repository ("owner/name").

    Raises:
        SpecError: The table cannot be read, or a row is wrong; the message names the line.
    """
    path = path or reactions_folder() / "licences.csv"
    licences: dict[str, Licence] = {}
    for line, row in _rows(path, _LICENCE_COLUMNS):
        repo = row["source_repo"]
        if not all(row.values()):
            raise SpecError(f"{path}, line {line}: every column needs a value.")
        if repo in licences:
            raise SpecError(f"{path}, line {line}: {repo!r} is there twice.")
        licences[repo] = Licence(
            repo, row["licence"], row["name"], row["credit"], row["terms"], row["url"]
        )
    return licences


def load_sources(
    path: Path | None = None, licences: Mapping[str, Licence] | None = None
) -> dict[str, SourceFile]:
    """Read the table of public motion files and check every row.

    Args:
        path: A source table; by default the shipped one.
        licences: Licences by repository; by default the shipped ones.

    Returns:
        Source files by their path inside a motions folder, in the order of the table.

    Raises:
        SpecError: The table cannot be read, or a row is wrong; the message names the line.
    """
    path = path or reactions_folder() / "sources.csv"
    licences = load_licences() if licences is None else licences
    sources: dict[str, SourceFile] = {}
    for line, row in _rows(path, _SOURCE_COLUMNS):
        try:
            source = _source_file(row, licences)
        except SpecError as error:
            raise SpecError(f"{path}, line {line}: {error}") from None
        if source.file in sources:
            raise SpecError(f"{path}, line {line}: {source.file!r} is there twice.")
        sources[source.file] = source
    for source in sources.values():
        skeleton = source.skeleton
        if skeleton and (skeleton not in sources or sources[skeleton].kind != "skeleton"):
            raise SpecError(
                f"{path}: {source.file!r} names the skeleton {skeleton!r}, but the table has no "
                "row of kind 'skeleton' for it."
            )
    return sources


def licences_of(
    files: Iterable[SourceFile], licences: Mapping[str, Licence] | None = None
) -> list[Licence]:
    """List the licences that some files come under, to show before they are fetched.

    Args:
        files: The files.
        licences: Licences by repository; by default the shipped ones.

    Returns:
        One licence per repository, sorted by repository.
    """
    licences = load_licences() if licences is None else licences
    return [licences[repo] for repo in sorted({source.source_repo for source in files})]


def _rows(path: Path, columns: tuple[str, ...]) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield line number and row of a CSV table that must have exactly these columns."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            header = next(reader, [])
            if tuple(header) != columns:
                raise SpecError(
                    f"{path}: the columns are {', '.join(header)}; expected {', '.join(columns)}."
                )
            for values in reader:
                if len(values) != len(columns):
                    raise SpecError(
                        f"{path}, line {reader.line_num}: {len(values)} values; "
                        f"expected {len(columns)}."
                    )
                yield reader.line_num, dict(zip(columns, values, strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SpecError(f"the table {path} cannot be read: {error}.") from error


def _source_file(row: Mapping[str, str], licences: Mapping[str, Licence]) -> SourceFile:
    kind, repo = row["kind"], row["source_repo"]
    if kind not in _KINDS:
        raise SpecError(f"kind is {kind!r}; expected one of {', '.join(_KINDS)}.")
    file = checked_relative_path(row["file"])
    _expect_match(row, "source_repo", _REPOSITORY, "owner/name")
    if repo not in licences or licences[repo].spdx != row["licence"]:
        raise SpecError(
            f"licence is {row['licence']!r}, but the licence table does not state that for {repo}."
        )
    is_amc = kind == "clip" and file.lower().endswith(".amc")
    if is_amc != bool(row["skeleton"]):
        raise SpecError(f"skeleton is {row['skeleton']!r}; AMC clips need one, others have none.")
    return SourceFile(
        kind=kind,
        file=file,
        source_repo=repo,
        commit=_expect_match(row, "commit", _COMMIT, "40 hexadecimal digits"),
        original_path=checked_relative_path(row["original_path"]),
        licence=row["licence"],
        size=int(_number(row, "bytes", int, MAX_FILE_BYTES)),
        sha256=_expect_match(row, "sha256", _SHA256, "64 hexadecimal digits"),
        fps=_number(row, "fps", float, 10_000.0) if kind == "clip" else None,
        unit_m=_number(row, "unit_m", float, 1_000.0) if kind != "licence" else None,
        skeleton=row["skeleton"] or None,
    )


def _expect_match(
    row: Mapping[str, str], column: str, pattern: re.Pattern[str], expected: str
) -> str:
    if not pattern.fullmatch(row[column]):
        raise SpecError(f"{column} is {row[column]!r}; expected {expected}.")
    return row[column]


def _number(
    row: Mapping[str, str], column: str, parse: Callable[[str], float], most: float
) -> float:
    """Read a number above 0 and at most `most`."""
    try:
        value = parse(row[column])
    except ValueError:
        value = math.nan
    if not 0 < value <= most:
        raise SpecError(f"{column} is {row[column]!r}; expected a number above 0, at most {most}.")
    return value
