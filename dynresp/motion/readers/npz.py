"""The product's own motion file: a NumPy `.npz` archive of plain arrays, format version 1.

An archive (zip, members stored or deflated) of exactly these `.npy` members, written by
`dynresp.motion.export.write_npz` and readable with `numpy.load(path, allow_pickle=False)`:

==================  =======  ============  =======================================================
member              dtype    shape         what it holds
==================  =======  ============  =======================================================
``format_version``  int64    ()            1; a reader refuses versions that it does not know
``character``       text     ()            `Character.identity` of the character that moves
``name``            text     ()            where the motion comes from, for people
``fps``             float64  ()            frames per second
``poses``           float64  (frames, 59)  rows of `qpos`: root position [m], root quaternion, 13
                                           joint quaternions, all w x y z and of unit length; Z up
``contacts``        bool     (frames, 2)   whether the left and the right foot stand
``label_names``     text     (labels,)     names of ranges of frames
``label_ranges``    int64    (labels, 2)   first frame, and one past the last
==================  =======  ============  =======================================================

Numbers are little-endian, text is fixed-width UCS-4 (NumPy's ``<U``), and nothing is pickled.
"""

from __future__ import annotations

import math
import os
import re
import struct
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from dynresp.errors import MotionError, MotionFileError
from dynresp.motion.character import POSE_SIZE, Character, default_character
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.text import MAX_FILE_BYTES, fail

FORMAT_VERSION = 1
"""Version of the format that is written, and the only one that is read."""
MAX_FRAMES = 250_000
"""Most frames of a motion (2.3 hours at 30 fps); reading it then stays below 1 GiB."""
MAX_LABELS = 10_000
"""Most labels of a motion."""
MAX_TEXT = 1_000
"""Most characters of a name."""

TEXT = "<U"
# Type and shape of each member; a name in a shape stands for a length that the file chooses.
MEMBERS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "format_version": ("<i8", ()),
    "character": (TEXT, ()),
    "name": (TEXT, ()),
    "fps": ("<f8", ()),
    "poses": ("<f8", ("frames", POSE_SIZE)),
    "contacts": ("|b1", ("frames", 2)),
    "label_names": (TEXT, ("labels",)),
    "label_ranges": ("<i8", ("labels", 2)),
}
"""Members of the archive: type (text of any width where it is `TEXT`) and shape."""
_MOST = {"frames": MAX_FRAMES, "labels": MAX_LABELS}

# The record at the end of a zip file, and the one before it where the archive is a zip64.
_ZIP_END = struct.Struct("<4s4H2LH")
_ZIP64_BYTES = 20
_MAX_DIRECTORY_BYTES = 2**16
_NPY_MAGIC = b"\x93NUMPY\x01\x00"
# The header as NumPy writes it. Not left to NumPy's own parser, which evaluates it as Python.
_NPY_HEADER = re.compile(
    rb"\{'descr': '([<|][a-zA-Z])(\d{1,9})', 'fortran_order': False, "
    rb"'shape': \(((?:\d{1,12}, )*(?:\d{1,12},?)?)\), \} *\n"
)
_UNIT_LENGTH_TOLERANCE = 1e-6


def read_npz(path: str | Path, character: Character | None = None) -> Motion:
    """Read a motion of this character.

    Whatever the file says, little more memory is taken than a motion of `MAX_FRAMES` needs: sizes
    are checked before anything is unpacked, and no object is unpickled.

    Args:
        path: The file.
        character: The character that shall play the motion; the product's own by default.

    Returns:
        The motion, bit for bit as it was written.

    Raises:
        MotionFileError: The file cannot be opened, is damaged or out of bounds, is no motion of
            dynresp, or belongs to another format version or another character.
    """
    path = Path(path)
    character = character or default_character()
    try:
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "no such file"
            raise fail(path, f"{what}; expected a .npz motion file")
        with path.open("rb") as file:
            _check_archive(path, file)
            with zipfile.ZipFile(file) as archive:
                arrays = _arrays(path, archive)
    except MotionFileError:
        raise
    # On damaged files zipfile and zlib raise a dozen kinds of errors, of which few are documented.
    except Exception as error:
        raise fail(path, f"is damaged or no .npz file ({type(error).__name__}: {error})") from error
    return _motion(path, arrays, character)


def member_problem(name: str, type_code: str, shape: tuple[int, ...]) -> str | None:
    """What is wrong with the type or shape of a member, or None.

    Args:
        name: A key of `MEMBERS`.
        type_code: NumPy's, such as "<f8" or "<U12".
        shape: Its shape.
    """
    wanted_type, wanted_shape = MEMBERS[name]
    if wanted_type == TEXT:
        width = type_code.removeprefix(TEXT)
        if not (type_code.startswith(TEXT) and width.isdigit()):
            return f"{name} must be text, not {type_code}"
        if int(width) > MAX_TEXT:
            return f"{name} must have at most {MAX_TEXT} characters, not {width}"
    elif type_code != wanted_type:
        return f"{name} must be of type {wanted_type}, not {type_code}"
    fits = len(shape) == len(wanted_shape) and all(
        given <= _MOST[wanted] if isinstance(wanted, str) else given == wanted
        for given, wanted in zip(shape, wanted_shape, strict=True)
    )
    if not fits:
        allowed = ", ".join(
            f"up to {_MOST[x]}" if isinstance(x, str) else f"{x}" for x in wanted_shape
        )
        return f"{name} must have the shape ({allowed}), not {shape}"
    return None


