import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import place_poses
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import Composition, compose, steps_at_rate
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import angle_between
from dynresp.response.response_quality import joint_speed_steps
from tests.locomotion.samples import walking_graph, walking_motions
from tests.motion.foot_samples import foot_states

BLEND = 4
"""Frames of the graph's blends."""
RATES = [15.0, 30.0, 60.0]


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3, blend_s=BLEND / 15.0, blend_rate_s=0.2)


@pytest.fixture(scope="module")
def walk(graph: MotionGraph) -> np.ndarray:
    return random_walk(graph, 600, np.random.default_rng(5))


def differences(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest distance of roots [m], and largest angle of root and joints [rad]."""
    turns = angle_between(a[:, 3:].reshape(-1, 14, 4), b[:, 3:].reshape(-1, 14, 4))
    return float(np.abs(a[:, :3] - b[:, :3]).max()), float(turns.max())


def foot_differences(character: Character, a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest distance of ankles [m], and largest angle of feet in the world [rad]."""
    one, two = foot_states(character, a), foot_states(character, b)
    away = np.linalg.norm(one[0] - two[0], axis=-1)
    return float(away.max()), float(angle_between(one[1], two[1]).max())


def blended(composition: Composition) -> np.ndarray:
    """(k,) frames of the walk that lie in a blend."""
    frames = np.arange(len(composition.frames))
    since = frames[:, None] - composition.jumps
    # The frame entered is the first that is displaced, and a blend long after it the first is not.
    return ((since >= 0) & (since < BLEND - 1)).any(axis=1)


@pytest.mark.parametrize("fps", RATES)
def test_frames_outside_blends_are_met_exactly(
    graph: MotionGraph, walk: np.ndarray, character: Character, fps: float
) -> None:
    made = compose(graph, character, walk, fps=fps)
    assert made.motion.fps == fps
    assert len(made.motion) == len(made.unfitted) == round((len(walk) - 1) * fps / 15.0) + 1
    np.testing.assert_array_equal(made.frames, walk)
    placed = place_poses(graph.database.poses[walk], made.placements)
    step = round(fps / 15.0)
    calm = ~blended(made)
    assert 50 < calm.sum() < len(walk) - 50
    shift, turn = differences(made.unfitted[::step][calm], placed[calm])
    assert shift < 1e-9
    assert turn < 1e-6
    np.testing.assert_array_equal(made.motion.contacts[::step], graph.database.contacts[walk])


@pytest.mark.parametrize("fps", RATES)
def test_in_blends_they_are_met_in_the_end(
    graph: MotionGraph, walk: np.ndarray, character: Character, fps: float
) -> None:
    """What is played between is on its way: never farther off than where the jump began."""
    made = compose(graph, character, walk, fps=fps)
    placed = place_poses(graph.database.poses[walk], made.placements)
    shift, turn = differences(made.unfitted[:: round(fps / 15.0)], placed)
    assert 1e-3 < shift < 0.5
    assert 1e-2 < turn < 1.5


def test_jumps_are_where_the_recording_is_left(
    graph: MotionGraph, walk: np.ndarray, character: Character
) -> None:
    made = compose(graph, character, walk)
    expected = [k for k in range(1, len(walk)) if graph.database.successors[walk[k - 1]] != walk[k]]
    assert made.jumps.tolist() == expected
    moved = np.flatnonzero((np.diff(made.placements, axis=0) != 0).any(axis=1)) + 1
    assert set(moved.tolist()) <= set(expected)


@pytest.mark.parametrize("fps", RATES)
def test_a_walk_of_no_jumps_is_the_recording(
    graph: MotionGraph, character: Character, fps: float
) -> None:
    clip = graph.database.clips[1]
    made = compose(graph, character, np.arange(clip.start, clip.stop), fps=fps)
    recorded = graph.database.motion(1)
    assert len(made.jumps) == 0
    shift, turn = differences(made.unfitted[:: round(fps / 15.0)], recorded.poses)
    assert shift < 1e-9
    assert turn < 1e-6
    # Between the graph's frames it is nearer to the recording than slerp, and does not jerk. Told
    # where feet are, since a millimetre turns the knee of a straight leg by degrees.
    if fps > 15.0:
        whole = walking_motions(character)[1].resampled(fps)
        line = recorded.resampled(fps).poses
        count = min(len(whole), len(line))
        ours, theirs = (
            foot_differences(character, poses[:count], whole.poses[:count])
            for poses in (made.motion.poses, line)
        )
        assert ours[0] < 0.5 * theirs[0]
        assert ours[1] < theirs[1]
        steps = joint_speed_steps(Motion(made.unfitted, fps))
        assert np.percentile(steps, 99) < 1.2 * np.percentile(joint_speed_steps(whole), 99)


@pytest.mark.parametrize("fps", RATES)
def test_hardly_anything_is_fitted_where_feet_do_not_slide(
    graph: MotionGraph, character: Character, fps: float
) -> None:
    clip = graph.database.clips[1]
    made = compose(graph, character, np.arange(clip.start, clip.stop), fps=fps)
    shift, turn = differences(made.motion.poses, made.unfitted)
    assert shift < 1e-3
    assert turn < np.radians(2.0)


@pytest.mark.parametrize("fps", RATES)
def test_nothing_is_broken_and_standing_feet_stay(
    graph: MotionGraph, walk: np.ndarray, character: Character, fps: float
) -> None:
    made = compose(graph, character, walk, fps=fps)
    for poses in (made.motion.poses, made.unfitted):
        assert np.isfinite(poses).all()
        norms = np.linalg.norm(poses[:, 3:].reshape(-1, 14, 4), axis=-1)
        np.testing.assert_allclose(norms, 1.0, atol=1e-9)
    sliding = stance_slides(Motion(made.unfitted, fps, "sliding", made.motion.contacts), character)
    fitted = stance_slides(made.motion, character)
    assert len(fitted) == len(sliding) > 60
    assert np.percentile(sliding, 90) > 0.02
    assert np.percentile(fitted, 99) < 0.01
    # What is fitted stays near what is played.
    shift, _ = differences(made.motion.poses, made.unfitted)
    assert shift < 0.1


def test_it_begins_where_it_is_told_to(
    graph: MotionGraph, walk: np.ndarray, character: Character
) -> None:
    place = np.array([3.0, -2.0, 0.0, 0.8])
    here = compose(graph, character, walk[:100], fps=30.0)
    there = compose(graph, character, walk[:100], place, fps=30.0)
    np.testing.assert_array_equal(there.placements[0], place)
    for a, b in ((here.unfitted, there.unfitted), (here.motion.poses, there.motion.poses)):
        shift, turn = differences(place_poses(a, place), b)
        assert shift < 1e-6
        assert turn < 1e-5


def test_it_ends_before_frames_that_are_not_walked_yet(
    graph: MotionGraph, walk: np.ndarray, character: Character
) -> None:
    long = compose(graph, character, walk[:80], fps=30.0)
    short = compose(graph, character, walk[:50], fps=30.0)
    np.testing.assert_allclose(long.unfitted[: len(short.unfitted)], short.unfitted, atol=1e-12)


@given(
    count=st.integers(2, 300),
    rate=st.sampled_from([10.0, 15.0, 29.97, 30.0]),
    fps=st.sampled_from([7.0, 15.0, 24.0, 30.0, 59.94, 120.0]),
)
def test_frames_at_another_rate(count: int, rate: float, fps: float) -> None:
    step, part = steps_at_rate(count, rate, fps)
    np.testing.assert_allclose((step + part) / rate, np.arange(len(step)) / fps, atol=1e-7)
    assert step.min() == 0
    assert step.max() <= count - 2
    assert part[0] == 0.0
    assert ((part[1:] > 0.0) & (part[1:] <= 1.0)).all()
    # None is left out at the end.
    assert len(step) / fps > (count - 1) / rate - 1e-6
