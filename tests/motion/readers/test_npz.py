import io
import pickle
import struct
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.npz import FORMAT_VERSION, MAX_FRAMES, MEMBERS, read_npz
from dynresp.support.errors import MotionFileError
from tests.motion.samples import random_poses


@pytest.fixture
def motion(rng: np.random.Generator) -> Motion:
    labels = (
        Label("step forward, small", 3, 9),
        Label("", 0, 1),
        Label("Rückwärtsrolle 後", 5, 20),
    )
    return Motion(random_poses(rng, 20), 29.97, "Käfer.bvh", rng.random((20, 2)) > 0.5, labels)


@pytest.fixture
def file(motion: Motion, character: Character, tmp_path: Path) -> Path:
    path = tmp_path / "motion.npz"
    write_npz(motion, path, character)
    return path


def members(file: Path) -> dict[str, Any]:
    with np.load(file, allow_pickle=False) as archive:
        return dict(archive)


def rewritten(file: Path, **changes: Any) -> Path:
    """The same file with some arrays replaced, or dropped where the change is None."""
    arrays = {k: v for k, v in {**members(file), **changes}.items() if v is not None}
    np.savez(file, **arrays)
    return file


def with_bytes(file: Path, name: str, data: bytes, **info: Any) -> Path:
    """The same file with the bytes of one member replaced."""
    with zipfile.ZipFile(file) as archive:
        old = {x.filename: archive.read(x) for x in archive.infolist()}
    old[f"{name}.npy"] = data
    with zipfile.ZipFile(file, "w", **info) as archive:
        for key, value in old.items():
            archive.writestr(key, value)
    return file


def npy(header: str, data: bytes = b"", version: bytes = b"\x01\x00") -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(text)) + text + data


def assert_same(a: Motion, b: Motion) -> None:
    np.testing.assert_array_equal(a.poses, b.poses)
    np.testing.assert_array_equal(a.contacts, b.contacts)
    assert (a.fps, a.name, a.labels) == (b.fps, b.name, b.labels)


class TestRoundTrip:
    def test_is_exact(self, motion: Motion, file: Path, character: Character) -> None:
        assert_same(read_npz(file), motion)
        assert_same(read_npz(str(file), character), motion)

    @pytest.mark.parametrize("name", ["", "plain", "a\0b", "\ud800", "🦵", "x" * 1000])
    def test_names(self, character: Character, tmp_path: Path, name: str) -> None:
        motion = Motion(character.rest_pose[None], 1e-3, name, labels=(Label(name, 0, 1),))
        write_npz(motion, tmp_path / "a.npz", character)
        assert_same(read_npz(tmp_path / "a.npz"), motion)

    def test_without_labels(self, character: Character, tmp_path: Path) -> None:
        motion = Motion(character.rest_pose[None], 30.0)
        write_npz(motion, tmp_path / "a.npz", character)
        assert_same(read_npz(tmp_path / "a.npz"), motion)

    def test_a_part_of_a_motion(self, motion: Motion, character: Character, tmp_path: Path) -> None:
        write_npz(motion.slice(3, 17), tmp_path / "a.npz", character)
        assert_same(read_npz(tmp_path / "a.npz"), motion.slice(3, 17))

    def test_same_motion_same_bytes(
        self, motion: Motion, file: Path, character: Character, tmp_path: Path
    ) -> None:
        write_npz(motion, tmp_path / "again.npz", character)
        assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()
        write_npz(read_npz(file), tmp_path / "copy.npz", character)
        assert (tmp_path / "copy.npz").read_bytes() == file.read_bytes()

    def test_numpy_reads_it(self, motion: Motion, file: Path, character: Character) -> None:
        arrays = members(file)
        assert arrays.keys() == MEMBERS.keys()
        assert arrays["format_version"] == FORMAT_VERSION
        assert arrays["character"] == character.identity
        assert arrays["name"] == motion.name
        np.testing.assert_array_equal(arrays["poses"], motion.poses)

    def test_packed_by_numpy(self, motion: Motion, file: Path) -> None:
        np.savez_compressed(file, **members(file))
        assert_same(read_npz(file), motion)


