import os
import sys
from pathlib import Path

import numpy as np
import pybvh
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.motion.readers import read_bvh
from dynresp.motion.rotations import about_axis, multiply
from dynresp.support.errors import MotionFileError
from tests.motion.readers.samples import BVH_PERSON, BVH_PERSON_COLUMNS, bvh_person

MOTIONS = os.environ.get("DYNRESP_MOTIONS", "")
ORDERS = ("ZXY", "XYZ", "YXZ", "ZYX", "XZY", "YZX")


def write(folder: Path, text: str) -> Path:
    path = folder / "clip.bvh"
    path.write_bytes(text.encode())
    return path


def chain(*joints: str, rows: str, frame_time: str = "0.01") -> str:
    """A BVH of joints in one line, each given as "name | offset | channels"."""
    text = "HIERARCHY\n"
    for index, joint in enumerate(joints):
        name, offset, channels = (part.strip() for part in joint.split("|"))
        text += f"{'JOINT' if index else 'ROOT'} {name}\n{{\nOFFSET {offset}\n"
        text += f"CHANNELS {len(channels.split())} {channels}\n"
    text += "End Site\n{\nOFFSET 0 1 0\n}\n" + "}\n" * len(joints)
    frames = len(rows.strip().splitlines())
    return text + f"MOTION\nFrames: {frames}\nFrame Time: {frame_time}\n{rows}"


def assert_equals_pybvh(path: Path, atol: float) -> None:
    """Joint positions against an independent reader, in the file's own unit and axes."""
    motion = read_bvh(path, unit=1.0 / 128, up="z")
    other = pybvh.read_bvh_file(path)
    # It takes nodes in the file's order, as we do; end sites are nodes there and joints here.
    expected = other.node_positions()
    assert expected.shape == (motion.frames, len(motion.names), 3)
    np.testing.assert_allclose(motion.joint_positions() * 128, expected, rtol=0, atol=atol)


