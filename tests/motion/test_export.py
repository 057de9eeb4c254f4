import itertools
import math
import os
from pathlib import Path

import numpy as np
import pybvh
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.export import write_bvh, write_npz, zxy_angles
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.bvh import read_bvh
from dynresp.support.errors import DynrespError, MotionError
from tests.motion.samples import random_poses, smooth_motion

X, Y, Z = np.eye(3)


def from_angles(angles: np.ndarray) -> np.ndarray:
    """Quaternions of Rz(a) Rx(b) Ry(c)."""
    a, b, c = np.moveaxis(angles, -1, 0)
    tilted = rotations.multiply(rotations.about_axis(Z, a), rotations.about_axis(X, b))
    return rotations.multiply(tilted, rotations.about_axis(Y, c))


def assert_same_rotations(angles: np.ndarray, quaternions: np.ndarray, atol: float) -> None:
    apart = rotations.angle_between(from_angles(angles), quaternions)
    np.testing.assert_allclose(apart, 0.0, atol=atol)


class TestAngles:
    def test_equal_scipys(self, rng: np.random.Generator) -> None:
        q = rotations.normalize(rng.normal(size=(200, 4)))
        expected = Rotation.from_quat(q, scalar_first=True).as_euler("ZXY")
        for k in range(200):
            found = zxy_angles(q[k : k + 1])[0]
            # Both solutions of the same rotation are right; b in [-90, 90] makes it one.
            assert abs(found[1]) <= math.pi / 2 + 1e-12
            np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * expected[k]), atol=1e-9)

    @given(
        st.floats(-math.pi, math.pi),
        st.sampled_from([-1.0, 1.0]),
        st.one_of(st.just(0.0), st.floats(-17.0, -1.0).map(lambda power: 10.0**power)),
        st.floats(-math.pi, math.pi),
    )
    def test_at_and_near_the_poles(self, a: float, sign: float, off: float, c: float) -> None:
        q = from_angles(np.array([[a, sign * (math.pi / 2 - off), c]]))
        assert_same_rotations(zxy_angles(q), q, atol=3e-9)

    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    @pytest.mark.parametrize("frames", [20, 21])  # beside the pole, and on it
    def test_through_a_pole_without_a_jump(self, sign: float, frames: int) -> None:
        b = sign * np.linspace(0.4 * math.pi, 0.6 * math.pi, frames)
        angles = np.stack([np.full(frames, 0.3), b, np.full(frames, -0.8)], axis=-1)
        found = zxy_angles(from_angles(angles))
        assert_same_rotations(found, from_angles(angles), atol=1e-12)
        np.testing.assert_allclose(found, angles, atol=1e-9)

    def test_many_turns_are_counted(self) -> None:
        angles = np.zeros((100, 3))
        angles[:, 2] = np.linspace(0.0, 20.0, 100)
        np.testing.assert_allclose(zxy_angles(from_angles(angles)), angles, atol=1e-9)

    def test_steps_are_as_small_as_they_can_be(self, rng: np.random.Generator) -> None:
        motion = smooth_motion(rng, 400, 120.0, speed=3.0)
        q = motion.joint_quaternions
        angles = zxy_angles(q)
        assert_same_rotations(angles, q, atol=1e-9)
        assert np.abs(angles[0]).max() <= math.pi
        # No step of half a turn, as conversions frame by frame have them.
        assert np.abs(np.diff(angles, axis=0)).max() < math.pi


@pytest.fixture
def wild(rng: np.random.Generator) -> Motion:
    """A motion of all sorts of poses, many with joints at the poles of the Euler angles."""
    poses = random_poses(rng, 60)
    joints = poses[:, 7:].reshape(60, 13, 4)
    # World Y is BVH's X: turns of +-90 degrees about it are the poles.
    for k, sign in ((0, 1.0), (1, -1.0)):
        twist = rotations.about_axis((1.0, 0.0, 0.0), rng.uniform(-3.0, 3.0, 30))
        swing = rotations.about_axis((0.0, 1.0, 0.0), sign * np.pi / 2)
        joints[:30, k] = rotations.multiply(twist, swing)
    return Motion(poses, 30.0, "wild")


