"""Impacts and their preparation: flight, direction, timing, and the push."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact, Punch, Push, Strike
from dynresp.physics.prepared_impact import PreparedImpact, prepare, push_profile, sphere_inertia
from dynresp.physics.scene import ImpactorKind, PhysicsConfig
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup, Trace
from dynresp.support.errors import DynrespError, SpecError
from tests.physics.conftest import SceneMaker
from tests.physics.samples import punching, setups_of, simulation_of, standing, walking


@pytest.fixture(scope="module")
def base(character: Character) -> Motion:
    return walking(character, yaw=0.9)


def _without_character(scene_of: SceneMaker, setups: list[Setup]) -> list[Trace]:
    """The flight of impacts with the character far away."""
    away = np.zeros(59)
    away[:2] = 50.0
    moved = [replace(setup, base=setup.base + away) for setup in setups]
    return Simulation(scene_of(setups[0].impact.kind), moved, 1).look_ahead(0.1)


def _when_due(trace: Trace, impact: PreparedImpact, fps: float) -> tuple[FloatArray, FloatArray]:
    """Position and velocity of the impactor when it is due."""
    assert trace.impactor is not None
    path, at = trace.impactor[:, :3], impact.due_s * fps
    low = int(at)
    step = path[low + 1] - path[low]
    return path[low] + (at - low) * step, step * fps


@pytest.mark.parametrize(
    "impact",
    [
        Ball(1.5),
        Ball(1.517, speed=4.0, from_deg=70.0),
        Ball(1.44, speed=14.0, from_deg=-120.0, elevation_deg=35.0, target="left_thigh"),
        Ball(1.6, height=1.3, from_deg=180.0, elevation_deg=-20.0),
        Ball(1.6, mass=1.0, radius=0.03, target="head"),
        Punch(1.533, from_deg=30.0, elevation_deg=10.0),
    ],
)
def test_passes_through_its_target_when_it_is_due(
    character: Character,
    config: PhysicsConfig,
    scene_of: SceneMaker,
    base: Motion,
    impact: Ball,
) -> None:
    setups = setups_of(character, base, [impact], config)
    trace = _without_character(scene_of, setups)[0]
    assert trace.contact is None
    place, velocity = _when_due(trace, setups[0].impact, base.fps)
    pose = base.sample([impact.time])
    target = character.kinematics(pose).centers[0, character.body(impact.target)]
    if impact.height is not None:
        target = np.array([*pose[0, :2], impact.height])
    # A semi-implicit step falls by g t dt / 2 too much: 4 mm in 0.2 s.
    np.testing.assert_allclose(place, target, atol=0.006)
    facing = float(rotations.yaw_of(pose[0, ROOT_QUAT]))
    bearing = facing + math.radians(impact.from_deg)
    height = math.radians(impact.elevation_deg)
    comes_from = np.array(
        [
            math.cos(height) * math.cos(bearing),
            math.cos(height) * math.sin(bearing),
            math.sin(height),
        ]
    )
    np.testing.assert_allclose(velocity, -impact.speed * comes_from, atol=0.25)


@pytest.mark.parametrize("side", [-0.4, 0.25])
def test_offset_is_to_the_throwers_right(
    character: Character, config: PhysicsConfig, scene_of: SceneMaker, base: Motion, side: float
) -> None:
    middle, beside = Ball(1.5, from_deg=40.0), Ball(1.5, from_deg=40.0, offset=side)
    setups = setups_of(character, base, [middle, beside], config)
    a, b = (
        _when_due(trace, setups[0].impact, base.fps)
        for trace in _without_character(scene_of, setups)
    )
    ahead = a[1] / np.linalg.norm(a[1])
    right = np.array([ahead[1], -ahead[0], 0.0])
    np.testing.assert_allclose(b[0] - a[0], side * right, atol=0.02)


@pytest.mark.parametrize(("height", "speed"), [(0.15, 4.0), (0.15, 12.0), (0.25, 8.0), (0.3, 8.0)])
def test_a_low_ball_passes_through_its_target(
    character: Character,
    config: PhysicsConfig,
    scene_of: SceneMaker,
    base: Motion,
    height: float,
    speed: float,
) -> None:
    setups = setups_of(character, base, [Ball(1.5, speed=speed, height=height)], config)
    trace = _without_character(scene_of, setups)[0]
    place, _ = _when_due(trace, setups[0].impact, base.fps)
    assert place[2] == pytest.approx(height, abs=0.05)


@pytest.mark.parametrize("from_deg", [90.0, 180.0])
def test_a_slow_ball_starts_clear_of_the_character(
    character: Character, scene_of: SceneMaker, base: Motion, from_deg: float
) -> None:
    ball = Ball(1.5, speed=2.0, from_deg=from_deg)
    trace = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, [ball]).look_ahead(0.1)[0]
    assert trace.contact is not None
    assert trace.contact.time_s > 0.0


@pytest.mark.parametrize("radius", [0.6, 1.0])
def test_a_large_ball_starts_clear_of_the_character(
    character: Character, scene_of: SceneMaker, base: Motion, radius: float
) -> None:
    ball = Ball(1.5, speed=4.0, radius=radius, from_deg=180.0)
    trace = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, [ball]).look_ahead(0.1)[0]
    assert trace.contact is not None
    assert trace.contact.time_s > 0.0


class TestTiming:
    """When the simulation begins and the impact is due."""

    @pytest.mark.parametrize("time", [0.2, 0.2001, 0.7, 1.0, 1.0333, 2.95, 3.0])
    def test_an_impactor_starts_before(
        self, character: Character, config: PhysicsConfig, base: Motion, time: float
    ) -> None:
        for impact in (Ball(time), Punch(time), Strike(time, punching(character), 0.6)):
            prepared = prepare(impact, base, character, config)
            assert prepared.start / base.fps + prepared.due_s == pytest.approx(time)
            assert 0.2 - 1e-6 <= prepared.due_s < 0.2 + 1.0 / base.fps

    @pytest.mark.parametrize("time", [0.0, 0.01, 1.0, 3.0])
    def test_a_push_needs_no_time(
        self, character: Character, config: PhysicsConfig, base: Motion, time: float
    ) -> None:
        prepared = prepare(Push(time), base, character, config)
        assert 0.0 <= prepared.due_s < 1.0 / base.fps
        assert prepared.push_start_s == prepared.due_s
        assert prepared.impactor_pose is None

    @pytest.mark.parametrize("time", [0.0, 0.1, 3.001, 1e5])
    def test_refuses_times_outside_the_base_motion(
        self, character: Character, config: PhysicsConfig, base: Motion, time: float
    ) -> None:
        with pytest.raises(SpecError, match=r"0\.2 to 3 s"):
            prepare(Ball(time), base, character, config)

    def test_refuses_a_strike_outside_its_motion(
        self, character: Character, config: PhysicsConfig, base: Motion
    ) -> None:
        with pytest.raises(SpecError, match="motion_time"):
            prepare(Strike(1.0, punching(character), 9.0), base, character, config)

    @pytest.mark.parametrize(
        "impact",
        [Ball(1.0, target="nose"), Push(1.0, target="nose"), Punch(1.0, target="nose")],
    )
    def test_refuses_unknown_bodies(
        self, character: Character, config: PhysicsConfig, base: Motion, impact: Impact
    ) -> None:
        with pytest.raises(DynrespError, match="head"):
            prepare(impact, base, character, config)


@pytest.mark.parametrize(
    ("impact_type", "numbers"),
    [
        (Ball, {"time": math.nan}),
        (Ball, {"time": 1.0, "speed": math.inf}),
        (Ball, {"time": 1.0, "mass": 0.0}),
        (Ball, {"time": 1.0, "radius": -0.1}),
        (Ball, {"time": 1.0, "from_deg": math.nan}),
        (Ball, {"time": 1.0, "offset": math.nan}),
        (Ball, {"time": 1.0, "height": -2.0}),
        (Punch, {"time": 1.0, "speed": -3.0}),
        (Push, {"time": 1.0, "duration": 0.0}),
        (Push, {"time": 1.0, "force": math.nan}),
    ],
)
def test_refuses_numbers_out_of_bounds(impact_type: type[Ball], numbers: dict[str, float]) -> None:
    wrong = list(numbers)[-1]
    with pytest.raises(SpecError, match=wrong):
        impact_type(**numbers)


def test_refuses_what_is_not_a_number() -> None:
    with pytest.raises(SpecError, match="mass must be a number, got '6 kg'"):
        Ball(1.0, mass="6 kg")  # type: ignore[arg-type]
    with pytest.raises(SpecError, match=r"mass must be from 0\.01 to 200 kg, got 500"):
        Ball(1.0, mass=500.0)


class TestPush:
    """A force on a body over time."""

    def test_profile_is_a_half_sine(self) -> None:
        times = np.linspace(-0.1, 0.5, 601)
        share = push_profile(times, 0.1, 0.2)
        inside = (times >= 0.1) & (times <= 0.3)
        expected = [math.sin(math.pi * (t - 0.1) / 0.2) for t in times[inside]]
        np.testing.assert_allclose(share[inside], expected, atol=1e-12)
        assert not share[~inside].any()
        assert share.max() == pytest.approx(1.0, abs=1e-4)

    @pytest.mark.parametrize("from_deg", [0.0, 90.0, 200.0])
    @pytest.mark.parametrize("target", ["chest", "left_foot"])
    @pytest.mark.parametrize(("time", "duration"), [(1.0, 0.2), (1.013, 0.33)])
    def test_gives_the_impulse_of_its_half_sine(
        self,
        character: Character,
        scene_of: SceneMaker,
        target: str,
        from_deg: float,
        time: float,
        duration: float,
    ) -> None:
        """In the air, where nothing else pushes sideways: 2 / pi F T."""
        high = standing(character).moved(0.4, (0.0, 0.0, 5.0))
        push = Push(time, 300.0, duration, from_deg, 15.0, target)
        simulation = simulation_of(scene_of(ImpactorKind.NONE), high, [push])
        trace = simulation.look_ahead(0.5)[0]
        centers = character.kinematics(trace.poses).centers
        body = np.einsum("b,fbi->fi", character.masses, centers)
        momentum = (body[-1] - body[-2]) * high.fps
        bearing, up = 0.4 + math.radians(from_deg), math.radians(15.0)
        impulse = 2.0 / math.pi * 300.0 * duration * math.cos(up)
        expected = -impulse * np.array([math.cos(bearing), math.sin(bearing)])
        np.testing.assert_allclose(momentum[:2], expected, atol=0.01 * impulse)

    def test_presses_down_with_elevation(
        self, character: Character, config: PhysicsConfig, base: Motion
    ) -> None:
        prepared = prepare(Push(1.0, force=100.0, elevation_deg=30.0), base, character, config)
        assert prepared.push_force is not None
        assert prepared.push_force[2] == pytest.approx(-50.0)

    @pytest.mark.parametrize("target", ["head", "right_forearm", "left_foot", "pelvis"])
    def test_moves_the_body_it_acts_on_most(
        self, character: Character, scene_of: SceneMaker, target: str
    ) -> None:
        high = standing(character).moved(0.0, (0.0, 0.0, 5.0))
        push = Push(1.0, 800.0, 0.1, 180.0, target=target)
        trace = simulation_of(scene_of(ImpactorKind.NONE), high, [push]).look_ahead(0.1)[0]
        assert trace.contact is not None
        assert trace.contact.body == target
        centers = character.kinematics(trace.poses[[0, 3]]).centers
        went = centers[1, :, 0] - centers[0, :, 0]
        assert int(np.argmax(went)) == character.body(target)

    @pytest.mark.parametrize(
        ("time", "frame"), [(1.0, 0), (1.0 + 1 / 240, 1), (1.02, 1), (1.0 + 1 / 30 - 1e-6, 1)]
    )
    def test_contact_is_when_it_begins(
        self, character: Character, scene_of: SceneMaker, time: float, frame: int
    ) -> None:
        base = standing(character)
        simulation = simulation_of(scene_of(ImpactorKind.NONE), base, [Push(time)])
        trace = simulation.look_ahead(0.1)[0]
        assert trace.contact is not None
        step = 1.0 / (simulation.fps * simulation.substeps)
        start = simulation.setups[0].impact.start / base.fps
        assert start + trace.contact.time_s == pytest.approx(time, abs=0.5 * step + 1e-9)
        assert trace.contact.frame == frame
        assert trace.contact.force == pytest.approx(600.0)
        assert trace.impactor is None
        chest = character.kinematics(trace.poses).centers[0, character.body("chest")]
        np.testing.assert_allclose(trace.contact.point, chest, atol=0.01)

    def test_goes_on_after_a_rewind(self, character: Character, scene_of: SceneMaker) -> None:
        """A push that is not over at the exit goes on while other targets are tracked."""
        high = standing(character).moved(0.0, (0.0, 0.0, 8.0))
        push = Push(1.0, 400.0, 0.4)
        simulation = simulation_of(scene_of(ImpactorKind.NONE), high, [push])
        simulation.look_ahead(0.1)
        trace = simulation.follow([0], [2], [high.poses[:20]], 15)[0]
        centers = character.kinematics(trace.poses).centers
        body = np.einsum("b,fbi->fi", character.masses, centers)
        momentum = (body[-1] - body[-2])[0] * high.fps
        assert momentum == pytest.approx(-2.0 / math.pi * 400.0 * 0.4, rel=0.01)


def test_sphere_inertia_is_that_of_a_solid_ball(rng: np.random.Generator) -> None:
    """Against the mean of points in a ball."""
    points = rng.uniform(-0.3, 0.3, size=(400_000, 3))
    inside = points[np.linalg.norm(points, axis=1) <= 0.3]
    mean = 5.0 * float(np.mean(inside[:, 0] ** 2 + inside[:, 1] ** 2))
    assert sphere_inertia(5.0, 0.3) == pytest.approx(mean, rel=0.01)
