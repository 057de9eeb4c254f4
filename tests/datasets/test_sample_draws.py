import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.dataset_spec_reader import parse_dataset_spec
from dynresp.datasets.sample_draws import TAIL_S, check_durations, draw_sample
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.physics.impacts import Ball, Push
from dynresp.physics.prepared_impact import prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.support.errors import SpecError

from .samples import plan

DURATIONS = (12.0, 5.0)


def planned(*impacts: dict[str, object], bases: int = 1) -> DatasetSpec:
    return parse_dataset_spec(
        {
            "plan": {"name": "x", "count": 1},
            "base": [{"motion": f"builtin:{i}"} for i in range(bases)],
            "impact": list(impacts),
        }
    )


@given(index=st.integers(0, 10_000_000), seed=st.integers(0, 2**63 - 1))
def test_a_sample_depends_on_seed_and_index_alone(index: int, seed: int) -> None:
    one = draw_sample(plan(seed=seed), DURATIONS, index)
    assert one == draw_sample(plan(seed=seed, count=1, name="y"), DURATIONS, index)
    assert one != draw_sample(plan(seed=seed), DURATIONS, index + 1)


def test_golden_numbers() -> None:
    # NamedMotion with NumPy 2.4: a dataset that is begun must go on with the same samples.
    sample = draw_sample(plan(), DURATIONS, 3)
    assert (sample.base, sample.table, sample.values["kind"]) == GOLDEN[:3]
    assert sample.phase == pytest.approx(GOLDEN[3], abs=1e-12)
    assert sample.values["time_s"] == pytest.approx(GOLDEN[4], abs=1e-12)


GOLDEN = (1, 0, "ball", 0.639093666561746, 2.628555932934635)


def test_values_lie_in_their_ranges_and_fill_them() -> None:
    samples = [draw_sample(plan(), DURATIONS, i) for i in range(600)]
    balls = [s.impact for s in samples if isinstance(s.impact, Ball)]
    pushes = [s.impact for s in samples if isinstance(s.impact, Push)]
    speeds = np.array([ball.speed for ball in balls])
    assert 4.0 <= speeds.min() < 4.5
    assert 13.5 < speeds.max() <= 14.0
    assert {push.target for push in pushes} == {"chest", "pelvis"}
    # Weights 1 and 0.5, 2 and 1.
    assert len(balls) / len(samples) == pytest.approx(2 / 3, abs=0.06)
    assert np.mean([s.base == 0 for s in samples]) == pytest.approx(2 / 3, abs=0.06)
    phases = np.array([s.phase for s in samples])
    assert np.histogram(phases, 5, (0.0, 1.0))[0] == pytest.approx(120, abs=35)


@pytest.mark.parametrize(
    "impact",
    [
        {"kind": "ball", "speed_m_s": 2, "radius_m": 0.5},
        {"kind": "ball", "speed_m_s": {"uniform": [2, 30]}, "radius_m": {"choice": [0.02, 0.5]}},
        {"kind": "punch"},
        {"kind": "push"},
    ],
)
@pytest.mark.parametrize("phase", [0, 1, 0.3])
def test_every_sample_can_be_simulated(
    impact: dict[str, object], phase: float, character: Character
) -> None:
    base = Motion(np.repeat(character.rest_pose[None], 91, axis=0), 30.0)
    found = planned({**impact, "phase": phase})
    for index in range(20):
        sample = draw_sample(found, [base.duration], index)
        prepared = prepare(sample.impact, base, character, PhysicsConfig())
        assert sample.impact.time <= base.duration - TAIL_S + 1e-9
        if phase == 0:
            assert prepared.start == 0
        if phase == 1:
            assert sample.impact.time == pytest.approx(base.duration - TAIL_S)


def test_a_base_motion_that_is_too_short_is_refused() -> None:
    found = planned({"kind": "ball", "speed_m_s": {"uniform": [2, 9]}}, {"kind": "push"}, bases=2)
    check_durations(found, [9.0, 1.42])
    with pytest.raises(SpecError, match=r"base: 'builtin:1' lasts 1\.40 s; .* at least 1\.41 s"):
        check_durations(found, [9.0, 1.40])
    check_durations(planned({"kind": "push"}), [1.0])
