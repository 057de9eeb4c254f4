import os
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.readers import read_asf_amc
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.support.errors import MotionFileError
from tests.motion.readers.samples import ASF_PERSON, amc_person, write_amc_person
from tests.oracles.asf_amc import bone_starts

MOTIONS = os.environ.get("DYNRESP_MOTIONS", "")
CMU_UNIT = 0.0254 / 0.45


def assert_equals_twin(motion: SkeletonMotion, asf: Path, amc: Path, every: int = 1) -> None:
    """The motion, given unit 1 and Z up, against the slow twin."""
    positions = motion.joint_positions()
    for index, places in list(enumerate(bone_starts(asf, amc)))[::every]:
        assert set(places) == set(motion.names)
        for joint, name in enumerate(motion.names):
            np.testing.assert_allclose(positions[index, joint], places[name], atol=1e-9)


def test_equals_the_slow_twin(tmp_path: Path) -> None:
    pair = write_amc_person(tmp_path, frames=5, seed=3)
    motion = read_asf_amc(pair.amc, pair.asf, unit=1.0, up="z")
    assert_equals_twin(motion, pair.asf, pair.amc)
    assert motion.names[0] == "root"
    assert motion.name == "person_walk"


@pytest.mark.mocap
@pytest.mark.skipif(not MOTIONS, reason="DYNRESP_MOTIONS names no folder of motion capture")
@pytest.mark.parametrize(
    ("amc", "asf"),
    [
        ("snumrl_TillingPatch/3/pushed.amc", "snumrl_TillingPatch/wd2.asf"),
        ("snumrl_TillingPatch/multi/hys_push.amc", "snumrl_TillingPatch/multi/hys.asf"),
        ("cmu/02/02_01.amc", "cmu/02/02.asf"),
        ("cmu/127/127_23.amc", "cmu/127/127.asf"),
    ],
)
def test_equals_the_slow_twin_on_real_clips(amc: str, asf: str) -> None:
    paths = Path(MOTIONS, amc), Path(MOTIONS, asf)
    motion = read_asf_amc(*paths, unit=1.0 / 40, up="z")
    assert_equals_twin(
        SkeletonMotion(
            motion.names,
            motion.parents,
            motion.offsets * 40,
            motion.root_positions * 40,
            motion.rotations,
            motion.fps,
            motion.name,
        ),
        paths[1],
        paths[0],
        every=max(motion.frames // 20, 1),
    )


def test_finds_unit_up_axis_and_rate(tmp_path: Path) -> None:
    motion = read_asf_amc(write_amc_person(tmp_path).amc)
    assert motion.fps == 120.0
    # 17 units of 1/0.45 inch above the ground, which is Y in the file and Z here.
    np.testing.assert_allclose(motion.root_positions[0], np.array([2, 1, 17]) * CMU_UNIT)
    thigh = motion.names.index("ltibia")
    assert np.linalg.norm(motion.offsets[thigh]) == pytest.approx(7.6 * CMU_UNIT)


def test_a_stated_unit_that_makes_no_person_is_not_believed(tmp_path: Path) -> None:
    pair = write_amc_person(tmp_path)
    scaled = ASF_PERSON.replace("length 0.45", "length 1.0")
    pair.asf.write_text(scaled)
    assert read_asf_amc(pair.amc).root_positions[0, 2] == pytest.approx(17 * CMU_UNIT)


def test_rate_is_told_or_stated(tmp_path: Path) -> None:
    pair = write_amc_person(tmp_path, header=":SAMPLES-PER-SECOND 30")
    assert read_asf_amc(pair.amc).fps == 30.0
    assert read_asf_amc(pair.amc, fps=60).fps == 60.0
    pair.amc.write_text(amc_person(header=":SAMPLES-PER-SECOND none"))
    with pytest.raises(MotionFileError, match="line 4: expected a positive number of samples"):
        read_asf_amc(pair.amc)


def test_radians(tmp_path: Path) -> None:
    pair = write_amc_person(tmp_path)
    degrees = read_asf_amc(pair.amc)
    lines = []
    for line in amc_person().replace(":DEGREES", ":RADIANS").splitlines():
        bone, *values = line.split()
        first = 3 if bone == "root" else 0
        if values and line[0] not in "#:":
            turned = [str(np.radians(float(value))) for value in values[first:]]
            line = " ".join([bone, *values[:first], *turned])
        lines.append(line)
    pair.amc.write_text("\n".join(lines))
    # The axes of the bones stay in the ASF's unit, degrees.
    np.testing.assert_allclose(read_asf_amc(pair.amc).rotations, degrees.rotations, atol=1e-12)


@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_line_endings(tmp_path: Path, ending: str) -> None:
    pair = write_amc_person(tmp_path)
    expected = read_asf_amc(pair.amc)
    pair.amc.write_bytes(b"\xef\xbb\xbf" + amc_person().replace("\n", ending).encode())
    pair.asf.write_bytes(ASF_PERSON.replace("\n", ending).encode())
    np.testing.assert_array_equal(read_asf_amc(pair.amc).rotations, expected.rotations)


class TestFindingTheSkeleton:
    def test_the_only_one_in_the_folder_or_above(self, tmp_path: Path) -> None:
        below = tmp_path / "takes"
        below.mkdir()
        (tmp_path / "anyone.asf").write_text(ASF_PERSON)
        (below / "walk.amc").write_text(amc_person())
        assert read_asf_amc(below / "walk.amc").frames == 4

    def test_by_name(self, tmp_path: Path) -> None:
        pair = write_amc_person(tmp_path)
        (tmp_path / "other.asf").write_text("no skeleton at all")
        assert read_asf_amc(pair.amc).frames == 4
        inside = tmp_path / "take3_person_walk.amc"
        inside.write_text(amc_person())
        assert read_asf_amc(inside).frames == 4

    def test_a_number_is_not_the_beginning_of_another(self, tmp_path: Path) -> None:
        (tmp_path / "1.asf").write_text("no skeleton at all")
        (tmp_path / "10.asf").write_text(ASF_PERSON)
        (tmp_path / "10_01.amc").write_text(amc_person())
        assert read_asf_amc(tmp_path / "10_01.amc").frames == 4

    def test_several_that_are_one_skeleton(self, tmp_path: Path) -> None:
        (tmp_path / "a.asf").write_text(ASF_PERSON)
        # A free end that is not measured changes nothing that moves; the fuller file is taken.
        (tmp_path / "b.asf").write_text(ASF_PERSON.replace("length 4", "length 0"))
        (tmp_path / "walk.amc").write_text(amc_person())
        motion = read_asf_amc(tmp_path / "walk.amc")
        end = motion.names.index("head_end")
        assert np.linalg.norm(motion.offsets[end]) == pytest.approx(4 * CMU_UNIT)

    def test_several_that_differ(self, tmp_path: Path) -> None:
        (tmp_path / "ann.asf").write_text(ASF_PERSON)
        (tmp_path / "bob.asf").write_text(ASF_PERSON.replace("length 7.6", "length 8.6"))
        (tmp_path / "walk.amc").write_text(amc_person())
        with pytest.raises(MotionFileError, match=r"not clear: .*ann\.asf, .*bob\.asf; give one"):
            read_asf_amc(tmp_path / "walk.amc")

    def test_none(self, tmp_path: Path) -> None:
        folder = tmp_path / "a" / "b"
        folder.mkdir(parents=True)
        (folder / "walk.amc").write_text(amc_person())
        with pytest.raises(MotionFileError, match="no ASF skeleton in"):
            read_asf_amc(folder / "walk.amc")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ltibia", "lshin", "line 9: 'lshin' is not a bone with dof in person.asf"),
        ("2\nroot", "3\nroot", "line 11: expected frame 2, found frame '3'"),
        ("lfoot", "#", "line 11: frame 1 ends without 'lfoot'"),
        ("1\nroot", "root", "line 4: expected a frame number, found 'root'"),
        ("spine ", "spine nan ", "line 6: expected 3 numbers after 'spine', found 4"),
        ("root 1 17", "root one 17", "line 5: .* found 'one'"),
        ("root 1 17", "root nan 17", "frame 1, bone 'root': .* found 'nan'"),
        ("root 1 17", "root 1e300 17", "frame 1, bone 'root': .* found '1e.300'"),
    ],
)
def test_damaged_motions(tmp_path: Path, old: str, new: str, message: str) -> None:
    pair = write_amc_person(tmp_path)
    text = amc_person()
    assert old in text
    pair.amc.write_text(text.replace(old, new, 1))
    with pytest.raises(MotionFileError, match=message) as caught:
        read_asf_amc(pair.amc)
    assert str(pair.amc) in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name lfemur", "name lhip", "line 25: a second bone is called 'lhip'"),
        ("    length 7.6\n", "", "line 23: this bone has no 'length'"),
        ("axis 0 0 20 XYZ", "axis 0 0 20 XYY", "line 28: expected x, y and z in some order"),
        ("axis 0 0 20 XYZ", "axis 0 20", "line 28: axis needs 3 numbers, found 2"),
        ("dof rx ry rz", "dof rx rx rz", "line 29: dof takes"),
        ("lhip lfemur", "lhip femur", ":hierarchy names 'femur', which is not a bone"),
        ("spine head", "spine head root", "bone 'root' has two parents"),
        ("    spine head\n", "", "bone 'head' is not connected to the root"),
        (":bonedata", ":bones", "has no bones under :bonedata"),
        ("length 0.45", "length 0", "expected a positive length"),
        ("direction 1 0 0", "direction 1 0 inf", "line 19: direction: .* found 'inf'"),
    ],
)
def test_damaged_skeletons(tmp_path: Path, old: str, new: str, message: str) -> None:
    pair = write_amc_person(tmp_path)
    assert old in ASF_PERSON
    pair.asf.write_text(ASF_PERSON.replace(old, new, 1))
    with pytest.raises(MotionFileError, match=message) as caught:
        read_asf_amc(pair.amc)
    assert str(pair.asf) in str(caught.value)


def test_bones_that_stretch_are_refused(tmp_path: Path) -> None:
    pair = write_amc_person(tmp_path)
    pair.asf.write_text(ASF_PERSON.replace("dof rx\n", "dof rx l\n"))
    still = amc_person().replace("ltibia", "ltibia 5")  # rx 5, then the old angle as l
    pair.amc.write_text(still)
    with pytest.raises(MotionFileError, match="bone 'ltibia' changes its place or length"):
        read_asf_amc(pair.amc)
