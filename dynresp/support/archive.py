"""Archives of plain arrays (`.npz`): written whole, and read with bounds.

An archive (zip, members stored or deflated) holds exactly the `.npy` members that its format names
and can be read with `numpy.load(path, allow_pickle=False)`. Numbers are little-endian, text is
fixed-width UCS-4 (NumPy's ``<U``), and nothing is pickled.
"""

from __future__ import annotations

import math
import os
import re
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from dynresp.support.errors import UsageError
from dynresp.support.files import replacing
from dynresp.support.inputs import open_input

Arrays: TypeAlias = dict[str, npt.NDArray[Any]]

TEXT = "<U"
"""The type of a member that holds text of any width."""

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
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
# More than the headers of a member take in a file.
_MEMBER_BYTES = 512


@dataclass(frozen=True)
class ArchiveFormat:
    """What an archive of one kind holds.

    Attributes:
        what: What it is, such as "motion"; its file is a "motion file".
        error: Raised, with "PATH: " before its message, for a file that cannot be read.
        version: Number that its member `format_version` has; others are refused.
        members: Type and shape of each member, `format_version` among them. A type is NumPy's or
            `TEXT`; a name in a shape stands for a length that the file chooses.
        most: The largest length that each such name stands for.
        max_text: Most characters of a text.
        max_bytes: Most bytes of a file, and of all that it unpacks to.
    """

    what: str
    error: type[UsageError]
    version: int
    members: Mapping[str, tuple[str, tuple[int | str, ...]]]
    most: Mapping[str, int]
    max_text: int
    max_bytes: int

    def read(self, path: Path) -> Arrays:
        """Read all members.

        Whatever the file says, little more memory is taken than `max_bytes`: sizes are checked
        before anything is unpacked, and no object is unpickled.

        Args:
            path: The file.

        Returns:
            Arrays by name, each of a type and shape that the format allows; text as Python strings.
            The caller checks that lengths of one name agree between members.

        Raises:
            UsageError: As `error` says: it cannot be opened, is damaged or out of bounds, is of
                another kind, or of another version.
        """
        try:
            if not path.is_file():
                what = "is a folder" if path.is_dir() else "no such file"
                self.fail(path, f"{what}; expected a .npz {self.what} file")
            with open_input(path) as file:
                self._check_archive(path, file)
                with zipfile.ZipFile(file) as archive:
                    return self._arrays(path, archive)
        except self.error:
            raise
        # On damaged files zipfile and zlib raise a dozen kinds of errors, few of them documented.
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            self.fail(path, f"is damaged or not an .npz file ({reason})")

    def write(self, path: str | Path, arrays: Arrays) -> None:
        """Write a file; the same arrays give the same bytes.

        Args:
            path: The file; missing folders are made, an old file is replaced.
            arrays: One for each member but `format_version`; text as arrays of NumPy's text.

        Raises:
            UsageError: As `error` says: an array is not what the format allows, or the file would
                be too large to be read.
            DynrespError: The file cannot be written.
        """
        whole = {"format_version": np.array(self.version, dtype="<i8"), **arrays}
        for name, array in whole.items():
            problem = self.problem(name, array.dtype.str, array.shape)
            if problem:
                self.fail(Path(path), problem)
        if sum(array.nbytes + _MEMBER_BYTES for array in whole.values()) > self.max_bytes:
            self._fail_as_too_large(Path(path))
        with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
            for name, array in whole.items():
                # Stored, since packed bytes depend on the zlib at hand.
                info = zipfile.ZipInfo(f"{name}.npy", date_time=_ZIP_TIME)
                info.create_system = 3
                with archive.open(info, "w") as member:
                    np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)

    def fail(self, path: Path, message: str) -> NoReturn:
        """Raise the format's error: which file, and what is wrong with it."""
        raise self.error(f"{path}: {message}")

    def problem(self, name: str, type_code: str, shape: tuple[int, ...]) -> str | None:
        """What is wrong with the type or shape of a member, or None.

        Args:
            name: A key of `members`.
            type_code: NumPy's, such as "<f8" or "<U12".
            shape: Its shape.
        """
        wanted_type, wanted_shape = self.members[name]
        if wanted_type == TEXT:
            width = type_code.removeprefix(TEXT)
            if not (type_code.startswith(TEXT) and width.isdigit()):
                return f"{name} must be text, not {type_code}"
            if int(width) > self.max_text:
                return f"{name} must have at most {self.max_text} characters, not {width}"
        elif type_code != wanted_type:
            return f"{name} must be of type {wanted_type}, not {type_code}"
        fits = len(shape) == len(wanted_shape) and all(
            given <= self.most[wanted] if isinstance(wanted, str) else given == wanted
            for given, wanted in zip(shape, wanted_shape, strict=True)
        )
        if not fits:
            allowed = ", ".join(
                f"up to {self.most[x]}" if isinstance(x, str) else f"{x}" for x in wanted_shape
            )
            return f"{name} must have the shape ({allowed}), not {shape}"
        return None

    def _fail_as_too_large(self, path: Path) -> NoReturn:
        self.fail(path, f"is larger than {self.max_bytes / 2**20:g} MiB; cut the {self.what}")

    def _check_archive(self, path: Path, file: BinaryIO) -> None:
        """Refuse a file that is no small zip archive, before zipfile reads its directory."""
        size = file.seek(0, os.SEEK_END)
        if size > self.max_bytes:
            self._fail_as_too_large(path)
        file.seek(-min(size, _ZIP_END.size + _ZIP64_BYTES), os.SEEK_END)
        tail = file.read()
        if len(tail) < _ZIP_END.size:
            self.fail(path, f"has {size} bytes, too few for an .npz file")
        signature, *_, directory_bytes, _, comment = _ZIP_END.unpack(tail[-_ZIP_END.size :])
        if signature != b"PK\x05\x06" or comment:
            self.fail(path, "is no .npz file, or was cut short: a zip archive's end is missing")
        if directory_bytes > _MAX_DIRECTORY_BYTES or tail.startswith(b"PK\x06\x07"):
            self.fail(path, f"is an archive of far more than a {self.what}")

    def _arrays(self, path: Path, archive: zipfile.ZipFile) -> Arrays:
        """All members, checked one by one."""
        unpacked = sum(info.file_size for info in archive.infolist())
        if unpacked > self.max_bytes:
            self.fail(
                path,
                f"unpacks to {unpacked / 2**20:.1f} MiB, where a {self.what} file has at most "
                f"{self.max_bytes / 2**20:g} MiB; cut the {self.what}",
            )
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if "format_version" not in members:
            self.fail(
                path,
                f"is no {self.what} file of dynresp; it has no format_version but {_list(members)}",
            )
        version = int(self._array(path, archive, members["format_version"], "format_version"))
        if version != self.version:
            self.fail(
                path,
                f"has format version {version}, and this dynresp reads version {self.version}; "
                "use the dynresp that wrote it, or a newer one",
            )
        if members.keys() != self.members.keys() or len(members) != len(archive.infolist()):
            missing = {name: None for name in self.members if name not in members}
            more = {name: None for name in members if name not in self.members}
            self.fail(
                path,
                f"is no {self.what} file, or is damaged: it must hold {len(self.members)} members, "
                f"each once; missing: {_list(missing)}; unknown: {_list(more)}",
            )
        return {name: self._array(path, archive, members[name], name) for name in self.members}

    def _array(
        self, path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str
    ) -> npt.NDArray[Any]:
        """One member, unpacked only after its type, shape and size are known to be right."""
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.fail(path, f"{name} is packed by a method that .npz files do not use")
        with archive.open(info) as member:
            start = member.read(len(_NPY_MAGIC) + 2)
            if start[:-2] != _NPY_MAGIC:
                self.fail(path, f"{name} is no .npy array of version 1.0")
            header = member.read(int.from_bytes(start[-2:], "little"))
            found = _NPY_HEADER.fullmatch(header)
            if found is None:
                self.fail(path, f"{name} has a header that is not understood: {header[:100]!r}")
            type_code = (found[1] + found[2]).decode()
            shape = tuple(int(n) for n in found[3].replace(b",", b" ").split())
            problem = self.problem(name, type_code, shape)
            if problem:
                self.fail(path, problem)
            dtype = np.dtype(type_code)
            size = math.prod(shape) * dtype.itemsize
            if info.file_size != len(start) + len(header) + size:
                self.fail(
                    path, f"{name} has {info.file_size} bytes, which is not what {shape} needs"
                )
            # Reading to the end also has the checksum compared.
            data = member.read(size)
            if len(data) != size or member.read(1):
                self.fail(path, f"{name} is cut short")
        if dtype.kind == "U":
            return _texts(data, dtype.itemsize, shape)
        if dtype.kind == "b" and size and max(data) > 1:
            self.fail(path, f"{name} must be 0 or 1 everywhere")
        return np.frombuffer(data, dtype=dtype).reshape(shape)


def text_array(texts: str | list[str]) -> npt.NDArray[np.str_]:
    """Text as a member of an archive."""
    return np.array(texts, dtype=TEXT)


def _list(names: Mapping[str, Any]) -> str:
    shown = ", ".join(sorted(names)[:12]) or "nothing"
    return shown if len(shown) <= 200 else f"{shown[:200]}..."


def _texts(data: bytes, width: int, shape: tuple[int, ...]) -> npt.NDArray[np.object_]:
    """Strings of `width` bytes each. Decoded here: NumPy accepts code points that do not exist."""
    texts = np.empty(shape, dtype=object)
    for i in range(texts.size):
        text = data[i * width : (i + 1) * width].decode("utf-32-le", "surrogatepass")
        texts.flat[i] = text.rstrip("\0")
    return texts
