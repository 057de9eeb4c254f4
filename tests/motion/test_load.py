import os
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.export import write_bvh, write_npz
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionFileError


def _standing(character: Character, frames: int = 30, height: float = 0.0) -> Motion:
    poses = np.repeat(character.rest_pose[None], frames, axis=0)
    poses[:, 2] += height
    return Motion(poses, 30.0, "standing")


def test_file_of_another_program_is_set_on_the_floor(character: Character, tmp_path: Path) -> None:
    write_bvh(_standing(character, height=0.3), tmp_path / "a.bvh", character)
    motion = load_motion(tmp_path / "a.bvh", character)
    assert motion.fps == 30.0
    assert motion.contacts.all()
    np.testing.assert_allclose(motion.root_positions[:, 2], character.rest_pose[2], atol=0.01)


def test_own_file_comes_back_as_it_was(character: Character, tmp_path: Path) -> None:
    written = _standing(character, height=0.3)
    write_npz(written, tmp_path / "a.npz", character)
    np.testing.assert_array_equal(load_motion(tmp_path / "a.npz", character).poses, written.poses)


def test_file_is_read_once_until_it_changes(character: Character, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(_standing(character), path, character)
    first = load_motion(path, character)
    assert load_motion(tmp_path / "." / "a.npz", character) is first
    write_npz(_standing(character, frames=12), path, character)
    os.utime(path, ns=(0, 1))
    assert len(load_motion(path, character)) == 12


def test_frame_rate_can_be_told(character: Character, tmp_path: Path) -> None:
    write_bvh(_standing(character), tmp_path / "a.bvh", character)
    options = LoadOptions(fps=60.0)
    assert load_motion(tmp_path / "a.bvh", character, options).fps == 60.0


def test_own_file_takes_no_telling(character: Character, tmp_path: Path) -> None:
    write_npz(_standing(character), tmp_path / "a.npz", character)
    with pytest.raises(MotionFileError, match="states its unit"):
        load_motion(tmp_path / "a.npz", character, LoadOptions(fps=60.0))


def test_missing_file_and_foreign_skeleton_are_told_by_name(
    character: Character, tmp_path: Path
) -> None:
    with pytest.raises(MotionFileError, match=r"gone\.bvh: cannot be read"):
        load_motion(tmp_path / "gone.bvh", character)
    worm = tmp_path / "worm.bvh"
    worm.write_text(
        "HIERARCHY\nROOT segment\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.0333333\n0 0 0\n"
    )
    with pytest.raises(MotionFileError, match=r"worm\.bvh: "):
        load_motion(worm, character)


ASF = """\
:version 1.10
:name made-up
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  none
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
{bones}
:hierarchy
  begin
    root lhip rhip spine
    lhip lthigh
    lthigh lshank
    lshank lfoot
    rhip rthigh
    rthigh rshank
    rshank rfoot
    spine head larm rarm
    larm lforearm
    rarm rforearm
  end
"""
_LENGTHS = {
    "hip": ((1, 0, 0), 2.0), "thigh": ((0, -1, 0), 7.0), "shank": ((0, -1, 0), 7.0),
    "foot": ((0, 0, 1), 3.0), "arm": ((1, 0, 0), 7.0), "forearm": ((1, 0, 0), 6.0),
}  # fmt: skip


def _write_asf(path: Path, shank: float) -> None:
    """A plain person of the given length of the shank, in the unit of the file."""
    bones = [("spine", (0, 1, 0), 9.0), ("head", (0, 1, 0), 5.0)]
    for side, sign in (("l", 1), ("r", -1)):
        for name, (way, length) in _LENGTHS.items():
            bones.append((side + name, (sign * way[0], *way[1:]), length))
    text = "\n".join(
        f"  begin\n    id {i + 1}\n    name {name}\n    direction {x} {y} {z}\n"
        f"    length {shank if 'shank' in name else length}\n    axis 0 0 0 XYZ\n"
        + ("    dof rx\n    limits (-180 180)\n" if "thigh" in name else "")
        + "  end"
        for i, (name, (x, y, z), length) in enumerate(bones)
    )
    path.write_text(ASF.format(bones=text))


def _write_amc(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    frames = "\n".join(f"{i}\nroot 0 14 0 0 0 0\nlthigh 0\nrthigh 0" for i in range(1, 20))
    path.write_text(f":FULLY-SPECIFIED\n:DEGREES\n{frames}\n")


@pytest.mark.parametrize("where", ["a.asf", "../a.asf"])
def test_another_skeleton_beside_an_amc_file_is_seen(
    where: str, character: Character, tmp_path: Path
) -> None:
    amc = tmp_path / "sub" / "a.amc"
    _write_amc(amc)
    _write_asf(amc.parent / where, 7.0)
    first = load_motion(amc, character)
    assert load_motion(amc, character) is first
    _write_asf(amc.parent / where, 5.5)
    os.utime(amc.parent / where, ns=(0, 1))
    assert load_motion(amc, character) is not first


def test_a_relative_skeleton_is_resolved(
    character: Character, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    amc = tmp_path / "a.amc"
    _write_amc(amc)
    motions = []
    for name, shank in (("one", 7.0), ("two", 5.5)):
        (tmp_path / name).mkdir()
        _write_asf(tmp_path / name / "a.asf", shank)
        monkeypatch.chdir(tmp_path / name)
        motions.append(load_motion(amc, character, LoadOptions(asf=Path("a.asf"))))
    assert motions[0] is not motions[1]
    options = LoadOptions(asf=tmp_path / "one" / "a.asf")
    assert load_motion(amc, character, options) is motions[0]
    with pytest.raises(MotionFileError, match=r"gone\.asf"):
        load_motion(amc, character, LoadOptions(asf=Path("gone.asf")))


def test_a_file_of_another_size_has_changed(character: Character, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(_standing(character), path, character)
    os.utime(path, ns=(0, 1))
    load_motion(path, character)
    write_npz(_standing(character, frames=12), path, character)
    os.utime(path, ns=(0, 1))
    assert len(load_motion(path, character)) == 12


@pytest.mark.mocap
def test_t_poses_go_on_request(character: Character, motions_folder: Path) -> None:
    path = motions_folder / "snumrl_TillingPatch/1/get_hit.amc"
    whole = load_motion(path, character)
    trimmed = load_motion(path, character, LoadOptions(trim_t_poses=True))
    assert len(whole) == 385
    assert len(trimmed) < len(whole) - 20
