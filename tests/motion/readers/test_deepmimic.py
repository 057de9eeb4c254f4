import json
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.readers import read_deepmimic
from dynresp.motion.rotations import angle_between, identity, slerp
from dynresp.support.errors import MotionFileError
from tests.motion.readers.samples import deepmimic_person, deepmimic_rows

# Where a row holds what: time, root position, root rotation, ..., right knee, ..., right elbow.
ROOT_ROTATION = slice(4, 8)
RIGHT_KNEE, RIGHT_ELBOW = 20, 29


def write(path: Path, rows: object) -> Path:
    path.write_text(json.dumps({"Loop": "wrap", "Frames": rows}))
    return path


def straight(frames: int = 1) -> list[list[float]]:
    """A person who stands straight in every frame."""
    rows = np.array(deepmimic_rows(frames))
    column = 4
    for width in (4, 4, 4, 4, 1, 4, 4, 1, 4, 1, 4, 4, 1):
        rows[:, column : column + width] = np.eye(4)[0] if width == 4 else 0.0
        column += width
    rows[:, 0] = 0.1
    return rows.tolist()


def test_stands_upright_facing_x_with_the_left_to_y(tmp_path: Path) -> None:
    motion = read_deepmimic(write(tmp_path / "stand.json", straight()))
    at = dict(zip(motion.names, motion.joint_positions()[0], strict=True))
    np.testing.assert_allclose(motion.rotations, identity(1, len(motion.names)), atol=1e-15)
    np.testing.assert_allclose(at["root"], [0.0, 0.0, 0.85])
    np.testing.assert_allclose(at["left_hip"], [0.0, 0.084887, 0.85])
    np.testing.assert_allclose(at["right_shoulder"], [-0.02405, -0.18311, 0.85 + 0.479651])
    assert at["left_ankle_end"][0] > 0.1  # the toes are in front
    assert at["left_ankle_end"][2] == pytest.approx(0.0, abs=0.01)
    assert motion.fps == 10.0


def test_knees_bend_back_and_elbows_forward(tmp_path: Path) -> None:
    rows = straight()
    rows[0][RIGHT_KNEE], rows[0][RIGHT_ELBOW] = -1.0, 1.0
    motion = read_deepmimic(write(tmp_path / "bend.txt", rows))
    at = dict(zip(motion.names, motion.joint_positions()[0], strict=True))
    assert at["right_ankle"][0] < at["right_knee"][0] - 0.1
    assert at["right_elbow_end"][0] > at["right_elbow"][0] + 0.1


def test_times_that_differ_are_evened_out(tmp_path: Path) -> None:
    rows = deepmimic_rows(4, step=0.05)
    even = read_deepmimic(write(tmp_path / "even.txt", rows))
    del rows[2]
    rows[1][0] = 0.1  # row 2 left out
    gap = read_deepmimic(write(tmp_path / "gap.txt", rows))
    assert gap.frames == even.frames == 4
    assert gap.fps == even.fps == 20.0
    np.testing.assert_allclose(gap.root_positions, even.root_positions, atol=1e-12)
    np.testing.assert_allclose(gap.rotations[[0, 1, 3]], even.rotations[[0, 1, 3]], atol=1e-12)
    middle = slerp(even.rotations[1, 0], even.rotations[3, 0], 0.5)
    assert angle_between(gap.rotations[2, 0], middle) < 1e-9
    assert read_deepmimic(tmp_path / "gap.txt", fps=25).frames == 3


def test_quaternions_are_normalised(tmp_path: Path) -> None:
    rows = straight()
    rows[0][ROOT_ROTATION] = [0.5, 0.0, 0.0, 0.5]
    motion = read_deepmimic(write(tmp_path / "short.txt", rows))
    # About Z in the file is about -Y here.
    np.testing.assert_allclose(motion.rotations[0, 0], np.array([1, 0, -1, 0]) / np.sqrt(2))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "line 1: expected DeepMimic JSON"),
        ("[" * 100_000, "nested too deeply"),
        ("[1]", 'rows of numbers under "Frames"'),
        ('{"Frames": []}', 'rows of numbers under "Frames"'),
        ('{"Frames": [3]}', "frame 0: expected 44 numbers, found int"),
        ('{"Frames": [[1, 2]]}', "frame 0: expected 44 numbers, found 2 numbers"),
        ('{"Frames": [1' + "0" * 5000 + "]}", "expected DeepMimic JSON: Exceeds the limit"),
    ],
)
def test_other_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(MotionFileError, match=message):
        read_deepmimic(path)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "1", True, None, 10**400, [1]])
def test_values_that_are_no_numbers(tmp_path: Path, value: object) -> None:
    rows: list[list[object]] = [list(row) for row in deepmimic_rows()]
    rows[2][7] = value
    with pytest.raises(MotionFileError, match="frame 2: expected a number"):
        read_deepmimic(write(tmp_path / "x.txt", rows))


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (0, -0.1, "frame 1: expected a positive time"),
        (0, 3.0, "frame 1 lasts 3 s, and the usual is"),
        (ROOT_ROTATION, [0.0] * 4, "frame 1: root needs a unit quaternion"),
    ],
)
def test_values_that_make_no_sense(
    tmp_path: Path, column: int | slice, value: object, message: str
) -> None:
    rows = deepmimic_rows()
    rows[1][column] = value  # type: ignore[index, assignment]
    with pytest.raises(MotionFileError, match=message):
        read_deepmimic(write(tmp_path / "x.txt", rows))


def test_sample_is_sound(tmp_path: Path) -> None:
    path = tmp_path / "person.txt"
    path.write_text(deepmimic_person())
    assert read_deepmimic(path).frames == 4
