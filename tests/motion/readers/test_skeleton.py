import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.motion.readers import SkeletonMotion
from dynresp.motion.rotations import about_axis, identity, normalize, rotate
from dynresp.support.errors import MotionError


def make(**changes: object) -> SkeletonMotion:
    """An arm of two bones: shoulder, elbow, wrist; two frames."""
    fields: dict[str, object] = {
        "names": ("shoulder", "elbow", "wrist"),
        "parents": np.array([-1, 0, 1]),
        "offsets": np.array([[0, 0, 0], [0, 0.3, 0], [0, 0.25, 0]]),
        "root_positions": np.array([[0, 0, 1.4], [0.1, 0, 1.4]]),
        "rotations": identity(2, 3),
        "fps": 30,
        "name": "arm",
    }
    return SkeletonMotion(**(fields | changes))  # type: ignore[arg-type]


def random_motion(rng: np.random.Generator, joints: int = 6, frames: int = 4) -> SkeletonMotion:
    offsets = rng.normal(size=(joints, 3))
    offsets[0] = 0.0
    return make(
        names=[f"joint{index}" for index in range(joints)],
        parents=[-1, *(rng.integers(index) for index in range(1, joints))],
        offsets=offsets,
        root_positions=rng.normal(size=(frames, 3)),
        rotations=normalize(rng.normal(size=(frames, joints, 4))),
    )


def test_bones_turn_with_their_parent() -> None:
    rotations = identity(2, 3)
    rotations[1, 1:] = about_axis((0, 0, 1), -np.pi / 2)  # the forearm from +Y to +X
    positions = make(rotations=rotations).joint_positions()
    np.testing.assert_allclose(positions[0, 2], [0, 0.55, 1.4])
    np.testing.assert_allclose(positions[1, 1], [0.1, 0.3, 1.4])
    np.testing.assert_allclose(positions[1, 2], [0.35, 0.3, 1.4], atol=1e-12)


def test_rest_positions() -> None:
    np.testing.assert_allclose(make().rest_positions(), [[0, 0, 0], [0, 0.3, 0], [0, 0.55, 0]])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_equals_joint_by_joint_kinematics(seed: int) -> None:
    motion = random_motion(np.random.default_rng(seed))
    positions = motion.joint_positions()
    for frame in range(motion.frames):
        for joint, parent in enumerate(motion.parents):
            expected = motion.root_positions[frame]
            if parent >= 0:
                bone = rotate(motion.rotations[frame, parent], motion.offsets[joint])
                expected = positions[frame, parent] + bone
            np.testing.assert_allclose(positions[frame, joint], expected, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_another_rest_pose_is_the_same_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    rest = motion.rotations[1]
    other = motion.with_rest(rest)
    np.testing.assert_allclose(other.joint_positions(), motion.joint_positions(), atol=1e-9)
    np.testing.assert_allclose(other.rotations[1], identity(len(rest)), atol=1e-12)


def test_arrays_are_copies_and_read_only() -> None:
    offsets = np.array([[0, 0, 0], [0, 0.3, 0], [0, 0.25, 0]])
    motion = make(offsets=offsets)
    offsets[1] = 5.0
    assert motion.offsets[1, 1] == 0.3
    for array in (motion.parents, motion.offsets, motion.root_positions, motion.rotations):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"names": ("a", "b", "a")}, "these appear twice: a"),
        ({"names": ()}, "1 to 1024 joints, not 0"),
        ({"parents": np.array([-1, 0])}, r"parents must have shape \(3,\), not \(2,\)"),
        ({"parents": np.array([-1, 2, 0])}, "'elbow' comes first"),
        ({"parents": np.array([-1, -1, 0])}, "joint 0, and no other, must be the root"),
        ({"parents": np.array([0, 0, 0])}, "joint 0, and no other, must be the root"),
        ({"rotations": identity(3, 3)}, r"rotations must have shape \(2, 3, 4\)"),
        ({"rotations": np.ones((2, 3, 4))}, "unit quaternions; those of 'shoulder'"),
        ({"rotations": np.full((2, 3, 4), np.nan)}, "unit quaternions; those of 'shoulder'"),
        ({"root_positions": np.zeros(3)}, r"root_positions must have shape \(3, 3\)"),
        ({"root_positions": np.zeros((0, 3)), "rotations": identity(0, 3)}, "at least one frame"),
        ({"root_positions": np.full((2, 3), np.nan)}, "root_positions must be within"),
        ({"offsets": np.full((3, 3), 1e6)}, "offsets must be within 100 m"),
        ({"fps": 0}, "fps must lie between 0 and"),
        ({"fps": float("nan")}, "fps must lie between 0 and"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        make(**changes)


def test_a_rest_pose_of_another_skeleton_is_refused() -> None:
    with pytest.raises(MotionError, match=r"rest must have shape \(3, 4\), not \(2, 4\)"):
        make().with_rest(identity(2))