class TestAgainstAnotherReader:
    def test_person(self, tmp_path: Path) -> None:
        assert_equals_pybvh(write(tmp_path, bvh_person(frames=7, seed=1)), atol=1e-9)

    @settings(max_examples=60, deadline=None)
    @given(data=st.data())
    def test_any_tree_and_channel_order(
        self, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        number = st.floats(-180, 180, allow_nan=False).map(lambda value: round(value, 4))
        lines, columns = ["HIERARCHY"], 0

        def joint(depth: int, keyword: str, name: str) -> None:
            nonlocal columns
            order = data.draw(st.sampled_from(ORDERS))
            channels = [f"{axis}rotation" for axis in order]
            if depth == 0:
                channels = ["Xposition", "Yposition", "Zposition", *channels]
            columns += len(channels)
            offset = " ".join(str(data.draw(number)) for _ in range(3))
            lines.extend([f"{keyword} {name}", "{", f"OFFSET {offset}"])
            lines.append(f"CHANNELS {len(channels)} {' '.join(channels)}")
            children = data.draw(st.integers(1 if depth == 0 else 0, 2 if depth < 3 else 0))
            for child in range(children):
                joint(depth + 1, "JOINT", f"{name}_{child}")
            if not children:
                lines.extend(["End Site", "{", "OFFSET 1 2 3", "}"])
            lines.append("}")

        joint(0, "ROOT", "hips")
        frames = data.draw(st.integers(1, 3))
        lines.extend(["MOTION", f"Frames: {frames}", "Frame Time: 0.02"])
        for _ in range(frames):
            lines.append(" ".join(str(data.draw(number)) for _ in range(columns)))
        folder = tmp_path_factory.mktemp("bvh")
        assert_equals_pybvh(write(folder, "\n".join(lines) + "\n"), atol=1e-8)

    @pytest.mark.mocap
    @pytest.mark.skipif(not MOTIONS, reason="DYNRESP_MOTIONS names no folder of motion capture")
    @pytest.mark.parametrize(
        "clip",
        [
            "snumrl_ys2010/Physics2/wd2_Physics_2_Push03.bvh",
            "snumrl_ys2010/VideoMotion/wd2_idle_65.bvh",
            "snumrl_TimeCriticalResponse/s_018_1_1.bvh",
            "snumrl_DataDrivenBipedController/woddy2_walk_normal_right_135.bvh",
        ],
    )
    def test_real_clips(self, clip: str) -> None:
        assert_equals_pybvh(Path(MOTIONS, clip), atol=1e-7)


def test_unit_up_axis_rate_and_facing_are_found(tmp_path: Path) -> None:
    motion = read_bvh(write(tmp_path, bvh_person()))
    assert motion.fps == 30.0
    assert motion.name == "clip"
    rest = dict(zip(motion.names, motion.rest_positions(), strict=True))
    np.testing.assert_allclose(rest["LeftArm_end"], [0.0, 0.73, 0.47])  # its left is +Y
    np.testing.assert_allclose(rest["LeftFoot_end"], [0.16, 0.09, -0.97])  # it faces +X
    # The position channels are absolute: the root's OFFSET of 95 cm is not added.
    assert motion.root_positions[:, 2] == pytest.approx(0.95, abs=0.15)


def test_told_values_win(tmp_path: Path) -> None:
    motion = read_bvh(write(tmp_path, bvh_person()), unit=0.02, up="z", fps=55)
    assert motion.fps == 55.0
    assert motion.root_positions[0, 1] == pytest.approx(1.9, abs=0.3)


def test_rotation_is_the_product_of_the_channels_in_order(tmp_path: Path) -> None:
    text = chain("a | 0 0 0 | Yrotation Zrotation Xrotation", rows="10 20 30\n")
    motion = read_bvh(write(tmp_path, text), unit=1.0, up="z")
    y, z, x = (
        about_axis(axis, np.radians(angle))
        for axis, angle in (((0, 1, 0), 10), ((0, 0, 1), 20), ((1, 0, 0), 30))
    )
    np.testing.assert_allclose(motion.rotations[0, 0], multiply(multiply(y, z), x), atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    order=st.permutations(["Xposition", "Yposition", "Zposition"] + [f"{a}rotation" for a in "XYZ"])
)
def test_positions_may_stand_anywhere_among_the_channels(
    order: list[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    values = {"Xposition": 1, "Yposition": 2, "Zposition": 3}
    row = " ".join(str(values.get(channel, 0)) for channel in order)
    text = chain(f"a | 7 8 9 | {' '.join(order)}", rows=row)
    motion = read_bvh(write(tmp_path_factory.mktemp("bvh"), text), unit=1.0, up="z")
    np.testing.assert_array_equal(motion.root_positions, [[1, 2, 3]])


class TestSpelling:
    """Ways to write the same file."""

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ("\n", "\r\n"),
            ("\n", "\r"),
            ("  ", "\t"),
            ("\n{", " {"),
            ("HIERARCHY\n", "\ufeffHIERARCHY\n"),
            ("rotation", "Rotation"),
            ("OFFSET 9 -8 0", "OFFSET 9e0 -8.0E+000 -1e-030"),
            ("Frames:\t", "Frames: "),
            ("End Site", "End site"),
        ],
    )
    def test_reads_the_same(self, tmp_path: Path, old: str, new: str) -> None:
        expected = read_bvh(write(tmp_path, bvh_person()))
        assert old in bvh_person() or old.startswith("HIER")
        motion = read_bvh(write(tmp_path, bvh_person().replace(old, new)))
        np.testing.assert_allclose(motion.rotations, expected.rotations, atol=1e-12)
        np.testing.assert_allclose(motion.offsets, expected.offsets, atol=1e-12)

    def test_names_with_spaces_and_colons(self, tmp_path: Path) -> None:
        text = bvh_person().replace("JOINT Head", "JOINT\tmixamo rig:Head é")
        assert "mixamo rig:Head é_end" in read_bvh(write(tmp_path, text)).names

    def test_old_encodings(self, tmp_path: Path) -> None:
        path = tmp_path / "old.bvh"
        path.write_bytes(bvh_person().replace("Head", "T\xeate").encode("latin-1"))
        assert "T\xeate" in read_bvh(path).names

    def test_one_row_over_many_lines(self, tmp_path: Path) -> None:
        head, rows = bvh_person().split("0.0333333\n")
        text = head + "0.0333333\n" + "\n".join(rows.split())
        expected = read_bvh(write(tmp_path, bvh_person()))
        motion = read_bvh(write(tmp_path, text))
        np.testing.assert_array_equal(motion.rotations, expected.rotations)


class TestPositionChannelsBelowTheRoot:
    SIX = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"

    def test_that_hold_still_replace_the_offset(self, tmp_path: Path) -> None:
        text = chain(
            f"a | 0 0 0 | {self.SIX}",
            f"b | 0 1 0 | {self.SIX}",
            f"c | 0 1 0 | {self.SIX}",
            rows="0 0 0 0 0 0 0 2 0 0 0 0 0 0 0 0 0 0\n" * 2,
        )
        motion = read_bvh(write(tmp_path, text), unit=1.0, up="z")
        np.testing.assert_array_equal(motion.offsets[1], [0, 2, 0])
        # Zeros mean "no move", not that the bone has no length.
        np.testing.assert_array_equal(motion.offsets[2], [0, 1, 0])

    def test_that_carry_the_hips_make_these_the_root(self, tmp_path: Path) -> None:
        text = chain(
            f"reference | 0 0 0 | {self.SIX}",
            f"hips | 0 1 0 | {self.SIX}",
            "spine | 0 1 0 | Zrotation Xrotation Yrotation",
            rows="5 0 0 90 0 0 0 1 0 0 0 0 0 0 0\n5 0 0 90 0 0 3 1 0 -90 0 0 0 0 0\n",
        )
        motion = read_bvh(write(tmp_path, text), unit=1.0, up="z")
        assert motion.names == ("hips", "spine", "spine_end")
        np.testing.assert_allclose(motion.root_positions, [[4, 0, 0], [4, 3, 0]], atol=1e-12)
        np.testing.assert_allclose(
            motion.joint_positions()[:, 1], [[3, 0, 0], [4, 4, 0]], atol=1e-12
        )

    def test_that_stretch_a_bone_are_refused(self, tmp_path: Path) -> None:
        text = bvh_person().replace(
            "OFFSET 0 -42 0\n        CHANNELS 3",
            f"OFFSET 0 -42 0\n        CHANNELS 6 {self.SIX[:30]}",
            1,
        )
        head, rows = text.split("0.0333333\n")
        longer = [
            " ".join([*row.split()[:12], "0", str(-42 + 20 * index), "0", *row.split()[12:]])
            for index, row in enumerate(rows.splitlines())
        ]
        with pytest.raises(MotionFileError, match="'LeftFoot' change its bone's length"):
            read_bvh(write(tmp_path, head + "0.0333333\n" + "\n".join(longer)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MOTION", "MOTIONS", "has no line MOTION"),
        ("HIERARCHY", "HIERARCHIE", "line 1: expected ROOT, JOINT"),
        ("OFFSET 9 -8 0", "OFFSET 9 -8", "line 8: 'LeftUpLeg' needs one OFFSET of 3 numbers"),
        ("OFFSET 9 -8 0", "OFFSET 9 -8 nan", "line 8: OFFSET: .* found 'nan'"),
        ("CHANNELS 6", "CHANNELS 5", "line 5: 'Hips' needs one CHANNELS line"),
        ("Zrotation", "Wrotation", "line 5: unknown channel 'wrotation'; known are Xposition"),
        ("Zrotation", "Xrotation", "line 5: 'Hips' has a channel twice"),
        ("JOINT LeftLeg", "JOINT LeftUpLeg", "line 10: a second joint is called 'LeftUpLeg'"),
        ("JOINT LeftLeg", "JOINT", "line 10: a joint needs a name"),
        ("JOINT LeftLeg", "ROOT LeftLeg", "line 10: has a second ROOT"),
        ("ROOT Hips\n{", "ROOT Hips\n", "line 4: expected '{' after 'Hips'"),
        ("{", "{\n{", "line 4: a brace opens without a joint"),
        ("}\nMOTION", "MOTION", "has braces left open"),
        ("}\nMOTION", "}\n}\nMOTION", "line 77: a brace closes that was not opened"),
        ("Frames:\t4", "Frames:\t5", "is cut short: expected 5 frames of 36 numbers, found 4"),
        ("Frames:\t4", "Frames:\t3", "goes on after the 3 frames of 36 numbers it announces"),
        ("Frames:\t4", "Frames:\t999999999", "999999999 frames of 16 joints are more than"),
        ("Frames:\t4", "Frames:\t-4", "expected a positive number of frames, found '-4'"),
        ("Frames:\t4", "Frame count 4", "expected 'Frames: N' and 'Frame Time: seconds'"),
        ("0.0333333", "0", "line 79: expected a positive frame time, found '0'"),
        ("0.0333333", "nan", "line 79: expected a positive frame time, found 'nan'"),
    ],
)
def test_damaged_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = bvh_person()
    assert old in text
    path = write(tmp_path, text.replace(old, new, 1))
    with pytest.raises(MotionFileError, match=message) as caught:
        read_bvh(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e300", "12a", "1_0", "--1", "\x00"])
def test_words_that_are_no_numbers(tmp_path: Path, word: str) -> None:
    lines = bvh_person().splitlines()
    row = lines[-2].split()
    row[5] = word
    lines[-2] = " ".join(row)
    # The wrong word is found even where it is also a part of others.
    with pytest.raises(MotionFileError, match=f"line {len(lines) - 1}: expected a number between"):
        read_bvh(write(tmp_path, "\n".join(lines)))


def test_too_many_poses(tmp_path: Path) -> None:
    frames = 400_000
    text = f"{BVH_PERSON}Frames: {frames}\nFrame Time: 0.01\n"
    with pytest.raises(MotionFileError, match="400000 frames of 16 joints are more than"):
        read_bvh(write(tmp_path, text))


def test_too_many_joints(tmp_path: Path) -> None:
    deep = "".join(f"JOINT j{index}\n{{\n" for index in range(5000))
    with pytest.raises(MotionFileError, match="more than 1024 joints"):
        read_bvh(write(tmp_path, BVH_PERSON.replace("JOINT Head", deep + "JOINT Head")))


def test_no_python_runs_frame_by_frame(tmp_path: Path) -> None:
    def calls(frames: int) -> int:
        path, count = write(tmp_path, bvh_person(frames=frames)), 0

        def note(*_: object) -> None:
            nonlocal count
            count += 1

        sys.setprofile(note)
        try:
            assert read_bvh(path).frames == frames
        finally:
            sys.setprofile(None)
        return count

    calls(130)
    # A call for every tenth frame would be 117 more.
    assert calls(1300) < calls(130) + 100
    assert BVH_PERSON_COLUMNS == 36
