"""Fetch public motion files into the user's cache, at pinned commits, checked by SHA-256.

Nothing here runs unless it is called: dynresp never uses the network on its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlsplit

from dynresp.motion.sources.catalogue import Licence, SourceFile, licences_of
from dynresp.motion.sources.collection import collection_files
from dynresp.motion.sources.download import FileRefusedError, download, matches
from dynresp.motion.sources.motion_folders import fetched_folder
from dynresp.support.errors import FetchError, UsageError

URL_VARIABLE = "DYNRESP_FETCH_URL"
"""Environment variable that names a mirror to fetch from."""

DEFAULT_URL = "https://raw.githubusercontent.com/{repo}/{commit}/{path}"
"""Where files are fetched from: `{repo}` is "owner/name", `{path}` the path inside it."""

_LISTED_FAILURES = 5


@dataclass(frozen=True, slots=True)
class FetchPlan:
    """What fetching would do, to show before it is done.

    Attributes:
        folder: Motions folder that the files go to.
        files: All files of the collection.
        missing: Those of them that are not there yet, or not with the right content.
        licences: Licences that the files come under.
    """

    folder: Path
    files: tuple[SourceFile, ...]
    missing: tuple[SourceFile, ...]
    licences: tuple[Licence, ...]

    @property
    def missing_bytes(self) -> int:
        """Size of the missing files [bytes]; less is transferred where some is there to resume."""
        return sum(source.size for source in self.missing)


@dataclass(frozen=True, slots=True)
class FetchProgress:
    """How far fetching has come.

    Attributes:
        source: The file on its way.
        number: Its place among the missing files, from 1.
        count: Number of missing files.
        received: Bytes of this file that are there.
        total_received: Bytes of all missing files that are there.
        total_bytes: Size of all missing files [bytes].
    """

    source: SourceFile
    number: int
    count: int
    received: int
    total_received: int
    total_bytes: int


def plan_fetch(
    collection: str | Iterable[SourceFile],
    folder: Path | None = None,
    licences: Mapping[str, Licence] | None = None,
) -> FetchPlan:
    """Find out what has to be fetched; uses no network.

    Files that are there already are checked by size and SHA-256, so a damaged file counts as
    missing.

    Args:
        collection: A collection's name, or the files themselves.
        folder: Motions folder to fetch into; by default the one in the user's cache.
        licences: Licences by repository; by default the shipped ones.

    Returns:
        The plan.

    Raises:
        UnknownNameError: There is no such collection.
        SpecError: A library file that makes up the collection is missing or wrong.
        FetchError: A file in the folder cannot be read.
    """
    chosen = collection_files(collection) if isinstance(collection, str) else collection
    files = tuple(chosen)
    folder = fetched_folder() if folder is None else folder
    missing = tuple(source for source in files if not matches(folder / source.file, source))
    return FetchPlan(folder, files, missing, tuple(licences_of(files, licences)))


def fetch(
    plan: FetchPlan,
    *,
    base_url: str | None = None,
    progress: Callable[[FetchProgress], None] | None = None,
) -> None:
    """Fetch the missing files of a plan, one after the other.

    If Ctrl-C or the network interrupts a download, what has arrived stays in a `.part` file beside
    the target, and the next call resumes it. A file gets its name only after its SHA-256 was
    verified. If the server does not have a file, or has it with other content, the others are
    still fetched.

    Args:
        plan: What `plan_fetch` found to be missing.
        base_url: Address of a mirror, by default the environment variable `DYNRESP_FETCH_URL`,
            else `DEFAULT_URL`. `{repo}`, `{commit}` and `{path}` in it are filled in; without
            `{path}` these three are appended.
        progress: Called at the start of each file and whenever bytes arrive.

    Raises:
        UsageError: The address is not an http(s) address, or has unknown fields in braces.
        FetchError: Files could not be fetched; the message says which and why.
    """
    import requests

    template = _url_template(base_url)
    refused: list[str] = []
    before = 0
    with requests.Session() as session:
        for number, source in enumerate(plan.missing, start=1):
            report = _reporter(progress, plan, number, before)
            url = file_url(template, source)
            try:
                download(session, url, source, plan.folder / source.file, report)
            except FileRefusedError as error:
                refused.append(str(error))
            before += source.size
    if refused:
        more = len(refused) - _LISTED_FAILURES
        raise FetchError(
            f"{len(refused)} of {len(plan.missing)} files could not be fetched:\n  "
            + "\n  ".join(refused[:_LISTED_FAILURES])
            + (f"\n  and {more} more" if more > 0 else "")
        )


def file_url(template: str, source: SourceFile) -> str:
    """Fill a URL template in for a file, with characters such as spaces quoted.

    Args:
        template: Address with the fields `{repo}`, `{commit}` and `{path}`.
        source: The file.

    Returns:
        The address of the file.
    """
    return (
        template.replace("{repo}", quote(source.source_repo))
        .replace("{commit}", source.commit)
        .replace("{path}", quote(source.original_path))
    )


def _reporter(
    progress: Callable[[FetchProgress], None] | None, plan: FetchPlan, number: int, before: int
) -> Callable[[int], None]:
    """Turn the byte count of one download into progress of the whole plan."""
    source = plan.missing[number - 1]
    count, total = len(plan.missing), plan.missing_bytes

    def report(received: int) -> None:
        if progress is not None:
            progress(FetchProgress(source, number, count, received, before + received, total))

    return report


def _url_template(base_url: str | None) -> str:
    """Choose and check the address to fetch from."""
    given = base_url or os.environ.get(URL_VARIABLE) or DEFAULT_URL
    template = given if "{path}" in given else given.rstrip("/") + "/{repo}/{commit}/{path}"
    try:
        parts = urlsplit(template)
        right = parts.scheme in ("http", "https") and bool(parts.hostname)
    except ValueError:
        right = False
    fields = ("{repo}", "{commit}", "{path}")
    rest = template
    for field in fields:
        rest = rest.replace(field, "")
    if not right or "{" in rest or "}" in rest:
        raise UsageError(
            f"the address to fetch from is {given!r}; expected http:// or https:// and a host, "
            f"with no other fields than {', '.join(fields)}. "
            f"Correct it or unset {URL_VARIABLE}."
        )
    return template
