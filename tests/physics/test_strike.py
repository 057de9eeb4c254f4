"""The strike of a second character: where it stands, and the arm that hits."""

import math

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Strike
from dynresp.physics.prepared_impact import PreparedImpact, prepare
from dynresp.physics.scene import ImpactorKind, PhysicsConfig, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup
from dynresp.support.errors import DynrespError
from tests.physics.conftest import SceneMaker
from tests.physics.samples import about_y, punching, setups_of, simulation_of, standing, turned
from tests.physics.samples import walking as walk


@pytest.fixture(scope="module")
def base(character: Character) -> Motion:
    return walk(character, yaw=-0.8)


def _fists(character: Character, forearm: FloatArray, side: str = "right") -> FloatArray:
    """Middle of the hand (frames, 3) from poses of the forearm (frames, 7)."""
    hand = character.model.geom(f"{side}_hand").pos
    places: FloatArray = forearm[:, :3] + rotations.rotate(forearm[:, 3:], hand)
    return places


def _at_due(rows: FloatArray, impact: PreparedImpact, fps: float) -> FloatArray:
    low = int(impact.due_s * fps)
    part = impact.due_s * fps - low
    value: FloatArray = (1.0 - part) * rows[low] + part * rows[low + 1]
    return value


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 200.0])
@pytest.mark.parametrize("target", ["chest", "head"])
@pytest.mark.parametrize("strike_fps", [30.0, 50.0, 120.0])
@pytest.mark.parametrize("time", [1.5, 1.517])
def test_the_fist_is_over_its_target_when_it_is_due(
    character: Character,
    config: PhysicsConfig,
    base: Motion,
    from_deg: float,
    target: str,
    strike_fps: float,
    time: float,
) -> None:
    motion = punching(character, fps=strike_fps).moved(1.3, (4.0, -3.0, 0.0))
    prepared = prepare(
        Strike(time, motion, 0.6, from_deg=from_deg, target=target), base, character, config
    )
    assert prepared.strike_poses is not None
    assert prepared.opponent is not None
    fist = _at_due(_fists(character, prepared.strike_poses), prepared, base.fps)
    aim = character.kinematics(base.sample([time])).centers[0, character.body(target)]
    np.testing.assert_allclose(fist[:2], aim[:2], atol=0.03)
    # It keeps its own height, and the striker is the forearm of the placed character.
    own = motion.sample([0.6])
    height = character.kinematics(own)
    forearm = character.body("right_forearm")
    there = np.concatenate([height.positions[:, forearm], height.quaternions[:, forearm]], axis=1)
    # (The path is straight between frames, the punch is not.)
    assert fist[2] == pytest.approx(_fists(character, there)[0, 2], abs=0.03)
    states = character.kinematics(prepared.opponent.poses)
    np.testing.assert_allclose(states.positions[:, forearm], prepared.strike_poses[:, :3])
    # The opponent is in the direction that the strike comes from, and faces the character.
    pose = base.sample([time])[0]
    bearing = float(rotations.yaw_of(pose[ROOT_QUAT])) + math.radians(from_deg)
    stands = _at_due(prepared.opponent.poses, prepared, base.fps)[:2] - aim[:2]
    toward = np.array([math.cos(bearing), math.sin(bearing)])
    assert stands @ toward / np.linalg.norm(stands) > math.cos(math.radians(30.0))


@pytest.mark.parametrize("side", ["left", "right"])
def test_either_arm_strikes(
    character: Character, config: PhysicsConfig, base: Motion, side: str
) -> None:
    motion = punching(character)
    if side == "left":
        motion = motion.mirrored(character)
    prepared = prepare(Strike(1.5, motion, 0.6, side=side), base, character, config)
    assert prepared.strike_poses is not None
    fist = _at_due(_fists(character, prepared.strike_poses, side), prepared, base.fps)
    aim = character.kinematics(base.sample([1.5])).centers[0, character.body("head")]
    np.testing.assert_allclose(fist[:2], aim[:2], atol=0.03)
    with pytest.raises(DynrespError):
        prepare(Strike(1.5, motion, 0.6, side="upper"), base, character, config)


def test_an_opponent_that_turns_faces_the_character_when_it_strikes(
    character: Character, config: PhysicsConfig
) -> None:
    poses = punching(character).poses.copy()
    poses[:, ROOT_QUAT] = rotations.from_yaw(np.linspace(-2.0, 0.0, len(poses)))
    base = standing(character)
    strike = Strike(1.5, Motion(poses, 30.0, "turning"), 0.6)
    prepared = prepare(strike, base, character, config)
    assert prepared.opponent is not None
    when = _at_due(prepared.opponent.poses, prepared, base.fps)
    assert abs(abs(float(rotations.yaw_of(when[ROOT_QUAT]))) - math.pi) < math.radians(20.0)


