"""Damaged `.npz` files: an error of the product's own or a valid motion, and nothing else.

Half of the files are damaged as bytes, which the archive's checksums mostly notice; the others are
whole archives of damaged arrays, which they do not.
"""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dynresp.errors import MotionFileError
from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.npz import read_npz
from tests.motion.samples import smooth_motion

SPECIAL = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-320, 0.0, -0.0, 1e10, 0.5, 2.0])
NOISE = [b"\0", b"nan", b"-1", b"9" * 30, b"(", b"PK\x05\x06", b"\x93NUMPY", b"'", b"\xff" * 8]


def truncate(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data))]


def flip(data: bytes, rng: np.random.Generator) -> bytes:
    out = np.frombuffer(data, dtype=np.uint8).copy()
    where = rng.integers(len(out), size=rng.integers(1, 20))
    out[where] = rng.integers(256, size=len(where))
    return out.tobytes()


def insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = rng.integers(len(data))
    return data[:at] + NOISE[rng.integers(len(NOISE))] + data[at:]


def overwrite(data: bytes, rng: np.random.Generator) -> bytes:
    at, noise = rng.integers(len(data)), NOISE[rng.integers(len(NOISE))]
    return data[:at] + noise + data[at + len(noise) :]


def remove(data: bytes, rng: np.random.Generator) -> bytes:
    start, stop = np.sort(rng.integers(len(data) + 1, size=2))
    return data[:start] + data[stop:]


def double(data: bytes, rng: np.random.Generator) -> bytes:
    start, stop = np.sort(rng.integers(len(data) + 1, size=2))
    return data[:stop] + data[start:]


def damage_directory(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip bytes of the archive's directory, at its end, alone."""
    start = data.index(b"PK\x01\x02")
    return data[:start] + flip(data[start:], rng)


BYTE_DAMAGES: list[Callable[[bytes, np.random.Generator], bytes]] = [
    truncate, flip, insert, overwrite, remove, double, damage_directory
]  # fmt: skip


def special_numbers(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    out = np.array(array, dtype=np.float64).ravel()
    where = rng.integers(max(out.size, 1), size=rng.integers(1, 5))
    out[where % max(out.size, 1)] = rng.choice(SPECIAL, size=len(where))
    return out.reshape(np.shape(array))


def other_shape(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    cut = np.resize(array, rng.integers(0, 70, size=rng.integers(0, 4)))
    return cut.astype(array.dtype)


def other_type(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    kinds = ["<f4", ">f8", "<i8", "|b1", "<c16", "|S5", "<U5", "<M8[s]", "|V3"]
    return np.resize(np.arange(9), array.shape).astype(kinds[rng.integers(len(kinds))])


def random_bits(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.frombuffer(rng.bytes(array.nbytes), dtype=array.dtype).reshape(array.shape)


def large_integers(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.integers(-(2**63), 2**63 - 1, size=array.shape) >> rng.integers(0, 63)


ARRAY_DAMAGES: list[Callable[[np.ndarray, np.random.Generator], np.ndarray]] = [
    special_numbers, other_shape, other_type, random_bits, large_integers
]  # fmt: skip


def damaged_archive(arrays: dict[str, bytes], rng: np.random.Generator) -> bytes:
    """A whole archive, checksums and all, in which one member is damaged."""
    arrays = dict(arrays)
    name = list(arrays)[rng.integers(len(arrays))]
    if rng.random() < 0.4:
        damage = BYTE_DAMAGES[rng.integers(len(BYTE_DAMAGES) - 1)]
        # The header's bytes matter most, and they are few.
        head = arrays[name][:128]
        arrays[name] = damage(head, rng) + arrays[name][128:]
    else:
        array = np.load(io.BytesIO(arrays[name]), allow_pickle=False)
        change = ARRAY_DAMAGES[rng.integers(len(ARRAY_DAMAGES))]
        if array.dtype.kind == "U" and change is special_numbers:
            change = random_bits
        stream = io.BytesIO()
        np.save(stream, change(array, rng), allow_pickle=False)
        arrays[name] = stream.getvalue()
    stream = io.BytesIO()
    packing = zipfile.ZIP_DEFLATED if rng.random() < 0.5 else zipfile.ZIP_STORED
    with zipfile.ZipFile(stream, "w", packing) as archive:
        for member, data in arrays.items():
            archive.writestr(f"{member}.npy", data)
    return stream.getvalue()


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_damaged_files(
    count: int, character: Character, tmp_path: Path, rng: np.random.Generator
) -> None:
    motion = smooth_motion(rng, 6)
    motion = Motion(motion.poses, 30.0, "six frames", motion.contacts, (Label("all", 0, 6),))
    path = tmp_path / "motion.npz"
    write_npz(motion, path, character)
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        arrays = {x.removesuffix(".npy"): archive.read(x) for x in archive.namelist()}
    refused = 0
    with np.errstate(all="ignore"):  # making the damage may overflow
        for k in range(count):
            if k % 2:
                data = BYTE_DAMAGES[k // 2 % len(BYTE_DAMAGES)](whole, rng)
            else:
                data = damaged_archive(arrays, rng)
            path.write_bytes(data)
            with np.errstate(all="warn"):
                try:
                    read = read_npz(path, character)
                except MotionFileError as error:
                    refused += 1
                    if str(path) not in str(error):
                        pytest.fail(f"the file is not named: {error}")
                else:
                    assert np.isfinite(read.poses).all()
                    assert np.isfinite(read.velocities()).all()
    assert refused > 0.7 * count
