"""The front door, the bounds that all readers share, and every clip of the manifest."""

import csv
import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.readers import read_motion_file, text
from dynresp.motion.readers.text import rate_of_frame_time
from dynresp.motion.readers.world import UNITS
from dynresp.support.errors import MotionFileError
from tests.motion.readers.samples import (
    ASF_PERSON,
    BVH_PERSON,
    bvh_person,
    deepmimic_person,
    write_amc_person,
)

MOTIONS = os.environ.get("DYNRESP_MOTIONS", "")


class TestFrontDoor:
    def test_reads_every_format_by_suffix(self, tmp_path: Path) -> None:
        pair = write_amc_person(tmp_path)
        (tmp_path / "a.BVH").write_text(bvh_person())
        (tmp_path / "a.json").write_text(deepmimic_person())
        (tmp_path / "a.txt").write_text(deepmimic_person())
        for path in (pair.amc, tmp_path / "a.BVH", tmp_path / "a.json", tmp_path / "a.txt"):
            motion = read_motion_file(path)
            assert motion.frames == 4
            assert motion.name == path.stem
            assert read_motion_file(str(path), fps=50).fps == 50.0

    @pytest.mark.parametrize(
        ("name", "options", "message"),
        [
            ("a.fbx", {}, r"suffix '.fbx'; known are \.bvh, \.amc, \.json, \.txt"),
            ("a", {}, "suffix ''; known are"),
            ("a.asf", {}, "a skeleton without motion"),
            ("a.bvh", {"asf_path": "b.asf"}, "only an AMC file takes an ASF skeleton"),
            ("a.txt", {"unit": 0.01}, "leave out unit and up"),
            ("a.bvh", {"unit": 0.0}, "unit must be a positive number, not 0.0"),
            ("a.bvh", {"fps": float("nan")}, "fps must be a positive number, not nan"),
            ("a.bvh", {"up": "-y"}, "up must be one of x, y, z, not '-y'"),
            ("a.bvh", {}, "no such file"),
            ("a\x00.bvh", {}, "expected a motion file|cannot be read"),
            (".", {}, "suffix ''"),
        ],
    )
    def test_refuses(
        self, tmp_path: Path, name: str, options: dict[str, object], message: str
    ) -> None:
        with pytest.raises(MotionFileError, match=message):
            read_motion_file(tmp_path / name, **options)  # type: ignore[arg-type]

    def test_folders_and_empty_files(self, tmp_path: Path) -> None:
        (tmp_path / "folder.bvh").mkdir()
        with pytest.raises(MotionFileError, match="is a folder; expected a motion file"):
            read_motion_file(tmp_path / "folder.bvh")
        (tmp_path / "empty.bvh").write_text(" \n")
        with pytest.raises(MotionFileError, match="is empty"):
            read_motion_file(tmp_path / "empty.bvh")

    def test_files_above_the_limit(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bvh"
        path.write_text(bvh_person())
        size = path.stat().st_size
        assert len(text.read_bounded(path, size)) == size
        with pytest.raises(MotionFileError, match="the largest motion file read"):
            text.read_bounded(path, size - 1)


@pytest.mark.parametrize(
    ("written", "rate"),
    [
        ("0.0333333", 30.0),
        ("0.03333", 30.0),
        ("0.033", 30.0),
        ("3.33333e-002", 30.0),
        ("0.0333667", 30000 / 1001),
        ("0.00833333", 120.0),
        ("0.008333", 120.0),
        ("0.0083", 120.0),
        ("0.0166667", 60.0),
        ("0.016666", 60.0),
        ("0.017", 60.0),
        ("0.01", 100.0),
        ("0.04", 25.0),
        ("0.0625", 16.0),
        ("0.041667", 24.0),
        ("1", 1.0),
        ("0.0285714", 1 / 0.0285714),
        ("1e-9", 1e9),
    ],
)
def test_frame_rates_as_they_are_written(written: str, rate: float) -> None:
    assert rate_of_frame_time(written) == pytest.approx(rate, rel=1e-12)


class TestUnit:
    @pytest.mark.parametrize("unit", UNITS)
    @pytest.mark.parametrize("stature", [0.85, 1.0, 1.15])
    def test_is_found_by_size(self, tmp_path: Path, unit: float, stature: float) -> None:
        path = tmp_path / "a.bvh"
        path.write_text(scaled(bvh_person(), 0.01 / unit * stature))
        motion = read_motion_file(path)
        np.testing.assert_allclose(
            np.linalg.norm(motion.offsets[motion.names.index("LeftFoot")]), 0.42 * stature
        )

    @pytest.mark.parametrize("scale", [0.0, 1e-4, 1e-3, 300.0])
    def test_of_no_person_must_be_told(self, tmp_path: Path, scale: float) -> None:
        path = tmp_path / "a.bvh"
        path.write_text(scaled(bvh_person(), scale))
        with pytest.raises(MotionFileError, match="the unit is not clear"):
            read_motion_file(path)
        assert read_motion_file(path, unit=1e-3).frames == 4


def scaled(bvh: str, scale: float) -> str:
    """The BVH with its offsets in another unit."""
    lines = []
    for line in bvh.splitlines():
        word, *rest = line.split() or [""]
        if word == "OFFSET":
            line = " ".join([word, *(repr(float(number) * scale) for number in rest)])
        lines.append(line)
    return "\n".join(lines)


class TestUpAxis:
    @pytest.mark.parametrize("names", ["as they are", "unknown"])
    def test_z_is_found(self, tmp_path: Path, names: str) -> None:
        """A file whose skeleton rests with Y up and whose root turns it to stand along Z."""
        text = BVH_PERSON
        if names == "unknown":
            for index, word in enumerate(("LeftFoot", "RightFoot", "Head")):
                text = text.replace(f"JOINT {word}\n", f"JOINT joint{index}\n")
        row = " ".join(["0", "0", "95", "0", "90", "0", *["0"] * 30])
        path = tmp_path / "a.bvh"
        path.write_text(f"{text}Frames: 2\nFrame Time: 0.01\n{row}\n{row}\n")
        motion = read_motion_file(path)
        at = dict(zip(motion.names, motion.joint_positions()[0], strict=True))
        assert at["Hips"][2] == pytest.approx(0.95)
        assert at["Spine"][2] == pytest.approx(1.07)

    def test_of_someone_who_lies_is_that_of_the_rest_pose(self, tmp_path: Path) -> None:
        row = " ".join(["0", "10", "0", "0", "90", "0", *["0"] * 30])
        path = tmp_path / "a.bvh"
        path.write_text(
            f"{BVH_PERSON}Frames: 4\nFrame Time: 0.01\n"
            + f"{row}\n{row.replace('90', '-90')}\n" * 2
        )
        assert read_motion_file(path).root_positions[0, 2] == pytest.approx(0.1)

    def test_each_keeps_left_on_the_left(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bvh"
        path.write_text(bvh_person())
        for up in "xyz":
            offsets = read_motion_file(path, up=up).offsets
            first, second, third = offsets[[1, 2, 4]]
            assert np.linalg.det([first, second, third]) == pytest.approx(
                np.linalg.det(read_motion_file(path, up="z").offsets[[1, 2, 4]])
            )


class TestMemory:
    """Files made to take memory: refused or read in less than 1 GiB."""

    @staticmethod
    def peak(path: Path, **options: float) -> tuple[bool, float]:
        """Whether the file could be read, and the peak of memory [bytes] while it was."""
        tracemalloc.start()
        try:
            read_motion_file(path, **options)  # type: ignore[arg-type]
            return True, tracemalloc.get_traced_memory()[1]
        except MotionFileError:
            return False, tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    @pytest.mark.slow
    def test_largest_bvh(self, tmp_path: Path) -> None:
        joints, frames = 1000, 3000
        six = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        path = tmp_path / "a.bvh"
        path.write_text(
            "HIERARCHY\n"
            + "".join(
                f"{'JOINT' if index else 'ROOT'} j{index}\n{{\nOFFSET 0 1 0\nCHANNELS 6 {six}\n"
                for index in range(joints)
            )
            + "}\n" * joints
            + f"MOTION\nFrames: {frames}\nFrame Time: 0.01\n"
            + "0 " * (6 * joints * frames)
        )
        read, peak = self.peak(path, unit=0.01)
        assert read
        assert peak < 2**30

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("name", "start", "filling", "size"),
        [
            ("a.bvh", "", "0 ", text.MAX_FILE_BYTES),
            ("a.bvh", f"{BVH_PERSON}Frames: 180000\nFrame Time: 0.01\n", "0 ", 100 * 2**20),
            ("a.bvh", f"{BVH_PERSON}Frames: 180000\nFrame Time: 0.01\n", "0", 100 * 2**20),
            ("a.bvh", "HIERARCHY\n", "{", 100 * 2**20),
            ("a.amc", "", "1\n", text.MAX_FILE_BYTES),
            ("a.amc", "", "\n", text.MAX_FILE_BYTES),
            ("a.amc", "1\nroot ", "0 ", text.MAX_FILE_BYTES),
            ("a.txt", "", "[],", 16 * 2**20),
            ("a.txt", "[", "[],", 16 * 2**20),
            ("a.txt", "[", "{},", 16 * 2**20),
            ("a.txt", '{"Frames": [[', "1.5,", 16 * 2**20),
        ],
    )
    def test_large_files(
        self, tmp_path: Path, name: str, start: str, filling: str, size: int
    ) -> None:
        (tmp_path / "a.asf").write_text(ASF_PERSON)
        path = tmp_path / name
        path.write_text(start + filling * ((size - len(start)) // len(filling)))
        assert self.peak(path)[1] < 2**30


def manifest() -> list[dict[str, str]]:
    if not MOTIONS:
        return []
    with Path(MOTIONS, "MANIFEST.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
@pytest.mark.mocap
@pytest.mark.skipif(not MOTIONS, reason="DYNRESP_MOTIONS names no folder of motion capture")
def test_every_clip_of_the_manifest() -> None:
    """Frames, rate, unit and up axis are found as the manifest states them, with nothing given."""
    wrong = []
    for row in manifest():
        motion = read_motion_file(Path(MOTIONS, row["file"]))
        # In one clip a frame lasts twice as long as the others: it is evened out.
        frames = int(row["frames"]) + (row["clip_id"] == "humanoid3d_roll")
        if motion.frames != frames or abs(motion.fps / float(row["fps"]) - 1.0) > 1e-4:
            wrong.append(f"{row['file']}: {motion.frames} frames at {motion.fps:g}")
        # The root's height range says unit and up axis at once.
        height = motion.root_positions[:, 2]
        for found, column in ((height.min(), "root_h_min_m"), (height.max(), "root_h_max_m")):
            if row[column] and abs(found - float(row[column])) > 0.002:
                wrong.append(f"{row['file']}: {column} {found:.3f}, not {row[column]}")
        # (No floor_m stands for the CMU playground, whose ground is not at height 0.)
        if row["floor_m"] and abs(motion.joint_positions()[..., 2].min()) > 0.3:
            wrong.append(f"{row['file']}: the ground is not at height 0")
    assert not wrong