def _jab(character: Character, fast: float = 1.0) -> Motion:
    """An arm that is raised before the simulation begins and then shoots straight ahead."""
    time = np.arange(91) / 60.0
    out = np.exp(-(((time - 0.6) / (0.1 / fast)) ** 2))
    elbow = -2.3 + 2.2 * out
    shoulder = -0.45 - 1.05 * out
    joints = {"right_shoulder": about_y(shoulder), "right_elbow": about_y(elbow)}
    return Motion(turned(character, joints, 91), 60.0, "jab")


def _off_its_path(character: Character, scene: Scene, fast: float) -> tuple[FloatArray, int, float]:
    """How far the fist is from its path [m], the frame it is due in, and its top speed [m/s].

    The character is far away, so that the strike is not stopped.
    """
    base = standing(character)
    strike = Strike(1.5, _jab(character, fast), 0.6)
    setup = setups_of(character, base, [strike], scene.config)[0]
    away = np.zeros(59)
    away[:2] = 50.0
    trace = Simulation(scene, [Setup(setup.base + away, setup.impact)], 1).look_ahead(0.1)[0]
    assert trace.contact is None
    assert trace.impactor is not None
    assert setup.impact.strike_poses is not None
    path = _fists(character, setup.impact.strike_poses[: len(trace.impactor)])
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1).max() * base.fps
    off = np.linalg.norm(_fists(character, trace.impactor) - path, axis=1)
    return off, round(setup.impact.due_s * base.fps), float(speed)


def test_the_arm_follows_its_recorded_path_until_it_hits(
    character: Character, scene_of: SceneMaker
) -> None:
    off, due, speed = _off_its_path(character, scene_of(ImpactorKind.STRIKER), 1.0)
    assert speed > 3.0
    assert off[: due + 1].max() < 0.04
    assert off[due] < 0.015


@pytest.mark.parametrize(("fast", "worst"), [(1.0, 0.025), (1.6, 0.045), (2.2, 0.065)])
def test_it_leaves_its_path_little_at_any_speed(
    character: Character, scene_of: SceneMaker, fast: float, worst: float
) -> None:
    """The weld that draws the arm is soft, like a shoulder."""
    off, due, _ = _off_its_path(character, scene_of(ImpactorKind.STRIKER), fast)
    assert off[: due + 1].max() < worst


def test_it_hits_its_target_and_pushes_it(
    character: Character, scene_of: SceneMaker, base: Motion
) -> None:
    strike, slow = _jab(character), _jab(character, 0.4)
    impacts = [Strike(1.5, motion, 0.6, target="chest") for motion in (strike, slow)]
    simulation = simulation_of(scene_of(ImpactorKind.STRIKER), base, impacts)
    traces = simulation.look_ahead(0.3)
    for trace, setup in zip(traces, simulation.setups, strict=True):
        assert trace.contact is not None
        assert trace.diverged is None
        # The surface is hit before the centre of the target.
        assert -0.15 < trace.contact.time_s - setup.impact.due_s < 0.02
    hit = traces[0]
    assert hit.contact is not None
    chest = character.kinematics(hit.poses).centers[:, character.body("chest")]
    ahead = rotations.rotate(
        rotations.from_yaw(rotations.yaw_of(hit.poses[0, ROOT_QUAT])), np.array([1.0, 0.0, 0.0])
    )
    at = hit.contact.frame
    before = (chest[at - 1] - chest[at - 2]) @ ahead * base.fps
    after = (chest[at + 3] - chest[at + 2]) @ ahead * base.fps
    assert after < before - 0.3


def test_the_strike_lasts_as_long_as_the_simulation(
    character: Character, config: PhysicsConfig, base: Motion
) -> None:
    """The recorded path goes on after the due time; the opponent stands when it has ended."""
    motion = punching(character)
    prepared = prepare(Strike(1.5, motion, motion.duration), base, character, config)
    assert prepared.strike_poses is not None
    assert len(prepared.strike_poses) / base.fps > prepared.due_s + 2.0
    np.testing.assert_allclose(np.diff(prepared.strike_poses[-20:], axis=0), 0.0, atol=1e-12)
