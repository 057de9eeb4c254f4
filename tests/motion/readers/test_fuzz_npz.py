"""Damaged `.npz` files: an error of the product's own or a valid motion, nothing else.

Half of the files are damaged as bytes, like those of the other formats; the archive's checksums
notice most of that. The others are sound archives of damaged members, which no checksum notices.
"""

import io
import random
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.npz import read_npz
from dynresp.support.errors import MotionFileError
from tests.motion.readers.test_fuzz import BYTES_EACH, DAMAGES, SECONDS_EACH, no_longer_than
from tests.motion.samples import smooth_motion

Array = npt.NDArray[Any]

SPECIAL = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-320, 0.0, -0.0, 1e10, 0.5, 2.0)
TYPES = ("<f4", ">f8", "<i8", "|b1", "<c16", "|S5", "<U5", "<M8[s]", "|V3")
# A header takes the first 128 bytes of a member; damage there matters most.
HEADER_BYTES = 128


def special_numbers(array: Array, rng: random.Random) -> Array:
    numbers = np.array(array, dtype=np.float64)
    for _ in range(rng.randint(1, 5)):
        if numbers.size:
            numbers.flat[rng.randrange(numbers.size)] = rng.choice(SPECIAL)
    return numbers


def other_shape(array: Array, rng: random.Random) -> Array:
    shape = [rng.randrange(70) for _ in range(rng.randrange(4))]
    return np.resize(array, shape).astype(array.dtype)


def other_type(array: Array, rng: random.Random) -> Array:
    return np.resize(np.arange(9), array.shape).astype(rng.choice(TYPES))


def random_bits(array: Array, rng: random.Random) -> Array:
    return np.frombuffer(rng.randbytes(array.nbytes), dtype=array.dtype).reshape(array.shape)


def large_integers(array: Array, rng: random.Random) -> Array:
    width = rng.randint(2, 63)
    numbers = [rng.randrange(-(2 ** (width - 1)), 2 ** (width - 1)) for _ in range(array.size)]
    return np.array(numbers, dtype=np.int64).reshape(array.shape)


ARRAY_DAMAGES: tuple[Callable[[Array, random.Random], Array], ...] = (
    special_numbers,
    other_shape,
    other_type,
    random_bits,
    large_integers,
)


def damaged_member(data: bytes, rng: random.Random) -> bytes:
    """A member with a damaged header, or one that holds a damaged array."""
    if rng.random() < 0.4:
        return rng.choice(DAMAGES)(data[:HEADER_BYTES], rng) + data[HEADER_BYTES:]
    array = np.load(io.BytesIO(data), allow_pickle=False)
    change = rng.choice(ARRAY_DAMAGES)
    if array.dtype.kind == "U" and change is special_numbers:
        change = random_bits
    stream = io.BytesIO()
    np.save(stream, change(array, rng), allow_pickle=False)
    return stream.getvalue()


def archived(members: dict[str, bytes], packing: int) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", packing) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def damage(whole: bytes, index: int) -> bytes:
    """Damaged file number `index`: always the same one."""
    rng = random.Random(f"npz {index}")
    if index % 2:
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            whole = rng.choice(DAMAGES)(whole, rng)
        return whole
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    members[name] = damaged_member(members[name], rng)
    return archived(members, rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)))


def check_valid(motion: Motion) -> None:
    assert np.isfinite(motion.poses).all()
    assert np.isfinite(motion.velocities()).all()


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_damaged_files(
    count: int, character: Character, tmp_path: Path, rng: np.random.Generator
) -> None:
    smooth = smooth_motion(rng, 6)
    motion = Motion(smooth.poses, 30.0, "six frames", smooth.contacts, (Label("all", 0, 6),))
    path = tmp_path / "motion.npz"
    write_npz(motion, path, character)
    whole = path.read_bytes()
    refused = 0
    tracemalloc.start()
    try:
        for index in range(count):
            with np.errstate(all="ignore"):
                path.write_bytes(damage(whole, index))
            tracemalloc.reset_peak()
            try:
                with no_longer_than(SECONDS_EACH):
                    check_valid(read_npz(path, character))
            except MotionFileError as error:
                refused += 1
                assert str(path) in str(error), f"file {index}: no path in {error}"  # noqa: PT017
            except Exception as error:
                pytest.fail(f"file {index}: {type(error).__name__}: {error}")
            peak = tracemalloc.get_traced_memory()[1]
            assert peak < BYTES_EACH, f"file {index}: {peak / 2**20:.0f} MiB"
    finally:
        tracemalloc.stop()
    # The damage does damage, and some of it leaves a file that can still be read.
    assert 0.3 * count < refused < count
