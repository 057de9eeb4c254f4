"""Where and when the first contact is found, and its effect."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Punch, Strike
from dynresp.physics.scene import ImpactorKind, PhysicsConfig
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Contact, Trace
from tests.oracles.stepping import SlowSimulation, compile_for
from tests.physics.conftest import SceneMaker
from tests.physics.samples import punching, setups_of, simulation_of, standing, walking

THROWS = 50


@pytest.fixture(scope="module")
def high(character: Character) -> Motion:
    """Standing in the air, so that nothing but the impact pushes sideways."""
    return standing(character).moved(0.0, (0.0, 0.0, 5.0))


def _throws(rng: np.random.Generator, count: int) -> list[Ball]:
    return [
        Ball(
            time=float(rng.uniform(0.7, 2.0)),
            speed=float(rng.uniform(4.0, 14.0)),
            mass=float(rng.uniform(1.0, 8.0)),
            radius=float(rng.uniform(0.03, 0.4)),
            from_deg=float(rng.uniform(-180.0, 180.0)),
            elevation_deg=float(rng.uniform(-10.0, 40.0)),
            height=float(rng.uniform(0.7, 1.7)),
            offset=float(rng.uniform(-0.5, 0.5)),
        )
        for _ in range(count)
    ]


def test_agrees_with_mjdata_on_random_throws(
    character: Character,
    config: PhysicsConfig,
    scene_of: SceneMaker,
    rng: np.random.Generator,
    tmp_path: Path,
) -> None:
    base = walking(character, yaw=2.0)
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, _throws(rng, THROWS), 2)
    traces = simulation.look_ahead(0.1)
    hits = 0
    for trace, setup in zip(traces, simulation.setups, strict=True):
        slow = SlowSimulation(character, setup, config, tmp_path)
        if trace.contact is None:
            assert slow.run(slow.frames_until_miss).contact_step is None
            continue
        hits += 1
        seen = slow.run(trace.contact.frame + 1)
        assert seen.contact_step is not None
        assert round(trace.contact.time_s * config.fps * config.substeps) == seen.contact_step
        assert trace.contact.body in seen.forces
        assert trace.contact.force == pytest.approx(seen.forces[trace.contact.body], rel=1e-9)
        np.testing.assert_array_equal(trace.poses[: trace.contact.frame + 2], seen.poses)
    assert THROWS // 2 <= hits < THROWS


def test_a_miss_ends_without_contact(character: Character, scene_of: SceneMaker) -> None:
    base = walking(character)
    impacts = [Ball(1.5, offset=2.0), Punch(1.5, offset=-2.0), Ball(1.5)]
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, impacts)
    *missed, hit = simulation.look_ahead(0.8)
    assert hit.contact is not None
    for trace, setup in zip(missed, simulation.setups[:2], strict=True):
        assert trace.contact is None
        assert trace.diverged is None
        waited = (len(trace.poses) - 1) / base.fps - setup.impact.due_s
        assert 0.2 <= waited + 1e-9 < 0.2 + 1.0 / base.fps + 1e-9
        # The character goes on as before, held to the base motion.
        off = trace.poses[:, :3] - setup.base[: len(trace.poses), :3]
        assert np.abs(off).max() < 0.03


def _first(trace: Trace) -> Contact:
    assert trace.contact is not None
    return trace.contact


def _in_facing_frame(trace: Trace, points: FloatArray) -> FloatArray:
    """Points relative to the pelvis at contact: ahead, to the left, up."""
    root = trace.poses[_first(trace).frame]
    back = rotations.from_yaw(-rotations.yaw_of(root[ROOT_QUAT]))
    seen: FloatArray = rotations.rotate(back, points - root[:3])
    return seen


@pytest.mark.parametrize("radius", [0.02, 0.06, 0.12, 0.25, 0.5])
@pytest.mark.parametrize("target", ["chest", "head", "left_forearm", "right_foot"])
def test_the_radius_is_where_contact_is(
    character: Character, scene_of: SceneMaker, high: Motion, radius: float, target: str
) -> None:
    """The ball has the radius that is set, against bodies of one geom and of two."""
    ball = Ball(1.5, speed=6.0, radius=radius, target=target)
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), high, [ball])
    trace = simulation.look_ahead(0.1)[0]
    contact = _first(trace)
    impact = simulation.setups[0].impact
    assert impact.impactor_pose is not None
    assert impact.impactor_velocity is not None
    fallen = np.array([0.0, 0.0, -0.5 * 9.81 * contact.time_s**2])
    center = impact.impactor_pose[:3] + impact.impactor_velocity[:3] * contact.time_s + fallen
    # Between touching and as deep as it gets in one step, which moves it by 2.5 cm.
    distance = float(np.linalg.norm(center - np.array(contact.point)))
    assert radius - 0.03 < distance < radius + 0.005


def test_a_larger_ball_touches_earlier_and_a_small_one_slips_by(
    character: Character, scene_of: SceneMaker, high: Motion
) -> None:
    radii = [0.03, 0.12, 0.3, 0.5]
    impacts = [Ball(1.5, speed=5.0, radius=radius) for radius in radii]
    beside = [Ball(1.5, speed=5.0, radius=radius, offset=0.5) for radius in radii]
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), high, impacts + beside)
    traces = simulation.look_ahead(0.05)
    # Relative to the due time: larger balls start earlier.
    times = [
        _first(trace).time_s - setup.impact.due_s
        for trace, setup in zip(traces[:4], simulation.setups, strict=False)
    ]
    assert times == sorted(times, reverse=True)
    # 3 cm in 5 m/s are 6 ms; a step is 4 ms.
    assert times[1] - times[3] == pytest.approx(0.38 / 5.0, abs=0.02)
    assert [trace.contact is None for trace in traces[4:]] == [True, True, False, False]


@pytest.mark.parametrize("radius", [0.02, 0.12, 0.5])
def test_the_batch_collides_like_a_model_compiled_with_that_ball(
    character: Character,
    config: PhysicsConfig,
    rng: np.random.Generator,
    tmp_path: Path,
    radius: float,
    scene_of: SceneMaker,
) -> None:
    """With the ball anywhere, the first frame finds contact if MuJoCo does."""
    base = standing(character)
    plain = setups_of(character, base, [Ball(1.0, radius=radius)], config)[0]
    model = compile_for(character, plain.impact, config, tmp_path)
    setups, expected = [], []
    for _ in range(150):
        place = np.array([*rng.uniform([-0.7, -0.7, 0.1], [0.7, 0.7, 2.0]), 1.0, 0.0, 0.0, 0.0])
        impact = replace(plain.impact, impactor_pose=place, impactor_velocity=np.zeros(6))
        setups.append(replace(plain, impact=impact))
        data = mujoco.MjData(model)
        data.qpos[:] = [*base.poses[0], *place]
        mujoco.mj_forward(model, data)
        bodies = [sorted(model.geom_bodyid[geom] for geom in c.geom) for c in data.contact]
        ball = model.body("impactor/ball").id
        expected.append(any(high == ball and low > 0 for low, high in bodies))
    simulation = Simulation(scene_of(ImpactorKind.PROJECTILE), setups, 2)
    found = []
    for trace in simulation.look_ahead(0.0):
        found.append(trace.contact is not None and trace.contact.time_s == 0.0)
    assert found == expected
    assert 1 <= sum(expected) < 145


class TestMomentum:
    """In the air the character gains what the impactor loses, apart from gravity."""

    @staticmethod
    def _of_character(character: Character, trace: Trace, frame: int) -> FloatArray:
        data = mujoco.MjData(character.model)
        data.qpos[:], data.qvel[:] = trace.poses[frame], trace.velocities[frame]
        mujoco.mj_forward(character.model, data)
        mujoco.mj_subtreeVel(character.model, data)
        momentum: FloatArray = data.subtree_linvel[1] * character.masses.sum()
        return momentum

    @pytest.mark.parametrize("from_deg", [0.0, 90.0, 215.0])
    @pytest.mark.parametrize("mass", [0.5, 4.0, 40.0])
    def test_a_balls(
        self,
        character: Character,
        scene_of: SceneMaker,
        high: Motion,
        mass: float,
        from_deg: float,
    ) -> None:
        ball = Ball(1.5, speed=8.0, mass=mass, from_deg=from_deg)
        trace = simulation_of(scene_of(ImpactorKind.PROJECTILE), high, [ball]).look_ahead(0.4)[0]
        assert trace.impactor is not None
        at = _first(trace).frame
        moved = np.diff(trace.impactor[:, :2], axis=0) * high.fps * mass
        # The step from one frame to the next is the mean velocity between them.
        lost = moved[at - 2] - moved[at + 3]
        gained = (
            self._of_character(character, trace, at + 3)
            - self._of_character(character, trace, at - 1)
        )[:2]
        assert np.linalg.norm(lost) > 0.3 * mass * 8.0
        np.testing.assert_allclose(gained, lost, atol=0.02 * float(np.linalg.norm(lost)))

    def test_a_heavier_ball_gives_more(
        self, character: Character, scene_of: SceneMaker, high: Motion
    ) -> None:
        masses = [1.0, 2.0, 4.0, 8.0, 16.0]
        balls = [Ball(1.5, mass=mass) for mass in masses]
        traces = simulation_of(scene_of(ImpactorKind.PROJECTILE), high, balls).look_ahead(0.2)
        given = [
            -self._of_character(character, trace, _first(trace).frame + 3)[0] for trace in traces
        ]
        assert np.all(np.diff(given) > 0)
        assert given[0] / given[1] == pytest.approx(0.5, abs=0.05)


def test_gravity_does_not_act_on_a_fist(
    character: Character, scene_of: SceneMaker, high: Motion
) -> None:
    impacts = [Punch(1.5, offset=2.0), Ball(1.5, offset=2.0)]
    fist, ball = simulation_of(scene_of(ImpactorKind.PROJECTILE), high, impacts).look_ahead(0.1)
    assert fist.impactor is not None
    assert ball.impactor is not None
    straight = np.diff(fist.impactor[:, :3], 2, axis=0)
    np.testing.assert_allclose(straight, 0.0, atol=1e-12)
    assert np.linalg.norm(np.diff(fist.impactor[:2, :3], axis=0)) * high.fps == pytest.approx(9.0)
    falling = np.diff(ball.impactor[:, :3], 2, axis=0) * high.fps**2
    np.testing.assert_allclose(falling, [[0.0, 0.0, -9.81]] * len(falling), atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 2.2, -1.0])
@pytest.mark.parametrize("impact_type", [Ball, Punch])
def test_comes_from_the_given_direction(
    character: Character, scene_of: SceneMaker, impact_type: type[Ball], yaw: float
) -> None:
    base = walking(character, yaw=yaw)
    bearings = {"front": 0.0, "left": 90.0, "behind": 180.0, "right": 270.0}
    impacts = [impact_type(1.5, target="chest", from_deg=deg) for deg in bearings.values()]
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, impacts)
    traces = dict(zip(bearings, simulation.look_ahead(0.2), strict=True))
    touch = {
        name: _in_facing_frame(trace, np.array(_first(trace).point))
        for name, trace in traces.items()
    }
    assert touch["front"][0] > 0.05
    assert touch["behind"][0] < -0.05
    assert touch["left"][1] > 0.1
    assert touch["right"][1] < -0.1
    # A tenth of a second later the chest has moved to the opposite side.
    pushed = {}
    for name, trace in traces.items():
        chest = character.kinematics(trace.poses).centers[:, character.body("chest")]
        seen = _in_facing_frame(trace, chest)
        at = _first(trace).frame
        went, would = seen[at + 3] - seen[at], 3.0 * (seen[at - 1] - seen[at - 2])
        pushed[name] = went - would
    assert pushed["front"][0] < -0.02
    assert pushed["behind"][0] > 0.02
    assert pushed["left"][1] < -0.02
    assert pushed["right"][1] > 0.02


def test_a_striking_arm_is_found_too(
    character: Character, config: PhysicsConfig, scene_of: SceneMaker, tmp_path: Path
) -> None:
    base, strike = walking(character, yaw=1.0), punching(character)
    impacts = [Strike(1.5, strike, 0.6, from_deg=deg) for deg in range(0, 360, 45)]
    simulation = simulation_of(scene_of(ImpactorKind.STRIKER), base, impacts, 2)
    for trace, setup in zip(simulation.look_ahead(0.1), simulation.setups, strict=True):
        slow = SlowSimulation(character, setup, config, tmp_path)
        seen = slow.run(_first(trace).frame + 1)
        assert seen.contact_step is not None
        steps = _first(trace).time_s * config.fps * config.substeps
        assert round(steps) == seen.contact_step
        assert _first(trace).body in seen.forces
