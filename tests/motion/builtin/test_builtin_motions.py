from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from dynresp.motion import ground, rotations
from dynresp.motion.builtin import (
    PREFIX,
    builtin_folder,
    builtin_info,
    builtin_names,
    load_builtin,
    make_motion,
    make_poses,
)
from dynresp.motion.builtin.footing import Sole
from dynresp.motion.builtin.keypose_spec import BuiltinSpec, read_spec
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET
from dynresp.motion.reactions.strategies import STRATEGIES
from dynresp.support.errors import SpecError, UnknownNameError

NAMES = builtin_names()
GRAVITY = 9.81

SMALL = """
name = "a nod"
kind = "idle"
what = "Nods."

[[stance]]
foot = "left"
from = 0
to = 1
at = [0, 0.1]

[[stance]]
foot = "right"
from = 0
to = 1
at = [0, -0.1]

[[key]]
time = 0
pelvis = { height = 0.92 }

[[key]]
time = 1
neck = { flexion = 20 }
"""


def test_base_motions_and_every_strategy_are_there() -> None:
    kinds = {name: builtin_info(name).kind for name in NAMES}
    for name in ("walk", "idle", "guard", "punch"):
        assert kinds[name] == name
    assert all(kinds[name] == "locomotion" for name in ("stroll", "footwork", "stool"))
    given = [str(builtin_info(name).strategy) for name in NAMES if kinds[name] == "reaction"]
    assert sorted(given) == sorted(STRATEGIES)
    assert len(STRATEGIES) == 12


@pytest.mark.parametrize("name", NAMES)
def test_motion_is_sound(name: str, character: Character) -> None:
    motion = load_builtin(name)
    assert motion.name.startswith(PREFIX)
    assert load_builtin(name, character) is motion
    states = character.kinematics(motion.poses)
    assert ground.clearances(character, states).min() > -0.02

    turns = rotations.to_rotation_vector(motion.joint_quaternions)
    for side in FEET:
        assert np.degrees(turns[:, character.joint(f"{side}_knee"), 1]).min() > -5.0
        assert np.degrees(-turns[:, character.joint(f"{side}_elbow"), 1]).min() > -5.0
    limits = character.model.jnt_range[1:, 1]
    assert (np.linalg.norm(turns, axis=2) <= limits).all()

    velocity = np.gradient(states.positions, 1.0 / motion.fps, axis=0)
    acceleration = np.gradient(velocity[:, 0], 1.0 / motion.fps, axis=0)[2:-2]
    assert np.linalg.norm(acceleration, axis=1).max() < 3.0 * GRAVITY
    assert np.linalg.norm(velocity, axis=2).max() < 6.5


@pytest.mark.parametrize("name", NAMES)
def test_standing_feet_do_not_move(name: str, character: Character) -> None:
    spec = read_spec(builtin_folder() / f"{name}.toml")
    poses, tracks = make_poses(spec, character)
    states = character.kinematics(poses)
    for i, (side, track) in enumerate(zip(FEET, tracks, strict=True)):
        off = legs.ankle_positions(character, states)[:, i] - track.ankles
        assert np.linalg.norm(off[track.locked], axis=1).max() < 1e-3
        foot = character.body(f"{side}_foot")
        sole = Sole.of(character, side)
        edges = {
            edge: states.positions[:, foot]
            + rotations.rotate(states.quaternions[:, foot], getattr(sole, edge))
            for edge in ("heel", "ball")
        }
        # Heel to ball may roll, but whichever edge is down stays where it is.
        down = np.minimum(edges["heel"][:, 2], edges["ball"][:, 2])
        for start, stop in _spans(track.locked):
            for edge in edges.values():
                here = np.flatnonzero(edge[start:stop, 2] <= down[start:stop] + 1e-4) + start
                drift = np.ptp(edge[here, :2], axis=0) if len(here) else np.zeros(2)
                assert drift.max() < 1e-3


def test_feet_ease_into_and_out_of_standing(character: Character) -> None:
    for name in ("forward_roll", "multiple_steps_forward", "side_fall", "walk"):
        motion = load_builtin(name)
        ankles = legs.ankle_positions(character, character.kinematics(motion.poses))
        jump = np.linalg.norm(np.diff(ankles, axis=0), axis=2)
        assert jump.max() * motion.fps < 5.5


def test_durations() -> None:
    for name in NAMES:
        info, length = builtin_info(name), load_builtin(name).duration
        if info.kind == "locomotion":
            assert length >= 60.0
            assert load_builtin(name).fps == 30.0
            continue
        if info.kind in ("walk", "idle", "guard"):
            assert length >= 10.0
        elif info.kind == "reaction":
            assert 1.0 <= length <= 4.0
        assert load_builtin(name).fps == 60.0


