"""Reading TOML files that users write, within bounds."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from dynresp.support.errors import SpecError
from dynresp.support.inputs import open_input

MAX_FILE_BYTES = 4 << 20
"""Largest file that is read [bytes]."""


def read_toml(path: Path, what: str, hint: str = "") -> dict[str, Any]:
    """Read a TOML file.

    Args:
        path: The file.
        what: What it is, with an article, such as "an experiment file".
        hint: What else the user can do if there is no such file; follows the message.

    Raises:
        SpecError: It cannot be read, is too large or not TOML. The message names the file.
    """
    try:
        with open_input(path) as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise SpecError(f"{path}: {why}; expected {what} (.toml)" + hint) from None
    if len(data) > MAX_FILE_BYTES:
        limit = f"{MAX_FILE_BYTES // 1024} KiB"
        raise SpecError(f"{path} is larger than {limit}; expected {what} of at most {limit}")
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise SpecError(f"{path} is not text in UTF-8 (byte {error.start})") from None
    # Deeply nested brackets exhaust the parser's stack.
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SpecError(f"{path} is not valid TOML: {error}") from None
