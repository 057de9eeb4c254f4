import tomllib

import numpy as np
import pytest

from dynresp.experiments.experiment_reader import parse_experiment
from dynresp.motion.character import Character
from dynresp.physics.drawn_hits import draw_hits
from dynresp.physics.impact_spec import ImpactTable
from dynresp.physics.impacts import Ball, Punch, Push, Strike
from tests.experiments.samples import swaying


def table(text: str) -> ImpactTable:
    content = f'[experiment]\nname="x"\n[base]\nmotion="builtin:walk"\n[[impact]]\n{text}'
    return parse_experiment(tomllib.loads(content)).impact[0]


def test_keys_with_units_become_attributes() -> None:
    ball = table(
        'kind="ball"\ntime_s=1\nmass_kg=5\nradius_m=0.1\nspeed_m_s=9\nfrom_deg=90\n'
        'elevation_deg=20\ntarget="head"\nheight_m=1.5\noffset_m=0.1'
    )
    (hit,) = draw_hits(ball, 0, range(1))
    assert hit.impact == Ball(1.0, 9.0, 5.0, 0.1, 90.0, 20.0, "head", 1.5, 0.1)
    push = table('kind="push"\ntime_s=1\nforce_n=500\nduration_s=0.3\ntarget="pelvis"')
    (hit,) = draw_hits(push, 0, range(1))
    assert hit.impact == Push(1.0, 500.0, 0.3, 0.0, 0.0, "pelvis")


def test_missing_keys_have_the_defaults_of_the_impact() -> None:
    for kind, default in (("ball", Ball(1.0)), ("punch", Punch(1.0)), ("push", Push(1.0))):
        (hit,) = draw_hits(table(f'kind="{kind}"\ntime_s=1'), 0, range(1))
        assert hit.impact == default


def test_a_strike_brings_its_motion(character: Character) -> None:
    strike = table('kind="strike"\ntime_s=1\n[impact.striker]\nmotion="builtin:punch"\nhit_s=0.5')
    motion = swaying(character, 1.0, 10.0)
    (hit,) = draw_hits(strike, 0, range(1), motion, 0.5, "left")
    assert isinstance(hit.impact, Strike)
    assert hit.impact.motion is motion
    assert (hit.impact.motion_time, hit.impact.side) == (0.5, "left")
    assert "striker" not in hit.values


def test_a_hit_depends_on_seed_and_number_alone() -> None:
    ball = table('kind="ball"\ntime_s={uniform=[1,2]}\nspeed_m_s={uniform=[4,14]}')
    many, late = draw_hits(ball, 7, range(5)), draw_hits(ball, 7, range(3, 5))
    assert many[3:] == late
    assert len({hit.values["time_s"] for hit in many}) == 5
    assert draw_hits(ball, 8, range(1)) != many[:1]


def test_draws_stay_in_their_range() -> None:
    ball = table(
        'kind="ball"\ntime_s=1\nspeed_m_s={uniform=[4,14]}\nmass_kg={choice=[3,8]}\n'
        'target={choice=["head","chest"]}'
    )
    hits = draw_hits(ball, 1, range(300))
    speeds = np.array([hit.values["speed_m_s"] for hit in hits])
    assert speeds.min() >= 4.0
    assert speeds.max() <= 14.0
    assert speeds.mean() == pytest.approx(9.0, abs=0.6)
    assert {hit.values["mass_kg"] for hit in hits} == {3.0, 8.0}
    assert {hit.values["target"] for hit in hits} == {"head", "chest"}
