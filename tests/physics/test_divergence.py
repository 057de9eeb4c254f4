"""A simulation that diverges is reported, and changes no other."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.physics.impacts import Ball, Push
from dynresp.physics.scene import ImpactorKind
from dynresp.physics.trace import Trace
from tests.physics.conftest import SceneMaker
from tests.physics.samples import absurd_ball, beyond_bounds, simulation_of, walking

_ABSURD = absurd_ball(1.5)
_SANE = [Ball(1.5), Ball(1.21, from_deg=90.0), Ball(1.3, from_deg=180.0, height=0.8)]


@pytest.fixture(scope="module")
def base(character: Character) -> Motion:
    return walking(character)


def _same(one: Trace, other: Trace) -> None:
    np.testing.assert_array_equal(one.poses, other.poses)
    np.testing.assert_array_equal(one.velocities, other.velocities)
    assert one.contact == other.contact
    assert one.diverged is None
    assert other.diverged is None


@pytest.mark.parametrize("place", [0, 1, 3])
@pytest.mark.parametrize("threads", [1, 2])
def test_is_reported_and_leaves_the_others_alone(
    scene_of: SceneMaker, base: Motion, place: int, threads: int
) -> None:
    scene = scene_of(ImpactorKind.PROJECTILE)
    balls = [*_SANE[:place], _ABSURD, *_SANE[place:]]
    traces = simulation_of(scene, base, balls, threads).look_ahead(0.3)
    blown = traces.pop(place)
    assert blown.diverged is not None
    assert blown.diverged.warning in ("BADQACC", "BADQVEL", "BADQPOS")
    # Due 0.2 s after its start, so just before frame 6, or in it.
    assert 5 <= blown.diverged.frame <= 6
    assert len(blown.poses) == blown.diverged.frame + 1
    assert np.isfinite(blown.poses).all()
    assert np.isfinite(blown.velocities).all()
    assert np.abs(blown.poses[:, :3] - base.poses[39 : 39 + len(blown.poses), :3]).max() < 0.05
    for one, other in zip(
        traces, simulation_of(scene, base, _SANE, 1).look_ahead(0.3), strict=True
    ):
        _same(one, other)


def test_a_push_can_diverge_too(scene_of: SceneMaker, base: Motion) -> None:
    pushes = [Push(1.0), beyond_bounds(Push(1.0), force=1e9), Push(1.1)]
    traces = simulation_of(scene_of(ImpactorKind.NONE), base, pushes).look_ahead(0.3)
    assert [trace.diverged is not None for trace in traces] == [False, True, False]


def test_it_is_reported_each_time(scene_of: SceneMaker, base: Motion) -> None:
    """MuJoCo resets a simulation that diverged, and its count of warnings."""
    push = beyond_bounds(Push(1.0), force=1e9)
    simulation = simulation_of(scene_of(ImpactorKind.NONE), base, [push])
    first = simulation.look_ahead(0.3)[0]
    assert first.diverged is not None
    for _ in range(3):
        again = simulation.follow([0], [0], [base.poses[:30]], 12)[0]
        assert again.diverged is not None
        assert np.abs(again.poses[:, :3]).max() < 10.0


def test_all_may_diverge(scene_of: SceneMaker, base: Motion) -> None:
    traces = simulation_of(scene_of(ImpactorKind.PROJECTILE), base, [_ABSURD] * 3).look_ahead(0.3)
    assert all(trace.diverged is not None for trace in traces)


def test_after_a_rewind_is_reported_with_its_own_frame(scene_of: SceneMaker, base: Motion) -> None:
    """Targets that are NaN stand for all that may go wrong."""
    scene = scene_of(ImpactorKind.PROJECTILE)
    simulation = simulation_of(scene, base, _SANE[:2])
    simulation.look_ahead(0.5)
    sane, bad = base.poses[:30], base.poses[:30].copy()
    bad[8:] = np.nan
    good, blown = simulation.follow([0, 1], [9, 13], [sane, bad], 12)
    assert good.diverged is None
    assert len(good.poses) == 9 + 12 + 1
    assert blown.diverged is not None
    assert blown.diverged.warning == "BADCTRL"
    # The servos read their targets up to three frames ahead.
    assert 13 + 5 <= blown.diverged.frame <= 13 + 8
    assert len(blown.poses) == blown.diverged.frame + 1
    assert np.isfinite(blown.poses).all()
    # After another rewind it goes on normally.
    again = simulation.follow([1], [13], [sane], 12)[0]
    other = simulation_of(scene, base, _SANE[:2])
    other.look_ahead(0.5)
    _same(again, other.follow([1], [13], [sane], 12)[0])


@pytest.mark.parametrize("mass", [1e-6, 1e3, 1e9, 1e15])
def test_an_extreme_mass_does_no_harm(scene_of: SceneMaker, base: Motion, mass: float) -> None:
    trace = simulation_of(
        scene_of(ImpactorKind.PROJECTILE), base, [beyond_bounds(Ball(1.5), mass=mass)]
    ).look_ahead(0.3)[0]
    assert trace.diverged is None
    assert np.isfinite(trace.poses).all()


_SCRIPT = """
from dynresp.motion.character import default_character
from dynresp.physics.impacts import Ball
from dynresp.physics.scene import ImpactorKind, PhysicsConfig, Scene
from tests.physics.samples import absurd_ball, beyond_bounds, simulation_of, walking
character = default_character()
scene = Scene(character, ImpactorKind.PROJECTILE, PhysicsConfig())
simulation = simulation_of(scene, walking(character), [Ball(1.5), {ball}])
print([trace.diverged is not None for trace in simulation.look_ahead(0.1)])
"""


def _run_in(folder: Path, ball: str) -> str:
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(root)!r})\n"
         + _SCRIPT.format(ball=ball)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_nothing_is_written_to_the_working_folder(tmp_path: Path) -> None:
    assert _run_in(tmp_path, "Ball(1.6)") == "[False, False]"
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_when_one_diverges(tmp_path: Path) -> None:
    assert _run_in(tmp_path, "absurd_ball(1.5)") == "[False, True]"
    assert not list(tmp_path.iterdir())
