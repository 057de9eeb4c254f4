"""Damaged files of every format: an error of the product's own or a valid motion, nothing else.

Another format joins by another entry in FORMATS: its name, seed files and reader.
"""

import os
import random
import signal
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.readers import read_asf_amc, read_bvh, read_deepmimic
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.support.errors import MotionFileError
from tests.motion.readers.samples import (
    ASF_PERSON,
    amc_person,
    bvh_person,
    deepmimic_person,
    write_amc_person,
)

MOTIONS = os.environ.get("DYNRESP_MOTIONS", "")
# A hang, on a machine however busy; how long files take is no matter of tests.
SECONDS_EACH = 120.0
BYTES_EACH = 2**28
# Real clips are damaged as well, one in this many files, since they are larger and slower.
ONE_REAL_IN = 20

Read = Callable[[Path, Path], SkeletonMotion]


@dataclass(frozen=True)
class Format:
    """A format to damage.

    Attributes:
        name: Names the test.
        seeds: Sound files, small.
        real: Sound files below the folder of real motion, read where it is there.
        read: Reads a file; also gets its folder, which `prepare` filled.
        prepare: Puts into that folder what reading needs besides the file.
    """

    name: str
    seeds: tuple[bytes, ...]
    real: tuple[str, ...]
    read: Read
    prepare: Callable[[Path], object] = lambda folder: None


FORMATS = (
    Format(
        "bvh",
        (bvh_person().encode(), bvh_person(frames=2, seed=1).replace("\n", "\r\n").encode()),
        ("snumrl_ys2010/Physics2/wd2_Physics_Raise03.bvh",),
        lambda path, folder: read_bvh(path),
    ),
    Format(
        "amc",
        (amc_person().encode(), amc_person(header=":SAMPLES-PER-SECOND 30").encode()),
        (),
        lambda path, folder: read_asf_amc(path, folder / "person.asf"),
        write_amc_person,
    ),
    Format(
        "asf",
        (ASF_PERSON.encode(), ASF_PERSON.lower().replace("deg", "rad").encode()),
        (),
        lambda path, folder: read_asf_amc(folder / "person_walk.amc", path),
        write_amc_person,
    ),
    Format(
        "deepmimic",
        (deepmimic_person().encode(), deepmimic_person(frames=2).encode()),
        ("deepmimic/humanoid3d_jog.txt",),
        lambda path, folder: read_deepmimic(path),
    ),
)

# Words that are wrong, huge or mean something in one of the formats.
WORDS = (
    *b"nan inf -inf 1e308 -1e308 1e999 1e-320 0 -1 999999999 99999999999999999999 0x10".split(),
    *b"1_0 1,5 - . { } [ ] ( ) : # ' \" \\ null true NaN Infinity \xff\xfe \x00".split(),
    *b"JOINT ROOT OFFSET CHANNELS MOTION Frames: begin end root dof length axis".split(),
    *b"direction :units :hierarchy :bonedata :DEGREES Frames".split(),
    *(b"9" * 5000, b"[" * 20_000, b"{" * 20_000, b"x" * 10_000),
)


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def lose_a_middle(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.randrange(200) :]


def flip_bytes(data: bytes, rng: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.randint(1, 20)):
        if damaged:
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
    return bytes(damaged)


def flip_bits(data: bytes, rng: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if damaged:
            damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def change_a_word(data: bytes, rng: random.Random) -> bytes:
    words = data.split(b" ")
    words[rng.randrange(len(words))] = rng.choice(WORDS)
    return b" ".join(words)


def change_a_number(data: bytes, rng: random.Random) -> bytes:
    places = [at for at, byte in enumerate(data) if 48 <= byte <= 57]
    if not places:
        return data
    at = rng.choice(places)
    digits = rng.choice((b"0", b"-", b"7", b"12345678", b"e9", b"e-9", b".", b"."))
    return data[:at] + digits + data[at + rng.randint(0, 1) :]


def lose_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    for _ in range(rng.randint(1, 3)):
        if lines:
            del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def repeat_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if lines:
        start = rng.randrange(len(lines))
        part = lines[start : start + rng.randint(1, 30)]
        lines[start:start] = part * rng.randint(1, 40)
    return b"".join(lines)


def swap_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if lines:
        a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[a], lines[b] = lines[b], lines[a]
    return b"".join(lines)


def nest(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    opening = rng.choice((b"[", b"{", b'{"a":', b"JOINT a\n{\n", b"begin\n", b"("))
    return data[:at] + opening * rng.choice((10, 2000, 30_000)) + data[at:]


def add_noise(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.randint(1, 300)) + data[at:]


def only_noise(data: bytes, rng: random.Random) -> bytes:
    return rng.randbytes(rng.randint(0, 2000))


DAMAGES = (
    cut,
    lose_a_middle,
    flip_bytes,
    flip_bits,
    change_a_word,
    change_a_number,
    lose_lines,
    repeat_lines,
    swap_lines,
    nest,
    add_noise,
    only_noise,
)


@contextmanager
def no_longer_than(seconds: float) -> Iterator[None]:
    """Break off what hangs; the error names the time."""

    def ring(*_: object) -> None:
        raise TimeoutError(f"took longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def check_valid(motion: SkeletonMotion) -> None:
    """What a reader returns is whole: positions of all joints can be had, and are finite."""
    assert np.all(np.isfinite(motion.joint_positions()))
    assert motion.frames >= 1
    assert motion.fps > 0


def damage(form: Format, index: int) -> bytes:
    """Damaged file number `index` of a format: always the same one."""
    rng = random.Random(f"{form.name} {index}")
    seeds = [seed for seed in form.seeds if seed]
    data = rng.choice(seeds)
    if MOTIONS and form.real and index % ONE_REAL_IN == 0:
        data = Path(MOTIONS, rng.choice(form.real)).read_bytes()
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(DAMAGES)(data, rng)
    return data


def check_damaged_files(form: Format, folder: Path, count: int) -> None:
    """Read `count` damaged files of a format, within bounds of time and memory each."""
    form.prepare(folder)
    path = folder / "damaged"
    refused = 0
    tracemalloc.start()
    try:
        for index in range(count):
            path.write_bytes(damage(form, index))
            tracemalloc.reset_peak()
            start = time.perf_counter()
            try:
                with no_longer_than(SECONDS_EACH):
                    check_valid(form.read(path, folder))
            except MotionFileError as error:
                refused += 1
                # The folder holds whichever file is at fault: an AMC or its skeleton.
                assert str(folder) in str(error), f"file {index}: no path in {error}"  # noqa: PT017
            except Exception as error:
                pytest.fail(f"{form.name} file {index}: {type(error).__name__}: {error}")
            peak = tracemalloc.get_traced_memory()[1]
            assert peak < BYTES_EACH, f"file {index}: {peak / 2**20:.0f} MiB"
            assert time.perf_counter() - start < SECONDS_EACH, f"file {index}"
    finally:
        tracemalloc.stop()
    # The damage does damage, and some of it leaves a file that can still be read.
    assert 0.3 * count < refused < count


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_seeds_are_sound(form: Format, tmp_path: Path) -> None:
    form.prepare(tmp_path)
    for seed in form.seeds:
        path = tmp_path / "sound"
        path.write_bytes(seed)
        check_valid(form.read(path, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_300_damaged_files(form: Format, tmp_path: Path) -> None:
    check_damaged_files(form, tmp_path, 300)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_10000_damaged_files(form: Format, tmp_path: Path) -> None:
    check_damaged_files(form, tmp_path, 10_000)
