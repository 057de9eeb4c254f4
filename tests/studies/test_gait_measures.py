from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.load import load_motion
from dynresp.motion.motion import FEET, Motion
from dynresp.support.errors import UsageError
from studies.graphs.gait_measures import ground_speeds, measure_gait

FPS = 30.0
STEP_M, APART_M, STEP_S = 0.5, 0.18, 0.6


def made_walk(character: Character, steps: int = 12, backward: bool = False) -> Motion:
    """Steps of one length, width and time along +X, the left foot first; the other stands."""
    per_step = round(STEP_S * FPS)
    frames = steps * per_step
    rest = np.repeat(character.rest_pose[None], frames, axis=0)
    height = legs.ankle_positions(character, character.kinematics(rest[:1]))[0, :, 2]
    ankles = np.zeros((frames, 2, 3))
    places = np.array([0.0, 0.0])
    for step in range(steps):
        foot = step % 2
        share = np.linspace(0.0, 1.0, per_step + 1)[1:]
        # Down for the last fifth: both feet stand.
        share = np.clip(share / 0.8, 0.0, 1.0)
        span = slice(step * per_step, (step + 1) * per_step)
        to = places[1 - foot] + STEP_M
        ankles[span, 1 - foot, 0] = places[1 - foot]
        ankles[span, foot, 0] = places[foot] + share * (to - places[foot])
        ankles[span, foot, 2] = 0.15 * np.sin(np.pi * share)
        places[foot] = to
    ankles[:, :, 1] = [0.5 * APART_M, -0.5 * APART_M]
    ankles[:, :, 2] += height
    rest[:, 0] = ankles[:, :, 0].mean(axis=1)
    rest[:, 2] -= 0.06
    if backward:
        ankles[..., 0] *= -1.0
        rest[:, 0] *= -1.0
    return Motion(legs.place_ankles(character, rest, ankles), FPS, "made")


@pytest.mark.parametrize("backward", [False, True])
def test_steps_of_a_made_walk(character: Character, backward: bool) -> None:
    gait = measure_gait(made_walk(character, backward=backward), character)
    assert len(gait.lengths) >= 9
    np.testing.assert_allclose(gait.lengths, STEP_M, atol=0.01)
    np.testing.assert_allclose(gait.widths, APART_M, atol=0.01)
    np.testing.assert_allclose(gait.times, STEP_S, atol=1.01 / FPS)
    assert gait.cadence == pytest.approx(60.0 / STEP_S, rel=0.06)
    assert (np.diff(gait.feet) != 0).all()
    np.testing.assert_allclose(gait.yaws, 0.0, atol=0.02)


def test_a_turned_walk_has_the_same_steps(character: Character) -> None:
    walk = made_walk(character)
    gait, turned = (
        measure_gait(walk, character),
        measure_gait(walk.moved(2.0, (1.0, -3.0, 0.0)), character),
    )
    for name in ("lengths", "widths", "times", "begins_s", "feet"):
        np.testing.assert_allclose(getattr(turned, name), getattr(gait, name), atol=1e-9)
    np.testing.assert_allclose(turned.yaws, gait.yaws + 2.0, atol=1e-9)


def test_a_mirrored_walk_has_the_same_steps(character: Character) -> None:
    walk = load_builtin("walk", character).resampled(FPS).slice(60, 300)
    gait, mirrored = (
        measure_gait(walk, character),
        measure_gait(walk.mirrored(character), character),
    )
    assert len(gait.lengths) > 8
    np.testing.assert_allclose(mirrored.lengths, gait.lengths, atol=1e-3)
    np.testing.assert_allclose(mirrored.widths, gait.widths, atol=1e-3)
    np.testing.assert_array_equal(mirrored.feet, 1 - gait.feet)


def test_standing_makes_no_step(character: Character) -> None:
    still = Motion(np.repeat(character.rest_pose[None], 60, axis=0), FPS, "still")
    gait = measure_gait(still, character)
    assert len(gait.feet) == len(FEET)
    assert len(gait.lengths) == len(gait.widths) == len(gait.times) == 0
    assert np.isnan(gait.cadence)
    np.testing.assert_array_equal(ground_speeds(still), 0.0)


def test_the_speed_of_an_even_walk(character: Character) -> None:
    walk = made_walk(character)
    speeds = ground_speeds(walk, over_s=2.0 * STEP_S)
    np.testing.assert_allclose(speeds[40:-20], STEP_M / STEP_S, rtol=0.02)
    assert len(speeds) == len(walk)


def test_a_speed_needs_two_frames_and_a_time(character: Character) -> None:
    walk = made_walk(character, 2)
    with pytest.raises(UsageError, match="got 1 frames"):
        ground_speeds(walk.slice(0, 1))
    with pytest.raises(UsageError, match=r"0\.0 s"):
        ground_speeds(walk, 0.0)


@pytest.mark.mocap
def test_steps_of_a_recorded_walk(character: Character, motions_folder: Path) -> None:
    walk = load_motion(motions_folder / "cmu/16/16_32.amc").resampled(FPS)
    gait = measure_gait(walk, character)
    assert len(gait.lengths) >= 6
    assert 0.6 < np.median(gait.lengths) < 0.8
    assert 0.03 < np.median(gait.widths) < 0.2
    assert 95.0 < gait.cadence < 130.0
    assert 1.0 < np.median(ground_speeds(walk)) < 1.5