class TestRefusals:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"format_version": 2}, "format version 2.*reads version 1"),
            ({"format_version": None}, "is no motion file of dynresp"),
            ({"format_version": 1.0}, "format_version must be of type <i8, not <f8"),
            ({"character": "0123456789abcdef"}, "is a motion of character '0123456789abcdef'"),
            ({"character": 5}, "character must be text"),
            ({"name": None}, "must hold"),
            ({"extra": 1}, "must hold .*unknown: extra"),
            ({"name": "x" * 1001}, "at most 1000 characters"),
            ({"name": ["a", "b"]}, r"name must have the shape \(\), not \(2,\)"),
            ({"fps": np.nan}, "frame rate"),
            ({"fps": -1.0}, "frame rate"),
            ({"fps": [30.0]}, "fps must have the shape"),
            ({"poses": np.zeros((20, 58))}, r"shape \(up to 250000, 59\), not \(20, 58\)"),
            ({"poses": np.zeros((0, 59))}, "no frame"),
            ({"poses": np.zeros((20, 59))}, "must be of unit length; number 0 of frame 0"),
            ({"poses": np.full((20, 59), np.nan)}, "not finite"),
            ({"poses": np.full((20, 59), 1e300)}, "of the origin"),
            ({"poses": np.zeros((20, 59), dtype=np.float32)}, "type <f8, not <f4"),
            ({"poses": np.asfortranarray(np.zeros((20, 59)))}, "header that is not understood"),
            ({"poses": np.zeros((20, 59), dtype=">f8")}, "header that is not understood"),
            ({"contacts": np.zeros((19, 2), dtype=bool)}, r"contacts must be \(20, 2\)"),
            ({"contacts": np.zeros((20, 2))}, r"type \|b1"),
            ({"label_names": np.array([], dtype="<U1")}, "0 label names but 3 label ranges"),
            ({"label_ranges": np.full((3, 2), 10**18)}, "spans frames 10"),
            ({"label_ranges": np.zeros((10_001, 2), dtype=int)}, "up to 10000"),
        ],
    )
    def test_wrong_arrays(self, file: Path, changes: dict[str, Any], message: str) -> None:
        with pytest.raises(MotionFileError, match=message):
            read_npz(rewritten(file, **changes))

    def test_quaternions_of_any_wrong_length(self, file: Path) -> None:
        for size in (0.0, 0.5, 1.001, 1e200):
            poses = members(file)["poses"]
            poses[7, 11:15] *= size
            with pytest.raises(MotionFileError, match="number 2 of frame 7"):
                read_npz(rewritten(file, poses=poses))

    def test_nothing_is_unpickled(self, file: Path) -> None:
        class Trap:
            def __reduce__(self) -> tuple[Any, ...]:
                return (pytest.fail, ("unpickled",))

        stream = io.BytesIO()
        np.lib.format.write_array(stream, np.array([Trap()], dtype=object), allow_pickle=True)
        for data in (stream.getvalue(), pickle.dumps(Trap())):
            with pytest.raises(MotionFileError, match="name"):
                read_npz(with_bytes(file, "name", data))

    @pytest.mark.parametrize(
        "header",
        [
            "{'descr': '<f8', 'fortran_order': False, 'shape': (1.5, 59), }",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 59), }",
            "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1, 59), }",
            "{'descr': '<f8', 'shape': (1, 59), }",
            "__import__('os').abort()",
            "[" * 5000,
            "\\x",
            "",
        ],
    )
    def test_headers_that_are_not_as_numpy_writes_them(self, file: Path, header: str) -> None:
        with pytest.raises(MotionFileError, match="poses has a header"):
            read_npz(with_bytes(file, "poses", npy(header)))

    def test_other_npy_versions(self, file: Path) -> None:
        with pytest.raises(MotionFileError, match=r"version 1\.0"):
            read_npz(with_bytes(file, "poses", npy("{}", version=b"\x02\x00")))

    def test_sizes_that_disagree_with_the_header(self, file: Path) -> None:
        header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 59), }"
        for size in (0, 59 * 8, 2 * 59 * 8 - 1, 2 * 59 * 8 + 1):
            with pytest.raises(MotionFileError, match=r"is not what \(2, 59\) needs"):
                read_npz(with_bytes(file, "poses", npy(header, bytes(size))))

    def test_text_that_is_none(self, file: Path) -> None:
        header = "{'descr': '<U1', 'fortran_order': False, 'shape': (), }"
        with pytest.raises(MotionFileError, match="is damaged"):
            read_npz(with_bytes(file, "name", npy(header, b"\xff\xff\xff\xff")))

    def test_contacts_that_are_neither_yes_nor_no(self, file: Path) -> None:
        header = "{'descr': '|b1', 'fortran_order': False, 'shape': (20, 2), }"
        with pytest.raises(MotionFileError, match="0 or 1 everywhere"):
            read_npz(with_bytes(file, "contacts", npy(header, b"\x07" * 40)))

    def test_members_twice(self, file: Path) -> None:
        with zipfile.ZipFile(file, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("poses.npy", b"")
        with pytest.raises(MotionFileError, match="each once"):
            read_npz(file)

    @pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    def test_other_packing(self, file: Path, method: int) -> None:
        with pytest.raises(MotionFileError, match="packed by a method"):
            read_npz(with_bytes(file, "name", b"", compression=method))

    def test_damaged_bytes_fail_the_checksum(self, file: Path) -> None:
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
        with pytest.raises(MotionFileError, match="CRC"):
            read_npz(file)

    def test_no_npz_files(self, tmp_path: Path) -> None:
        file = tmp_path / "a.npz"
        for data, message in (
            (b"", "has 0 bytes"),
            (b"hello", "has 5 bytes"),
            (b"HIERARCHY\nROOT Hips\n{\n" * 10, "a zip archive's end is missing"),
        ):
            file.write_bytes(data)
            with pytest.raises(MotionFileError, match=message):
                read_npz(file)
        with pytest.raises(MotionFileError, match="is a folder"):
            read_npz(tmp_path)
        with pytest.raises(MotionFileError, match="no such file"):
            read_npz(tmp_path / "b.npz")
        with pytest.raises(MotionFileError, match=r"no such file|damaged"):
            read_npz("a\0b.npz")


class TestBounds:
    """Small files that claim to be large take no memory."""

    def peak(self, file: Path, message: str) -> int:
        tracemalloc.start()
        try:
            with pytest.raises(MotionFileError, match=message):
                read_npz(file)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    def test_more_frames_than_are_read(self, file: Path) -> None:
        header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({MAX_FRAMES + 1}, 59), }}"
        data = npy(header, bytes((MAX_FRAMES + 1) * 59 * 8))
        bomb = with_bytes(file, "poses", data, compression=zipfile.ZIP_DEFLATED)
        assert bomb.stat().st_size < 2**20
        del data
        assert self.peak(bomb, "shape") < 2**20

    def test_a_bomb_of_zeros(self, file: Path) -> None:
        header = "{'descr': '<f8', 'fortran_order': False, 'shape': (20, 59), }"
        data = npy(header, bytes(2**26))
        bomb = with_bytes(file, "poses", data, compression=zipfile.ZIP_DEFLATED)
        del data
        assert self.peak(bomb, "is not what") < 2**20

    @pytest.mark.parametrize(
        ("stated", "message"), [(2**26, "which is not what"), (2**31, "unpacks to 2048.0 MiB")]
    )
    def test_wrong_sizes_in_the_directory(self, file: Path, stated: int, message: str) -> None:
        # The directory says 64 MiB or 2 GiB; the member has a few bytes.
        data = bytearray(file.read_bytes())
        entry = data.rindex(b"PK\x01\x02", 0, data.rindex(b"poses.npy"))
        data[entry + 24 : entry + 28] = struct.pack("<L", stated)
        file.write_bytes(data)
        assert self.peak(file, message) < 2**20

    def test_an_archive_of_very_many_files(self, file: Path) -> None:
        with zipfile.ZipFile(file, "a") as archive:
            for k in range(2000):
                archive.writestr(f"{k}.npy", b"")
        assert self.peak(file, "far more than a motion") < 2**20
