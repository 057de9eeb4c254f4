"""Writing a file completely or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dynresp.support.errors import DynrespError


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """A temporary path in the same folder that replaces the file if the block does not raise.

    The temporary name ends like the real one, since some writers choose their format by it.
    If the block raises, what was there before stays.

    Args:
        path: The file to write; missing folders are made.

    Yields:
        Where to write.

    Raises:
        DynrespError: The folder cannot be made or the file cannot be written, or there is a device
            or a pipe, whose place a file would take.
        OSError: The block's, where it is about another file.
    """
    target = Path(path)
    if target.exists() and not (target.is_file() or target.is_dir()):
        raise DynrespError(f"cannot write {target}: it is a device or a pipe; name a file")
    temporary = target.with_name(f".{target.stem}-{secrets.token_hex(6)}{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        # A full disk names no file, and a folder that cannot be made is a parent.
        about = error.filename
        if about is not None and Path(os.fsdecode(about)) not in (temporary, *temporary.parents):
            raise
        raise DynrespError(
            f"cannot write {target}: {error.strerror or error}; choose another folder or free space"
        ) from error
    finally:
        # If not even the folder could be made, there is nothing to remove.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
