"""Download one file of known size and SHA-256, with resume and retries.

`requests` is used directly: pooch, which otherwise does this work, downloads into a temporary file
that it deletes on failure, so it can neither resume nor stop at the known size.
"""

from __future__ import annotations

import hashlib
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from dynresp import __version__
from dynresp.motion.sources.catalogue import SourceFile
from dynresp.support.errors import FetchError
from dynresp.support.paths import CACHE_VARIABLE

if TYPE_CHECKING:
    import requests

_CONTENT_RANGE = re.compile(r"bytes (\d+)-\d+/(\d+|\*)")
_TRANSIENT_STATUS = (408, 429)

# Attempts at a file before giving up.
_ATTEMPTS = 5
# Wait after the first failed attempt [s], which doubles with each further one; and the longest,
# also where the server asks for more [s].
_FIRST_DELAY_S = 0.5
_LONGEST_DELAY_S = 30.0
# Longest wait for a connection, and for the next bytes [s].
_CONNECT_TIMEOUT_S = 10.0
_READ_TIMEOUT_S = 30.0
# Bytes taken at a time.
_CHUNK_BYTES = 16384


class FileRefusedError(FetchError):
    """The server answered, but does not have this file, or has other content than expected."""


class _TransientError(Exception):
    """An attempt failed, but a later one may not; `wait_s` is the wait the server wants [s]."""

    def __init__(self, problem: str, wait_s: float = 0.0) -> None:
        super().__init__(problem)
        self.wait_s = wait_s


def matches(path: Path, source: SourceFile) -> bool:
    """Tell whether a file is there with the right size and SHA-256.

    Args:
        path: The file.
        source: What it should be.

    Returns:
        False where it is missing or differs.

    Raises:
        FetchError: It is there and cannot be read.
    """
    try:
        return _has_content(path, source)
    except OSError as error:
        raise FetchError(f"cannot read {path}: {error.strerror or error}.") from error


def download(
    session: requests.Session,
    url: str,
    source: SourceFile,
    target: Path,
    report: Callable[[int], None],
) -> None:
    """Download a file beside its target, verify it and rename it.

    Args:
        session: Session to send requests with.
        url: Address of the file.
        source: Its size and SHA-256; no more bytes than that are kept.
        target: Where it goes; folders are made, a file that is there is replaced.
        report: Called with the bytes that are there, at the start and as they arrive.

    Raises:
        FileRefusedError: The server does not have the file with this size and SHA-256.
        FetchError: The server cannot be reached or fails again and again, or the file cannot be
            written. What has arrived stays in the `.part` file, and is resumed.
    """
    import requests

    part = target.with_name(target.name + ".part")
    delay_s = _FIRST_DELAY_S
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _drop_unusable_part(part, source)
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                _attempt(session, url, source, part, report)
                os.replace(part, target)
                return
            except (
                requests.ConnectionError,
                requests.Timeout,
                requests.exceptions.ChunkedEncodingError,
                _TransientError,
            ) as error:
                if attempt == _ATTEMPTS:
                    raise FetchError(
                        f"{source.file} could not be fetched from {url} in {attempt} attempts: "
                        f"{error}. What has arrived is kept; fetch again to resume."
                    ) from error
                server_s = error.wait_s if isinstance(error, _TransientError) else 0.0
            time.sleep(min(max(delay_s, server_s), _LONGEST_DELAY_S))
            delay_s *= 2
    except requests.RequestException as error:
        raise FetchError(f"{source.file} could not be fetched from {url}: {error}.") from error
    except OSError as error:
        raise FetchError(
            f"cannot write {error.filename2 or error.filename or part}: {error.strerror or error}. "
            "Free space there, correct its permissions, or name another folder with "
            f"{CACHE_VARIABLE}."
        ) from error


def _attempt(
    session: requests.Session,
    url: str,
    source: SourceFile,
    part: Path,
    report: Callable[[int], None],
) -> None:
    """Bring the part file to its full length, from where it stands, and verify it."""
    start = part.stat().st_size if part.exists() else 0
    report(start)
    if start < source.size:
        # identity: sizes and ranges are those of the file, not of a compressed transfer
        headers = {"Accept-Encoding": "identity", "User-Agent": f"dynresp/{__version__}"}
        if start:
            headers["Range"] = f"bytes={start}-"
        timeout = (_CONNECT_TIMEOUT_S, _READ_TIMEOUT_S)
        with session.get(url, headers=headers, stream=True, timeout=timeout) as response:
            received = begin = _accepted_start(response, url, source, part, start)
            overlong = False
            with part.open("ab" if begin else "wb") as stream:
                for chunk in response.iter_content(_CHUNK_BYTES):
                    overlong = received + len(chunk) > source.size
                    if overlong:
                        break
                    stream.write(chunk)
                    received += len(chunk)
                    report(received)
        if overlong:
            part.unlink()
            raise FileRefusedError(
                f"{source.file}: {url} sends more than the expected {source.size} bytes"
            )
        if received < source.size:
            raise _TransientError(f"the connection ended after {received} of {source.size} bytes")
    if not _has_content(part, source):
        part.unlink()
        problem = f"{url} has other content than expected (SHA-256 is not {source.sha256})"
        if start:
            raise _TransientError(f"{problem} after a resume")
        raise FileRefusedError(f"{source.file}: {problem}")


def _accepted_start(
    response: requests.Response, url: str, source: SourceFile, part: Path, start: int
) -> int:
    """Check the head of an answer.

    Returns:
        The offset in the file that its body begins at: `start`, or 0 where the server sends the
        whole file although a range was requested.
    """
    status = response.status_code
    if status >= 500 or status in _TRANSIENT_STATUS:
        wanted = response.headers.get("Retry-After", "")
        wait_s = float(wanted) if wanted.isdecimal() else 0.0
        raise _TransientError(f"the server answered {status}", wait_s)
    if status == 416 or (status == 206 and not _range_fits(response, source, start)):
        part.unlink(missing_ok=True)
        raise _TransientError(f"the server cannot resume at byte {start} (answer {status})")
    if status not in (200, 206):
        raise FileRefusedError(f"{source.file}: {url} answered {status} {response.reason}")
    begin = start if status == 206 else 0
    length = response.headers.get("Content-Length", "")
    encoded = response.headers.get("Content-Encoding", "identity") != "identity"
    if encoded or length not in ("", str(source.size - begin)):
        what = "a compressed answer" if encoded else f"{length} bytes"
        raise FileRefusedError(
            f"{source.file}: {url} announces {what}; expected {source.size - begin} bytes"
        )
    return begin


def _range_fits(response: requests.Response, source: SourceFile, start: int) -> bool:
    """Tell whether a partial answer begins where requested and is of a file of the right size."""
    match = _CONTENT_RANGE.fullmatch(response.headers.get("Content-Range", ""))
    return match is not None and match[1] == str(start) and match[2] in ("*", str(source.size))


def _drop_unusable_part(part: Path, source: SourceFile) -> None:
    """Delete a part file that cannot be resumed: too long, or complete and wrong."""
    if not part.exists():
        return
    size = part.stat().st_size
    if size > source.size or (size == source.size and not _has_content(part, source)):
        part.unlink()


def _has_content(path: Path, source: SourceFile) -> bool:
    if not path.is_file() or path.stat().st_size != source.size:
        return False
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest() == source.sha256
