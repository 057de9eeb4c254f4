import numpy as np
import pytest

from dynresp.experiments.response_story import response_story
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.physics.impacts import Ball, Impact, Punch, Strike
from dynresp.physics.prepared_impact import prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.response.response import Response

from .samples import FPS, swaying


def answered(character: Character, impact: Impact, simulated: int = 12) -> Response:
    """A miss whose impactor was simulated in free flight for some frames."""
    base = swaying(character, 5.0, 2.0)
    prepared = prepare(impact, base, character, PhysicsConfig())
    track = None
    if prepared.impactor_pose is not None and prepared.impactor_velocity is not None:
        track = np.full((len(base), 7), np.nan)
        time = np.arange(simulated)[:, None] / FPS
        pull = np.array([0.0, 0.0, 0.0 if prepared.weightless else -9.81])
        rows = slice(prepared.start, prepared.start + simulated)
        track[rows, :3] = (
            prepared.impactor_pose[:3]
            + prepared.impactor_velocity[:3] * time
            + 0.5 * pull * time**2
        )
        track[rows, 3:] = [1.0, 0.0, 0.0, 0.0]
    return Response(base, prepared.start, prepared, impactor=track)


def test_a_ball_flies_in_one_curve_from_before_the_simulation(character: Character) -> None:
    impact = Ball(time=3.0, speed=5.0, from_deg=30.0, elevation_deg=50.0)
    shown = response_story(answered(character, impact), impact, 1.5, "title", "subtitle")
    (ball,) = shown.story.spheres
    assert ball.radius == impact.radius
    seen = ball.positions[np.isfinite(ball.positions[:, 0])]
    free = seen[: np.argmax(seen[:, 2] <= impact.radius) or len(seen)][:-1]
    # Frame by frame it falls as it should, also where the simulation begins.
    bend = np.diff(free[:20], n=2, axis=0) * FPS**2
    np.testing.assert_allclose(bend, np.tile([0.0, 0.0, -9.81], (len(bend), 1)), atol=1e-6)
    # It is seen for longer than it is simulated before it is due, and comes from in front.
    due = round(1.5 * FPS)
    assert np.isfinite(ball.positions[due - 25]).all()
    assert ball.positions[due - 25, 0] > ball.positions[due, 0]


def test_a_ball_comes_to_rest_on_the_floor(character: Character) -> None:
    impact = Ball(time=1.0, speed=6.0, height=2.4)
    (ball,) = response_story(answered(character, impact), impact, 1.5, "", "").story.spheres
    heights = ball.positions[np.isfinite(ball.positions[:, 2]), 2]
    assert heights.min() >= impact.radius - 1e-9
    assert heights[-1] == pytest.approx(impact.radius)
    steps = np.linalg.norm(np.diff(ball.positions[-10:], axis=0), axis=1)
    assert steps.max() < 0.1


def test_a_ball_is_not_seen_below_the_floor(character: Character) -> None:
    impact = Ball(time=3.0, speed=3.0, height=0.9)
    (ball,) = response_story(answered(character, impact), impact, 1.5, "", "").story.spheres
    assert np.nanmin(ball.positions[:, 2]) >= impact.radius - 1e-9


def test_a_fist_is_there_for_its_punch_alone(character: Character) -> None:
    impact = Punch(time=2.0)
    response = answered(character, impact)
    (fist,) = response_story(response, impact, 1.5, "", "").story.spheres
    assert fist.name == "fist"
    there = np.isfinite(fist.positions[:, 0])
    assert there.sum() == 12 + 3
    # It comes straight in, weightless.
    path = np.diff(fist.positions[there], axis=0)
    np.testing.assert_allclose(path, np.tile(path[0], (len(path), 1)), atol=1e-9)


def test_the_second_character_stands_where_the_simulation_has_it(character: Character) -> None:
    striker = swaying(character, 3.0, 30.0).moved(1.0, (4.0, -2.0, 0.0))
    impact = Strike(time=2.0, motion=striker, motion_time=1.2, from_deg=70.0)
    response = answered(character, impact)
    shown = response_story(response, impact, 1.5, "", "")
    (other,) = shown.story.others
    opponent = response.prepared.opponent
    assert opponent is not None
    start = response.prepared.start - shown.first
    np.testing.assert_allclose(
        other.poses[start : start + 20, :3], opponent.poses[:20, :3], atol=1e-9
    )
    # What it did before the simulation is shown, too.
    assert isinstance(other, Motion)
    assert not np.allclose(other.poses[start - 10], other.poses[start])


def test_the_lead_in_ends_at_the_start_of_the_motion(character: Character) -> None:
    impact = Ball(time=0.5, height=2.4)
    shown = response_story(answered(character, impact), impact, 1.5, "", "")
    assert shown.first == 0
    assert [phase.name for phase in shown.story.phases] == ["base motion"]