class TestBvh:
    def test_round_trip_by_our_reader(
        self, character: Character, wild: Motion, tmp_path: Path
    ) -> None:
        write_bvh(wild, tmp_path / "wild.bvh", character)
        read = read_bvh(tmp_path / "wild.bvh")  # unit and up axis found, not given
        bodies = [read.names.index(name) for name in character.body_names]
        states = character.kinematics(wild.poses)
        np.testing.assert_allclose(read.joint_positions()[:, bodies], states.positions, atol=1e-5)
        apart = rotations.angle_between(read.rotations[:, bodies], states.quaternions)
        np.testing.assert_allclose(apart, 0.0, atol=1e-6)
        assert read.fps == 30.0
        assert read.name == "wild"

    def test_round_trip_by_pybvh(self, character: Character, wild: Motion, tmp_path: Path) -> None:
        write_bvh(wild, tmp_path / "wild.bvh", character)
        read = pybvh.read_bvh_file(tmp_path / "wild.bvh")
        assert read.world_up == "+y"
        bodies = [read.node_index[name] for name in character.body_names]
        # Left, up, forward there; forward, left, up here.
        positions = read.node_positions()[:, bodies][..., [2, 0, 1]]
        expected = character.kinematics(wild.poses).positions
        np.testing.assert_allclose(positions, expected, atol=1e-4)

    def test_hierarchy(self, character: Character, wild: Motion, tmp_path: Path) -> None:
        write_bvh(wild, tmp_path / "wild.bvh", character)
        text = (tmp_path / "wild.bvh").read_text()
        words = text.split()
        joints = [b for a, b in itertools.pairwise(words) if a in ("ROOT", "JOINT")]
        assert tuple(joints) == character.body_names
        assert text.count("CHANNELS 3 Zrotation Xrotation Yrotation") == 13
        assert text.count("CHANNELS 6 Xposition Yposition Zposition Zrotation") == 1
        assert text.count("End Site") == 5
        assert "Frames: 60\nFrame Time: 0.033333333333\n" in text
        assert "-0.000000 " not in text
        assert "\r" not in text

    def test_ends_are_where_head_hands_and_toes_end(
        self, character: Character, tmp_path: Path
    ) -> None:
        write_bvh(Motion(character.rest_pose[None], 30.0), tmp_path / "rest.bvh", character)
        read = read_bvh(tmp_path / "rest.bvh")
        at = dict(zip(read.names, read.joint_positions()[0], strict=True))
        assert at["head_end"][2] == pytest.approx(1.7425, abs=1e-3)
        assert at["left_forearm_end"][2] == pytest.approx(0.695, abs=2e-2)
        assert at["left_forearm_end"][1] > 0.15 > -0.15 > at["right_forearm_end"][1]
        assert at["right_foot_end"][0] == pytest.approx(0.165, abs=1e-6)
        assert 0.0 < at["right_foot_end"][2] < 0.07

    @pytest.mark.parametrize("fps", [23.976, 24.0, 29.97, 30.0, 59.0, 60.0, 120.0, 1000.0, 0.5])
    def test_frame_rates(self, character: Character, tmp_path: Path, fps: float) -> None:
        motion = Motion(np.tile(character.rest_pose, (3, 1)), fps)
        write_bvh(motion, tmp_path / "a.bvh", character)
        assert read_bvh(tmp_path / "a.bvh").fps == pytest.approx(fps, rel=1e-4 / 3)
        line = (tmp_path / "a.bvh").read_text().split("Frame Time: ")[1].split()[0]
        assert 1.0 / float(line) == pytest.approx(fps, rel=1e-8)

    def test_same_motion_same_bytes(
        self, character: Character, wild: Motion, tmp_path: Path
    ) -> None:
        for name in ("a.bvh", "b.bvh"):
            write_bvh(wild, tmp_path / name, character)
        assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()


class TestWriting:
    @pytest.mark.parametrize("write", [write_bvh, write_npz])
    def test_leaves_the_file_alone_and_nothing_beside_it(
        self,
        write: object,
        character: Character,
        wild: Motion,
        tmp_path: Path,
    ) -> None:
        target = tmp_path / "new folder" / "out.file"
        target.parent.mkdir()
        target.write_text("old")
        write(wild, target, character)  # type: ignore[operator]
        assert [path.name for path in target.parent.iterdir()] == ["out.file"]
        assert target.stat().st_size > 1000

    @pytest.mark.parametrize("write", [write_bvh, write_npz])
    def test_what_cannot_be_written(
        self, write: object, character: Character, wild: Motion, tmp_path: Path
    ) -> None:
        (tmp_path / "file").touch()
        (tmp_path / "folder").mkdir()
        for target in (tmp_path / "file" / "out", tmp_path / "folder"):
            with pytest.raises(DynrespError, match="cannot write"):
                write(wild, target, character)  # type: ignore[operator]
        assert sorted(os.listdir(tmp_path)) == ["file", "folder"]

    def test_an_interrupted_write_keeps_the_old_file(
        self, character: Character, wild: Motion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        target = tmp_path / "out.npz"
        target.write_text("old")
        monkeypatch.setattr(np.lib.format, "write_array", interrupt)
        with pytest.raises(KeyboardInterrupt):
            write_npz(wild, target, character)
        assert target.read_text() == "old"
        assert os.listdir(tmp_path) == ["out.npz"]

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"name": "x" * 1001}, "name must have at most 1000 characters, not 1001"),
            ({"name": "x\0"}, "null character"),
            ({"labels": (Label("y" * 1001, 0, 1),)}, "label_names must have at most 1000"),
            ({"labels": (Label("y", 0, 1),) * 10_001}, "label_names must have the shape"),
        ],
    )
    def test_names_that_do_not_fit_a_npz_file(
        self,
        character: Character,
        tmp_path: Path,
        changes: dict[str, object],
        message: str,
    ) -> None:
        motion = Motion(character.rest_pose[None], 30.0, **changes)  # type: ignore[arg-type]
        with pytest.raises(MotionError, match=message):
            write_npz(motion, tmp_path / "out.npz", character)
        assert not list(tmp_path.iterdir())