def test_walk_is_within_normative_ranges(character: Character) -> None:
    motion = load_builtin("walk")
    speed = np.ptp(motion.root_positions[:, 0]) / motion.duration
    assert speed == pytest.approx(1.23, abs=0.05)
    left = motion.contacts[:, 0]
    strikes = np.flatnonzero(np.diff(left.astype(int)) == 1)
    cadence = 120.0 * motion.fps / np.diff(strikes).mean()
    assert 105 < cadence < 118
    whole = slice(strikes[0], strikes[-1])
    assert 0.18 < motion.contacts[whole].all(axis=1).mean() < 0.28
    assert motion.contacts.any(axis=1).all()

    turns = np.degrees(rotations.to_rotation_vector(motion.joint_quaternions))
    knee = turns[whole, character.joint("left_knee"), 1]
    hip = -turns[whole, character.joint("left_hip"), 1]
    assert 50 < knee.max() < 70
    assert knee.min() < 10
    assert 35 < np.ptp(hip) < 50
    assert 0.02 < np.ptp(motion.root_positions[whole, 2]) < 0.06


def test_idle_and_guard_stand_but_live(character: Character) -> None:
    for name in ("idle", "guard"):
        motion = load_builtin(name)
        assert motion.contacts.all()
        head = character.kinematics(motion.poses).positions[:, character.body("head")]
        assert (np.ptp(head, axis=0)[:2] > 0.01).all()


def test_reactions_end_at_rest() -> None:
    for name in NAMES:
        if builtin_info(name).kind != "reaction":
            continue
        motion = load_builtin(name)
        assert np.abs(motion.velocities()[-3:]).max() < 0.5
        if name != "side_fall":
            assert motion.contacts[-1].all()


@pytest.mark.parametrize(
    ("name", "direction"),
    [("forward", (1, 0)), ("backward", (-1, 0)), ("side_fall", (0, 1))],
)
def test_reactions_go_the_way_of_the_push(name: str, direction: tuple[int, int]) -> None:
    for each in NAMES:
        if name in each and builtin_info(each).kind == "reaction":
            motion = load_builtin(each)
            way = motion.root_positions[-1, :2] - motion.root_positions[0, :2]
            assert way @ direction > 0.2
            assert motion.velocities()[0, :2] @ direction > 0.3


def test_unknown_name() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'walk'"):
        load_builtin("wlak")


def test_small_file_makes_a_motion(tmp_path: Path, character: Character) -> None:
    motion = make_motion(_read(tmp_path, SMALL), character)
    assert len(motion) == 61
    neck = motion.joint_quaternions[-1, character.joint("neck")]
    assert np.degrees(rotations.to_rotation_vector(neck))[1] == pytest.approx(20.0, abs=1e-6)


def test_plural_sets_both_sides_mirrored(tmp_path: Path, character: Character) -> None:
    text = SMALL.replace("neck = { flexion = 20 }", "shoulders = { abduction = 40, rotation = 10 }")
    motion = make_motion(_read(tmp_path, text), character)
    np.testing.assert_allclose(character.mirror(motion.poses), motion.poses, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("neck = {", "nek = {", "key 2.nek is not a key of .*neck.*allowed: "),
        ("flexion = 20", "flexoin = 20", "key 2.neck.flexoin .*flexion, lateral, rotation"),
        ("flexion = 20", "flexion = 200", "key 2.neck.flexion: .*75, got 200"),
        ("flexion = 20", 'flexion = "up"', "key 2.neck.flexion: .*number, got 'up'"),
        ("flexion = 20", "flexion = nan", "key 2.neck.flexion: .*finite"),
        ('foot = "left"', 'foot = "middle"', "stance 1.foot: .*'left' or 'right', got 'middle'"),
        ("at = [0, 0.1]", "at = [0]", "stance 1.at: expected at least 2 values in brackets"),
        ("to = 1\n", "to = 0\n", "stance 1: 'to' .0. must be later than 'from'"),
        ("to = 1\n", "to = 7\n", "'to' is 7 s, but the last key is at 1 s"),
        ("time = 1", "time = 0", "keys must follow each other in time"),
        ("time = 0", "time = 0.5", "the first key must be at time 0"),
        ('kind = "idle"', 'kind = "reaction"', "'strategy' belongs to kind 'reaction'"),
        ('kind = "idle"', 'kind = "dance"', "kind: .*'walk'.*got 'dance'"),
        ('what = "Nods."', "", "what is missing"),
        ('what = "Nods."', "what = Nods", "is not valid TOML"),
        ("[[key]]\ntime = 1", "[[sway]]\nvalue = 'nose'", "sway.amplitude is missing"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(SpecError, match=says) as error:
        _read(tmp_path, SMALL.replace(old, new, 1))
    assert "small.toml" in str(error.value)


def test_wrong_sway_names_the_values(tmp_path: Path) -> None:
    sway = '\n[[sway]]\nvalue = "neck.flexoin"\namplitude = 1\nperiod = 2\n'
    with pytest.raises(SpecError, match=r"sway: unknown value.*'neck.flexion'"):
        _read(tmp_path, SMALL + sway)


def _read(folder: Path, text: str) -> BuiltinSpec:
    file = folder / "small.toml"
    file.write_text(text, encoding="utf-8")
    return read_spec(file)


def _spans(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return list(zip(edges[::2], edges[1::2], strict=True))
