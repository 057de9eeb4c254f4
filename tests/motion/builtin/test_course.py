"""Courses: built-in motions that are planned step by step."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.motion import ground, rotations
from dynresp.motion.builtin import builtin_info, builtin_names, load_builtin, make_motion
from dynresp.motion.builtin.course import balance, center_of_mass
from dynresp.motion.builtin.keypose_spec import read_spec
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import FEET, Motion
from dynresp.support.errors import SpecError

NAMES = [name for name in builtin_names() if builtin_info(name).kind == "locomotion"]
GRAVITY = 9.81

HEAD = """
name = "a course"
kind = "locomotion"
what = "Goes."
fps = 30
"""
WALK = """
[course]
route = ["go"]
[course.phrases]
go = [
  { do = "stay", time = 0.5 },
  { do = "step", count = 9, forward = 0.66 },
  { do = "step", apart = 0.18 },
  { do = "stay", time = 1.0 },
]
"""
TURN = """
[course]
route = ["turn"]
[course.phrases]
turn = [
  { do = "stay", time = 0.5, posture = { neck = { rotation = 20 }, left_elbow = 40 } },
  { do = "step", foot = "left", forward = 0.3, left = 0.2, turn = 40, time = 0.6 },
  { do = "step", time = 0.6, apart = 0.2 },
  { do = "stay", time = 0.7, at = [0.01, 0.03] },
]
"""
JUMP = """
[course]
route = ["jump"]
[course.phrases]
jump = [
  { do = "stay", time = 0.5 },
  { do = "jump", forward = 0.8, time = 0.5 },
  { do = "stay", time = 0.5 },
]
"""


def test_what_presses_in_one_place_bears_a_body_at_rest() -> None:
    at = np.tile([0.3, -0.1], (50, 1))
    center = balance(at, np.full(50, 0.9), np.zeros(50), 30.0)
    np.testing.assert_allclose(center, at, atol=1e-12)


def test_balance_solves_its_equation(rng: np.random.Generator) -> None:
    fps = 30.0
    pressure = np.cumsum(rng.normal(scale=0.02, size=(200, 2)), axis=0)
    height, lift = rng.uniform(0.6, 1.1, 200), rng.uniform(-GRAVITY, GRAVITY, 200)
    center = balance(pressure, height, lift, fps)
    pushed = np.diff(center, 2, axis=0) * fps**2 * height[1:-1, None]
    wanted = ((GRAVITY + lift)[:, None] * (center - pressure))[1:-1]
    np.testing.assert_allclose(pushed, wanted, atol=1e-8)
    np.testing.assert_allclose(center[[0, -1]], pressure[[0, -1]])


def test_balance_in_the_air_goes_straight(rng: np.random.Generator) -> None:
    lift = np.zeros(90)
    lift[40:60] = -GRAVITY
    center = balance(rng.normal(size=(90, 2)), np.ones(90), lift, 30.0)
    assert np.abs(np.diff(center[39:61], 2, axis=0)).max() < 1e-9


def test_balance_sways_less_the_slower_it_can_fall() -> None:
    # Over a pressure that swings to and fro, p = cos(w t), the centre swings by 1 / (1 + T^2 w^2).
    times = np.arange(3001) / 100.0
    swing = np.cos(2 * np.pi * times)
    center = balance(np.stack([swing, swing], axis=1), np.full(3001, 0.9), np.zeros(3001), 100.0)
    share = 1.0 / (1.0 + 0.9 / GRAVITY * (2 * np.pi) ** 2)
    np.testing.assert_allclose(center[500:2500, 0], share * swing[500:2500], atol=2e-3)


@pytest.mark.parametrize("name", NAMES)
def test_standing_feet_stand_on_something(name: str, character: Character) -> None:
    motion = load_builtin(name, character)
    assert max(stance_slides(motion, character)) < 0.001
    states = character.kinematics(motion.poses)
    low = ground.clearances(character, states)
    for i, side in enumerate(FEET):
        heights = low[motion.contacts[:, i], character.body(f"{side}_foot")]
        surfaces = (0.0, 0.32) if name == "stool" else (0.0,)
        assert np.abs(heights[:, None] - surfaces).min(axis=1).max() < 0.002
    # Both feet are off the ground in jumps alone.
    aloft = ~motion.contacts.any(axis=1)
    assert aloft.any() == (name == "stool")


@pytest.mark.parametrize("name", NAMES)
def test_who_stands_still_is_balanced(name: str, character: Character) -> None:
    motion = load_builtin(name, character)
    center = center_of_mass(character, motion.poses)[:, :2]
    speed = np.linalg.norm(np.gradient(center, 1.0 / motion.fps, axis=0), axis=1)
    still = motion.contacts.all(axis=1) & (speed < 0.02) & (motion.root_positions[:, 2] > 0.85)
    assert still.mean() > 0.02
    feet = [character.body(f"{side}_foot") for side in FEET]
    states = character.kinematics(motion.poses[still])
    middle = states.positions[:, feet, :2].mean(axis=1)
    away = center[still] - middle
    # Not behind the heels, not before the balls of the feet, not beside them.
    assert np.linalg.norm(away, axis=1).max() < 0.08


@pytest.mark.parametrize("name", NAMES)
def test_knees_bend_forward_and_joints_move_smoothly(name: str, character: Character) -> None:
    motion = load_builtin(name, character)
    turns = np.degrees(rotations.to_rotation_vector(motion.joint_quaternions))
    for side in FEET:
        knee = turns[:, character.joint(f"{side}_knee")]
        assert knee[:, 1].min() > 0.0
        assert np.abs(knee[:, [0, 2]]).max() < 15.0
    speed = np.linalg.norm(np.diff(motion.root_positions[:, :2], axis=0), axis=1) * motion.fps
    assert speed.max() < (3.0 if name == "stool" else 2.2)


def test_walks_at_an_ordinary_pace(tmp_path: Path, character: Character) -> None:
    motion = _made(tmp_path, WALK, character)
    steady = (motion.root_positions[:, 0] > 1.5) & (motion.root_positions[:, 0] < 4.5)
    x, z = motion.root_positions[steady, 0], motion.root_positions[steady, 2]
    assert np.diff(x).mean() * motion.fps == pytest.approx(0.66 / 0.536, abs=0.04)
    assert np.diff(x).min() * motion.fps > 0.9
    assert 0.02 < np.ptp(z) < 0.06
    turns = np.degrees(rotations.to_rotation_vector(motion.joint_quaternions[steady]))
    assert 50 < turns[:, character.joint("left_knee"), 1].max() < 70
    # The arm swings with the other leg.
    arm, leg = (-turns[:, character.joint(f"left_{x}"), 1] for x in ("shoulder", "hip"))
    assert np.corrcoef(arm, leg)[0, 1] < -0.5


def test_mirrored_phrase_is_the_mirrored_motion(tmp_path: Path, character: Character) -> None:
    plain = _made(tmp_path, TURN, character)
    other = _made(tmp_path, TURN.replace('["turn"]', '["turn mirrored"]'), character)
    np.testing.assert_allclose(other.poses, plain.mirrored(character).poses, atol=1e-9)
    np.testing.assert_array_equal(other.contacts, plain.contacts[:, ::-1])
    facing = np.degrees(rotations.yaw_of(plain.root_quaternions[-1]))
    assert facing == pytest.approx(40.0, abs=0.5)


def test_jump_flies_as_things_fall(tmp_path: Path, character: Character) -> None:
    motion = _made(tmp_path, JUMP, character)
    (aloft,) = np.nonzero(~motion.contacts.any(axis=1))
    assert len(aloft) == pytest.approx(0.5 * motion.fps, abs=1)
    pull = np.diff(motion.root_positions[aloft, 2], 2) * motion.fps**2
    np.testing.assert_allclose(pull, -GRAVITY, atol=0.5)
    way = motion.root_positions[-1] - motion.root_positions[0]
    np.testing.assert_allclose(way, [0.8, 0.0, 0.0], atol=0.01)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"turn"]', '"trun"]', "course: .*'turn'"),
        (
            "forward = 0.3",
            "forwrad = 0.3",
            "turn 2.forwrad is not a key of .*forward",
        ),
        ("forward = 0.3", "forward = 30", "course.phrases.turn 2.forward: .*3, got 30"),
        (
            'do = "step", time',
            'do = "hop", time',
            "turn 3.do: .*step, stay, jump, got 'hop'",
        ),
        (
            "time = 0.6, apart",
            'foot = "left", apart',
            "the left foot steps twice in a row",
        ),
        ("0.7, at = [0.01, 0.03] },", '0.7 },\n  { do = "step" },', "begins and ends standing"),
        ('"turn"]', '"turn"]\nstart = [0]', "course.start"),
        ("neck = {", "pelvis = { x = 0.1 }, neck = {", "turn 1.posture: balance says where"),
        ("[course]", "[[key]]\ntime = 0\n[course]", "takes .*sway.* besides"),
    ],
)
def test_wrong_courses_are_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    file = tmp_path / "small.toml"
    assert old in TURN
    file.write_text(HEAD + TURN.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(SpecError, match=says):
        read_spec(file)


def test_course_needs_its_kind(tmp_path: Path) -> None:
    file = tmp_path / "small.toml"
    file.write_text(HEAD.replace('"locomotion"', '"walk"') + TURN, encoding="utf-8")
    with pytest.raises(SpecError, match="belongs to kind 'locomotion'"):
        read_spec(file)


def _made(folder: Path, course: str, character: Character) -> Motion:
    file = folder / "small.toml"
    file.write_text(HEAD + course, encoding="utf-8")
    return make_motion(read_spec(file), character)