def _check_archive(path: Path, file: BinaryIO) -> None:
    """Refuse what is no small zip archive, before the zip library reads its directory."""
    size = file.seek(0, os.SEEK_END)
    if size > 2 * MAX_FILE_BYTES:
        raise fail(path, f"is larger than {2 * MAX_FILE_BYTES / 2**20:g} MiB; cut the motion")
    file.seek(-min(size, _ZIP_END.size + _ZIP64_BYTES), os.SEEK_END)
    tail = file.read()
    if len(tail) < _ZIP_END.size:
        raise fail(path, f"has {size} bytes, too few for an .npz file")
    signature, *_, directory_bytes, _, comment = _ZIP_END.unpack(tail[-_ZIP_END.size :])
    if signature != b"PK\x05\x06" or comment:
        raise fail(path, "is no .npz file, or was cut short: a zip archive's end is missing")
    if directory_bytes > _MAX_DIRECTORY_BYTES or tail.startswith(b"PK\x06\x07"):
        raise fail(path, "is an archive of far more than a motion")


def _arrays(path: Path, archive: zipfile.ZipFile) -> dict[str, npt.NDArray[Any]]:
    """All members, checked one by one."""
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if "format_version" not in members:
        raise fail(
            path, f"is no motion file of dynresp; it has no format_version but {_list(members)}"
        )
    version = int(_array(path, archive, members["format_version"], "format_version"))
    if version != FORMAT_VERSION:
        raise fail(
            path,
            f"has format version {version}, and this dynresp reads version {FORMAT_VERSION}; "
            "use the dynresp that wrote it, or a newer one",
        )
    if members.keys() != MEMBERS.keys() or len(members) != len(archive.infolist()):
        raise fail(path, f"must hold {_list(MEMBERS)}, each once, and holds {_list(members)}")
    return {name: _array(path, archive, members[name], name) for name in MEMBERS}


def _list(names: dict[str, Any]) -> str:
    shown = ", ".join(sorted(names)[:12]) or "nothing"
    return shown if len(shown) <= 200 else f"{shown[:200]}..."


def _array(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str
) -> npt.NDArray[Any]:
    """One member, unpacked only after its type, shape and size are known to be right.

    Text comes back as an array of Python strings.
    """
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise fail(path, f"{name} is packed by a method that .npz files do not use")
    with archive.open(info) as member:
        start = member.read(len(_NPY_MAGIC) + 2)
        if start[:-2] != _NPY_MAGIC:
            raise fail(path, f"{name} is no .npy array of version 1.0")
        header = member.read(int.from_bytes(start[-2:], "little"))
        found = _NPY_HEADER.fullmatch(header)
        if found is None:
            raise fail(path, f"{name} has a header that is not understood: {header[:100]!r}")
        type_code = (found[1] + found[2]).decode()
        shape = tuple(int(n) for n in found[3].replace(b",", b" ").split())
        problem = member_problem(name, type_code, shape)
        if problem:
            raise fail(path, problem)
        dtype = np.dtype(type_code)
        size = math.prod(shape) * dtype.itemsize
        if info.file_size != len(start) + len(header) + size:
            raise fail(path, f"{name} has {info.file_size} bytes, which is not what {shape} needs")
        # Reading to the end also has the checksum compared.
        data = member.read(size)
        if len(data) != size or member.read(1):
            raise fail(path, f"{name} is cut short")
    if dtype.kind == "U":
        return _texts(data, dtype.itemsize, shape)
    if dtype.kind == "b" and size and max(data) > 1:
        raise fail(path, f"{name} must be 0 or 1 everywhere")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def _texts(data: bytes, width: int, shape: tuple[int, ...]) -> npt.NDArray[np.object_]:
    """Strings of `width` bytes each. Decoded here: NumPy accepts code points that do not exist."""
    texts = np.empty(shape, dtype=object)
    for i in range(texts.size):
        text = data[i * width : (i + 1) * width].decode("utf-32-le", "surrogatepass")
        texts.flat[i] = text.rstrip("\0")
    return texts


def _motion(path: Path, arrays: dict[str, npt.NDArray[Any]], character: Character) -> Motion:
    """The motion that the arrays tell of, if it makes sense."""
    identity = arrays["character"].item()
    if identity != character.identity:
        raise fail(
            path,
            f"is a motion of character {identity[:40]!r}, and this one is {character.identity!r}; "
            "import the motion again from the file that it was made from",
        )
    names, ranges = arrays["label_names"], arrays["label_ranges"]
    if len(names) != len(ranges):
        raise fail(path, f"has {len(names)} label names but {len(ranges)} label ranges")
    labels = [Label(n, a, b) for n, (a, b) in zip(names.tolist(), ranges.tolist(), strict=True)]
    try:
        motion = Motion(
            arrays["poses"],
            float(arrays["fps"]),
            arrays["name"].item(),
            arrays["contacts"],
            tuple(labels),
        )
    except MotionError as error:
        raise fail(path, str(error)) from error
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(arrays["poses"][:, 3:].reshape(-1, 4), axis=1)
    wrong = ~(np.abs(lengths - 1.0) <= _UNIT_LENGTH_TOLERANCE)
    if wrong.any():
        frame, quaternion = divmod(int(np.argmax(wrong)), (POSE_SIZE - 3) // 4)
        raise fail(
            path,
            f"quaternions must be of unit length; number {quaternion} of frame {frame} has "
            f"the length {lengths[frame * ((POSE_SIZE - 3) // 4) + quaternion]:g}",
        )
    return motion
