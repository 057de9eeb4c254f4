"""Keeps made built-in motions in the user's cache folder, so that each is made once.

A kept motion is used where nothing that it was made from has changed: its file, the character's
file, the code of `dynresp.motion`, and the libraries that calculate. A cache that cannot be read or
written is no failure: the motion is then made again.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.support.errors import DynrespError
from dynresp.support.paths import PACKAGE_FOLDER, cache_folder
from dynresp.support.progress import announce

# What calculates; another version may give other last digits.
_LIBRARIES = ("numpy", "scipy", "numba", "mujoco")


def kept_motion(spec_file: Path, character: Character, make: Callable[[], Motion]) -> Motion:
    """Read a motion that was made before, or make it and keep it.

    Args:
        spec_file: The file that describes the motion.
        character: Who moves.
        make: Makes the motion.

    Returns:
        The motion, with the same bits either way.
    """
    from dynresp.motion.export import write_npz
    from dynresp.motion.readers.npz import read_npz

    file = None
    with suppress(DynrespError, OSError):
        file = _file(spec_file, character)
        if file.is_file():
            return read_npz(file, character)
    announce("making the built-in motions, once (about 2 s in all)")
    motion = make()
    if file is not None:
        with suppress(DynrespError, OSError):
            write_npz(motion, file, character)
    return motion


def _file(spec_file: Path, character: Character) -> Path:
    """Where the motion is kept; another place for whatever would give another motion."""
    digest = hashlib.sha256(_code())
    for part in (spec_file.read_bytes(), character.file.read_bytes(), character.identity.encode()):
        digest.update(hashlib.sha256(part).digest())
    return cache_folder() / "builtin" / f"{spec_file.stem}-{digest.hexdigest()[:16]}.npz"


@functools.cache
def _code() -> bytes:
    """Hash of the code that makes motions."""
    digest = hashlib.sha256(" ".join(version(name) for name in _LIBRARIES).encode())
    for file in sorted((PACKAGE_FOLDER / "motion").rglob("*.py")):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.digest()
