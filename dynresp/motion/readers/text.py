"""Reading motion files within bounds: size, numbers, frame rates, and errors that say where."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionFileError
from dynresp.support.inputs import open_input

MAX_FILE_BYTES = 128 * 2**20
"""Largest motion file that is read [bytes]; text of MAX_POSES takes about as much."""
MAX_POSES = 3_000_000
"""Most joint rotations (frames x joints) of a file, an hour of 27 joints at 30 fps. Reading takes
up to 250 bytes for each, and must stay well under 1 GiB."""
MAX_NUMBER = 1e7
"""Largest number, positive or negative, that is believed in a motion file (any unit)."""

_CHUNK_BYTES = 2**20
_SPACE = re.compile(rb"\s")

# Frame rates that are in use [1/s]. A frame time printed with few digits means one of them.
_STANDARD_RATES = (
    *(10, 12, 12.5, 15, 16, 20, 24, 25, 30, 40, 48, 50, 60, 72, 75, 80, 90, 100, 120, 125, 144),
    *(150, 180, 200, 240, 250, 300, 400, 480, 500, 600, 960, 1000),
)
# Television's; tried only where none of the others fits.
_TELEVISION_RATES = tuple(rate * 1000 / 1001 for rate in (24, 30, 60, 120))


def file_error(path: Path, message: str, line: int | None = None) -> MotionFileError:
    """The error for a file: where it is wrong, and how.

    Args:
        path: The file.
        message: What was found and what was expected.
        line: Line number, from 1, where that makes sense.
    """
    where = f"{path}" if line is None else f"{path}, line {line}"
    return MotionFileError(f"{where}: {message}")


def read_bounded(path: Path, limit: int = MAX_FILE_BYTES) -> bytes:
    """The bytes of a file.

    Args:
        path: The file.
        limit: Largest size accepted [bytes].

    Raises:
        MotionFileError: If it cannot be opened, is not a regular file, is empty or above the limit.
    """
    try:
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "no such file"
            raise file_error(path, f"{what}; expected a motion file")
        with open_input(path) as file:
            data = file.read(limit + 1)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise file_error(path, f"cannot be read ({error})") from error
    if len(data) > limit:
        raise file_error(
            path, f"is larger than {limit / 2**20:g} MiB, the largest motion file read"
        )
    if not data.strip():
        raise file_error(path, "is empty; expected a motion file")
    return data


def decode(data: bytes) -> str:
    """Text of a file's bytes: UTF-8, or Latin-1 where it is not (old exporters)."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def numbers(path: Path, tokens: Iterable[str], line: int, what: str) -> list[float]:
    """Finite numbers of believable size.

    Args:
        path: The file, for the error.
        tokens: The words to read.
        line: Where they stand.
        what: What they are, for the error.

    Raises:
        MotionFileError: If a word is not such a number.
    """
    values = []
    for token in tokens:
        value = number(token)
        if value is None:
            raise file_error(path, f"{what}: {bad_number(token)}", line)
        values.append(value)
    return values


def number(token: str | bytes) -> float | None:
    """The finite number of believable size that a word stands for; None if it is not one."""
    word = token.decode("latin-1") if isinstance(token, bytes) else token
    try:
        value = float(word)
    except ValueError:
        return None
    # float() takes 1_000, which no motion format does. A NaN fails the comparison.
    return value if abs(value) <= MAX_NUMBER and "_" not in word else None


def bad_number(token: str | bytes) -> str:
    """The message for a word that should have been a number."""
    word = token.decode("latin-1") if isinstance(token, bytes) else token
    word = word if len(word) <= 40 else f"{word[:40]}..."
    return f"expected a number between -{MAX_NUMBER:g} and {MAX_NUMBER:g}, found {word!r}"


def number_table(
    path: Path, data: bytes, start: int, shape: tuple[int, int], line: int
) -> FloatArray:
    """The numbers from a byte on to the end of a file, as rows.

    Read piece by piece, so that memory stays near the size of the result.

    Args:
        path: The file, for errors.
        data: Its bytes.
        start: Where the numbers begin.
        shape: Rows and columns that there must be.
        line: Line number of the byte at `start`.

    Returns:
        Array of that shape.

    Raises:
        MotionFileError: If a word is not a finite number of believable size, or there are more or
            fewer numbers than `shape` says.
    """
    rows, columns = shape
    count = rows * columns
    # Each number takes two bytes at least; checked before memory is taken for them.
    if 2 * count - 1 > len(data) - start:
        raise file_error(path, f"is cut short: {len(data) - start} bytes cannot hold {rows} frames")
    values = np.empty(count)
    filled = 0
    for begin, end in _pieces(data, start):
        words = data[begin:end].split()
        piece = _floats(words)
        if piece is None or b"_" in data[begin:end] or not np.all(np.abs(piece) <= MAX_NUMBER):
            wrong = next(word for word in words if number(word) is None)
            at = line + data.count(b"\n", start, _find_word(data, wrong, begin))
            raise file_error(path, bad_number(wrong), at)
        if filled + len(piece) > count:
            raise file_error(
                path, f"goes on after the {rows} frames of {columns} numbers it announces"
            )
        values[filled : filled + len(piece)] = piece
        filled += len(piece)
    if filled < count:
        raise file_error(
            path,
            f"is cut short: expected {rows} frames of {columns} numbers, found "
            f"{filled // columns} frames and {filled % columns} numbers",
        )
    return values.reshape(shape)


def _floats(words: list[bytes]) -> FloatArray | None:
    try:
        return np.array(list(map(float, words)), dtype=np.float64)
    except ValueError:
        return None


def _pieces(data: bytes, start: int) -> Iterator[tuple[int, int]]:
    """Ranges of about _CHUNK_BYTES that end between words."""
    while start < len(data):
        gap = _SPACE.search(data, start + _CHUNK_BYTES)
        end = gap.end() if gap else len(data)
        yield start, end
        start = end


def _find_word(data: bytes, word: bytes, start: int) -> int:
    """Where a word stands by itself, from `start` on."""
    at = data.find(word, start)
    while at > start and (data[at - 1 : at].strip() or data[at + len(word) :][:1].strip()):
        at = data.find(word, at + 1)
    return max(at, start)


def check_size(path: Path, frames: int, joints: int) -> None:
    """Refuse a motion that would not fit the memory set aside for one.

    Raises:
        MotionFileError: If frames x joints is above `MAX_POSES`.
    """
    if frames * joints > MAX_POSES:
        raise file_error(
            path,
            f"{frames} frames of {joints} joints are more than {MAX_POSES} joint poses, the most "
            "that is read; cut the file",
        )


def rate_of_frame_time(text: str) -> float:
    """Frame rate [1/s] of a frame time [s] as it is written.

    0.0333333 means 30 frames a second and 0.008333 means 120: where a rate in common use, once
    inverted and rounded to the digits given, reads the same, it is taken. Otherwise 1/time.

    Args:
        text: A positive decimal number.
    """
    seconds = float(text)
    mantissa, _, exponent = text.lower().partition("e")
    digits = len(mantissa.partition(".")[2]) - int(exponent or 0)
    # One unit in the last place, since some exporters cut instead of rounding; never above 3 %.
    slack = min(1.01 * 10.0 ** max(min(-digits, 300), -300), 0.03 * seconds)
    for rates in (_STANDARD_RATES, _TELEVISION_RATES):
        nearest = min(rates, key=lambda rate: abs(1.0 / rate - seconds))
        if abs(1.0 / nearest - seconds) <= slack:
            return float(nearest)
    return 1.0 / seconds
