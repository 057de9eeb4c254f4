import os
from pathlib import Path

import numpy as np
import pytest

from dynresp.errors import MotionFileError
from dynresp.motion.character import Character
from dynresp.motion.export import write_bvh, write_npz
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion


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


@pytest.mark.mocap
def test_t_poses_go_on_request(character: Character, motions_folder: Path) -> None:
    path = motions_folder / "snumrl_TillingPatch/1/get_hit.amc"
    whole = load_motion(path, character)
    trimmed = load_motion(path, character, LoadOptions(trim_t_poses=True))
    assert len(whole) == 385
    assert len(trimmed) < len(whole) - 20
