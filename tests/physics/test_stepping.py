"""A batch has the same bits as a plain loop of `mj_step`, alone or not, on any threads."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.physics.impacts import Ball, Impact, Punch, Push, Strike
from dynresp.physics.scene import ImpactorKind, PhysicsConfig, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup, Trace
from tests.oracles.stepping import SlowSimulation, Stepped
from tests.physics.conftest import SceneMaker
from tests.physics.samples import punching, setups_of, simulation_of, standing, walking

HORIZON_S = 0.4


def _impacts(kind: ImpactorKind, character: Character) -> list[Impact]:
    """Impacts of one kind that begin and hit at different times."""
    if kind is ImpactorKind.PROJECTILE:
        return [
            Ball(1.5),
            Ball(1.21, speed=11.0, mass=3.3, radius=0.3, from_deg=100.0, height=0.9),
            Ball(1.37, speed=5.0, radius=0.04, from_deg=-60.0, target="left_thigh"),
            Punch(1.4, from_deg=250.0),
            Ball(1.1, offset=2.0),
        ]
    if kind is ImpactorKind.NONE:
        return [Push(1.0), Push(1.123, 900.0, 0.31, 90.0, 20.0, "left_thigh")]
    strike = punching(character, fps=50.0)
    return [Strike(1.5, strike, 0.6, target="chest"), Strike(1.32, strike, 0.62, from_deg=120.0)]


def _same(trace: Trace, slow: Stepped) -> None:
    np.testing.assert_array_equal(trace.poses, slow.poses)
    np.testing.assert_array_equal(trace.velocities, slow.velocities)
    if trace.impactor is not None:
        np.testing.assert_array_equal(trace.impactor, slow.impactor)
    else:
        assert not slow.impactor


def _same_traces(some: Sequence[Trace], others: Sequence[Trace]) -> None:
    for one, other in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.poses, other.poses)
        np.testing.assert_array_equal(one.velocities, other.velocities)
        assert one.contact == other.contact
        assert one.diverged == other.diverged


def _length(slow: SlowSimulation, contact_step: int | None) -> int:
    """Frames of the look-ahead, from the contact in the plain loop."""
    if contact_step is None:
        return slow.frames_until_miss
    first_after = -(-contact_step // slow.config.substeps)
    return first_after + int(np.ceil(HORIZON_S * slow.config.fps - 1e-9))


@pytest.fixture(params=list(ImpactorKind), ids=lambda kind: kind.value)
def kind(request: pytest.FixtureRequest) -> ImpactorKind:
    return request.param


@pytest.fixture(scope="module")
def base(character: Character) -> Motion:
    return walking(character, yaw=0.7)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_equals_a_plain_loop(
    character: Character,
    config: PhysicsConfig,
    scene_of: SceneMaker,
    kind: ImpactorKind,
    base: Motion,
    threads: int,
    tmp_path: Path,
) -> None:
    simulation = simulation_of(scene_of(kind), base, _impacts(kind, character), threads)
    traces = simulation.look_ahead(HORIZON_S)
    for trace, setup in zip(traces, simulation.setups, strict=True):
        slow = SlowSimulation(character, setup, config, tmp_path)
        seen = slow.run(len(trace.poses) - 1)
        assert len(trace.poses) == _length(slow, seen.contact_step) + 1
        _same(trace, seen)
        if seen.contact_step is None:
            assert trace.contact is None
            continue
        assert trace.contact is not None
        assert round(trace.contact.time_s * config.fps * config.substeps) == seen.contact_step
        assert trace.contact.frame == -(-seen.contact_step // config.substeps)
        if seen.forces:
            assert trace.contact.body == max(seen.forces, key=lambda body: seen.forces[body])
            assert trace.contact.force == pytest.approx(max(seen.forces.values()), rel=1e-9)


def test_alone_equals_a_batch_in_any_order(
    character: Character, scene_of: SceneMaker, kind: ImpactorKind, base: Motion
) -> None:
    scene, impacts = scene_of(kind), _impacts(kind, character)
    together = simulation_of(scene, base, impacts, 2).look_ahead(HORIZON_S)
    backward = simulation_of(scene, base, impacts[::-1], 2).look_ahead(HORIZON_S)[::-1]
    alone = [simulation_of(scene, base, [impact]).look_ahead(HORIZON_S)[0] for impact in impacts]
    _same_traces(together, backward)
    _same_traces(together, alone)


def test_another_frame_rate_and_number_of_steps(
    character: Character, base: Motion, tmp_path: Path
) -> None:
    config = PhysicsConfig(fps=50.0, substeps=5)
    scene = Scene(character, ImpactorKind.PROJECTILE, config)
    simulation = simulation_of(scene, base.resampled(50.0), [Ball(1.517, from_deg=30.0)])
    trace = simulation.look_ahead(HORIZON_S)[0]
    seen = SlowSimulation(character, simulation.setups[0], config, tmp_path).run(
        len(trace.poses) - 1
    )
    _same(trace, seen)
    assert trace.contact is not None
    assert round(trace.contact.time_s * 250.0) == seen.contact_step


def test_a_base_motion_that_ends_is_held(
    character: Character, config: PhysicsConfig, scene_of: SceneMaker, tmp_path: Path
) -> None:
    base = walking(character, seconds=1.0)
    simulation = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, [Ball(base.duration)])
    trace = simulation.look_ahead(HORIZON_S)[0]
    slow = SlowSimulation(character, simulation.setups[0], config, tmp_path)
    _same(trace, slow.run(len(trace.poses) - 1))
    longer = Motion(np.concatenate([base.poses, base.poses[[-1] * 30]]), base.fps)
    again = simulation_of(scene_of(ImpactorKind.PROJECTILE), longer, [Ball(base.duration)])
    same = again.look_ahead(HORIZON_S)[0]
    _same_traces([trace], [same])


def _contact_frames(simulation: Simulation) -> list[int]:
    contacts = [simulation.contact(i) for i in range(len(simulation.setups))]
    return [contact.frame for contact in contacts if contact is not None]


class TestRewind:
    """Going back to a frame, and on from there."""

    @pytest.fixture
    def hits(self, kind: ImpactorKind, character: Character) -> list[Impact]:
        return [impact for impact in _impacts(kind, character) if getattr(impact, "offset", 0) < 1]

    @pytest.fixture
    def others(self, character: Character, base: Motion) -> np.ndarray:
        """Targets that are not the base motion."""
        return walking(character, speed=0.3).poses[11:30]

    def test_equals_a_plain_loop_that_starts_again(
        self,
        character: Character,
        config: PhysicsConfig,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
        tmp_path: Path,
    ) -> None:
        simulation = simulation_of(scene_of(kind), base, hits, 2)
        simulation.look_ahead(HORIZON_S)
        rows = list(range(len(hits)))
        frames = [frame + row % 3 for row, frame in enumerate(_contact_frames(simulation))]
        traces = simulation.follow(rows, frames, [others] * len(rows), 8)
        for trace, setup, frame in zip(traces, simulation.setups, frames, strict=True):
            slow = SlowSimulation(character, setup, config, tmp_path)
            _same(trace, slow.run(frame, others, 8))

    def test_the_base_motion_again_gives_the_same_bits(
        self, scene_of: SceneMaker, kind: ImpactorKind, hits: list[Impact], base: Motion
    ) -> None:
        simulation = simulation_of(scene_of(kind), base, hits, 2)
        before = simulation.look_ahead(HORIZON_S)
        frames = _contact_frames(simulation)
        rows = list(range(len(hits)))
        targets = [
            setup.base[frame:] for setup, frame in zip(simulation.setups, frames, strict=True)
        ]
        length = round(HORIZON_S * base.fps)
        _same_traces(before, simulation.follow(rows, frames, targets, length))

    def test_the_same_targets_again_give_the_same_bits(
        self,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
    ) -> None:
        simulation = simulation_of(scene_of(kind), base, hits, 2)
        simulation.look_ahead(HORIZON_S)
        frames, rows = _contact_frames(simulation), list(range(len(hits)))
        first, second, third = (
            simulation.follow(rows, frames, [others] * len(rows), 10) for _ in range(3)
        )
        _same_traces(first, second)
        _same_traces(first, third)

    def test_once_or_again_from_elsewhere_is_the_same(
        self,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
    ) -> None:
        once = simulation_of(scene_of(kind), base, hits)
        once.look_ahead(HORIZON_S)
        again = simulation_of(scene_of(kind), base, hits)
        again.look_ahead(HORIZON_S)
        frames = _contact_frames(once)
        rows = list(range(len(hits)))
        # First along other targets, then back to an earlier frame.
        again.follow(rows, [frame + 3 for frame in frames], [others[::-1]] * len(rows), 4)
        a = once.follow(rows, frames, [others] * len(rows), 9)
        b = again.follow(rows, frames, [others] * len(rows), 9)
        _same_traces(a, b)

    def test_rows_in_any_order(
        self,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
    ) -> None:
        one = simulation_of(scene_of(kind), base, hits, 2)
        kept = one.look_ahead(HORIZON_S)
        two = simulation_of(scene_of(kind), base, hits, 1)
        two.look_ahead(HORIZON_S)
        frames = _contact_frames(one)
        a = one.follow([1, 0], [frames[1], frames[0] + 2], [others, others[3:]], 6)
        b0 = two.follow([0], [frames[0] + 2], [others[3:]], 6)
        b1 = two.follow([1], [frames[1]], [others], 6)
        _same_traces(a, [*b1, *b0])
        # Simulations that did not go back are unchanged.
        np.testing.assert_array_equal(a[0].poses[: frames[1] + 1], kept[1].poses[: frames[1] + 1])

    def test_some_rows_equal_all_together(
        self,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
    ) -> None:
        one = simulation_of(scene_of(kind), base, hits, 2)
        two = simulation_of(scene_of(kind), base, hits, 1)
        one.look_ahead(HORIZON_S)
        two.look_ahead(HORIZON_S)
        frames = [frame + row for row, frame in enumerate(_contact_frames(one))][:2]
        together = one.follow([0, 1], frames, [others, others[3:]], 6)
        second = two.follow([1], frames[1:], [others[3:]], 6)
        first = two.follow([0], frames[:1], [others], 6)
        _same_traces(together, [*first, *second])

    def test_the_trace_ends_where_the_targets_were_followed_to(
        self,
        scene_of: SceneMaker,
        kind: ImpactorKind,
        hits: list[Impact],
        base: Motion,
        others: np.ndarray,
    ) -> None:
        simulation = simulation_of(scene_of(kind), base, hits)
        simulation.look_ahead(HORIZON_S)
        frame = _contact_frames(simulation)[0] + 2
        trace = simulation.follow([0], [frame], [others], 5)[0]
        assert len(trace.poses) == len(trace.velocities) == frame + 5 + 1
        assert simulation.follow([0], [frame], [others], 0)[0].poses.shape[0] == frame + 1


def test_the_character_starts_with_the_base_motions_velocities(
    character: Character, scene_of: SceneMaker, config: PhysicsConfig
) -> None:
    base = walking(character, speed=1.7, yaw=-1.1)
    setups = setups_of(character, base, [Ball(1.4), Ball(2.0)], config)
    assert setups[0].impact.start != setups[1].impact.start
    traces = Simulation(scene_of(ImpactorKind.PROJECTILE), setups, 1).look_ahead(0.1)
    for trace, setup in zip(traces, setups, strict=True):
        start = setup.impact.start
        np.testing.assert_array_equal(trace.poses[0], base.poses[start])
        # Within the change of the movement in half a frame.
        np.testing.assert_allclose(trace.velocities[0], base.velocities()[start], atol=0.4)
        speed = np.linalg.norm(trace.velocities[0, :2])
        assert speed == pytest.approx(1.7, rel=1e-6)


def test_standing_still_starts_at_rest(character: Character, scene_of: SceneMaker) -> None:
    simulation = simulation_of(scene_of(ImpactorKind.NONE), standing(character), [Push(1.0)])
    assert not simulation.look_ahead(0.1)[0].velocities[0].any()


def test_a_setup_of_one_frame_runs(
    character: Character, config: PhysicsConfig, scene_of: SceneMaker
) -> None:
    whole = setups_of(character, standing(character), [Push(1.0)], config)[0]
    short = Setup(whole.base[:1], whole.impact)
    a, b = Simulation(scene_of(ImpactorKind.NONE), [whole, short], 1).look_ahead(0.2)
    np.testing.assert_array_equal(a.poses, b.poses)


def test_frames_run_in_one_call_equal_frames_run_one_by_one(
    scene_of: SceneMaker, base: Motion, kind: ImpactorKind, character: Character
) -> None:
    simulation = simulation_of(scene_of(kind), base, _impacts(kind, character), 1)
    traces = simulation.look_ahead(HORIZON_S)
    again = simulation_of(scene_of(kind), base, _impacts(kind, character), 1)
    for i, trace in enumerate(traces):
        if trace.contact is None:
            continue
        while again.contact(i) is None:
            again.approach([i])
        left = len(trace.poses) - 1 - again.frame(i)
        again.go_on([i], 4)
        again.go_on([i], left - 4)
        np.testing.assert_array_equal(again.trace(i).poses, trace.poses)
        np.testing.assert_array_equal(again.trace(i).velocities, trace.velocities)
        # Back at the contact it gives the same again.
        again.rewind(i, trace.contact.frame)
        again.go_on([i], 6)
        np.testing.assert_array_equal(
            again.trace(i).velocities, trace.velocities[: trace.contact.frame + 7]
        )


def test_a_replaced_simulation_equals_one_alone(
    scene_of: SceneMaker, base: Motion, kind: ImpactorKind, character: Character
) -> None:
    impacts = _impacts(kind, character)
    simulation = simulation_of(scene_of(kind), base, impacts, 1)
    others = simulation_of(scene_of(kind), base, impacts[:1] * len(impacts), 1)
    others.look_ahead(HORIZON_S)
    expected = simulation.look_ahead(HORIZON_S)
    last = len(impacts) - 1
    others.replace(last, simulation.setups[last])
    before = others.trace(0)
    traces = others.look_ahead(HORIZON_S)
    np.testing.assert_array_equal(traces[last].velocities, expected[last].velocities)
    assert traces[last].contact == expected[last].contact
    np.testing.assert_array_equal(traces[0].velocities, before.velocities)


def test_a_replacement_clears_a_divergence(
    scene_of: SceneMaker, base: Motion, character: Character
) -> None:
    kind = ImpactorKind.PROJECTILE
    impacts = _impacts(kind, character)[:1]
    expected = simulation_of(scene_of(kind), base, impacts, 1)
    simulation = simulation_of(scene_of(kind), base, impacts, 1)
    simulation._batch.bind("qvel")[0, :6] = 1e12
    assert simulation.look_ahead(HORIZON_S)[0].diverged is not None
    simulation.replace(0, expected.setups[0])
    assert simulation.diverged(0) is None
    (again,), (trace,) = simulation.look_ahead(HORIZON_S), expected.look_ahead(HORIZON_S)
    np.testing.assert_array_equal(again.velocities, trace.velocities)


def test_a_divergence_while_going_on_has_its_frame(
    scene_of: SceneMaker, base: Motion, character: Character
) -> None:
    kind = ImpactorKind.PROJECTILE
    impacts = _impacts(kind, character)[:1]
    one_by_one, at_once = (simulation_of(scene_of(kind), base, impacts, 1) for _ in range(2))
    for simulation in (one_by_one, at_once):
        while simulation.contact(0) is None:
            simulation.approach([0])
        # So fast that it diverges only after some frames.
        simulation._batch.bind("qvel")[0, :3] = 3e5
    for _ in range(20):
        if one_by_one.diverged(0) is None:
            one_by_one.approach([0])
    at_once.go_on([0], 20)
    assert one_by_one.diverged(0) == at_once.diverged(0)
    assert one_by_one.diverged(0) is not None
