"""The full search: equal to its slow twin, the same bits every time."""

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.bench.measure import Contender, median_seconds
from dynresp.motion import rotations
from dynresp.response.search.full_search import ERROR_FLOOR, FullSearchResult, search
from dynresp.response.windows.windows import (
    LANES,
    ReactionTrack,
    WindowErrorConfig,
    library_windows,
    trace_windows,
)
from dynresp.support.errors import MotionError, UnknownNameError, UsageError
from studies.benchmarks import full_search_speed as bench
from studies.benchmarks.window_error_twin import angle_between
from tests.oracles import window_error
from tests.oracles.alignment import Track
from tests.response.alignment_samples import BODIES, placed, smooth_track

CONFIG = WindowErrorConfig(fps=30.0, window_s=5 / 30, exit_max_s=6 / 30)
TRACE_FRAMES = 6 + 5


def _search(
    trace: Track, tracks: list[ReactionTrack], config: WindowErrorConfig = CONFIG
) -> FullSearchResult:
    library = library_windows(tracks, config)
    windows = trace_windows(*trace, config)
    result = search(windows, library)
    complete = search(windows, library, early_stop=False)
    for name in ("errors", "exit_frames", "entry_frames"):
        np.testing.assert_array_equal(getattr(result, name), getattr(complete, name))
    return result


def _assert_equals_twin(
    trace: Track, tracks: list[ReactionTrack], config: WindowErrorConfig = CONFIG
) -> FullSearchResult:
    result = _search(trace, tracks, config)
    for track in tracks:
        expected, exits, entries = window_error.reaction_surface(trace, track, config)
        surface = result.surface(track.name)
        np.testing.assert_allclose(surface.errors, expected, rtol=1e-4, atol=ERROR_FLOOR)
        assert surface.exit_frames.tolist() == exits
        assert surface.entry_frames.tolist() == entries
        match = result.match(track.name)
        row, column = exits.index(match.exit_frame), entries.index(match.entry_frame)
        assert np.float32(match.error) == surface.errors.min() == surface.errors[row, column]
    best = window_error.best_match(trace, tracks, config)
    assert result.best.error == pytest.approx(best[0], rel=1e-4, abs=ERROR_FLOOR)
    return result


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    frames=st.lists(st.integers(5, 40), min_size=1, max_size=4),
    position_weight=st.floats(0.0, 3.0),
    angle_weight=st.floats(0.01, 3.0),
    step=st.integers(1, 3),
)
def test_equals_its_twin_on_random_motion(
    seed: int, frames: list[int], position_weight: float, angle_weight: float, step: int
) -> None:
    config = dataclasses.replace(
        CONFIG,
        position_weight=position_weight,
        angle_weight=angle_weight,
        entry_step_s=step / 30,
    )
    tracks = [
        ReactionTrack(f"reaction {i}", *smooth_track((seed + i + 1) % 2**32, length))
        for i, length in enumerate(frames)
    ]
    _assert_equals_twin(smooth_track(seed, TRACE_FRAMES), tracks, config)


def test_equals_its_twin_at_full_size() -> None:
    config = WindowErrorConfig(
        fps=30.0,
        exit_min_s=0.1,
        position_weight=tuple(np.linspace(0.5, 2.0, 14).tolist()),
        angle_weight=tuple(np.linspace(0.3, 0.0, 14).tolist()),
    )
    tracks = [
        ReactionTrack("short", *smooth_track(2, 61, 14)),
        ReactionTrack("late", *smooth_track(3, 40, 14), entry_range=(7, 20)),
    ]
    result = _assert_equals_twin(smooth_track(1, 25, 14), tracks, config)
    assert result.surface("short").errors.shape == (13, 52)
    assert result.surface("late").entry_frames.tolist() == list(range(7, 20))


def _turned(track: Track, angle: float, sign: float) -> Track:
    """Every body but the pelvis turned about a random axis, and all signs multiplied."""
    rng = np.random.default_rng(5)
    positions, quaternions = track
    axes = rng.normal(size=(*quaternions.shape[:2], 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    turns = rotations.from_rotation_vector(axes * angle)
    turns[:, 0] = rotations.identity()
    return positions, sign * rotations.multiply(quaternions, turns)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "angle", [0.0, 1e-7, 1e-6, 1e-5, 1e-3, 0.1, 1.0, 2.0, 3.0, math.pi - 1e-6, math.pi]
)
def test_angles_are_accurate_from_the_identity_to_half_a_turn(angle: float, sign: float) -> None:
    config = dataclasses.replace(CONFIG, position_weight=0.0, angle_weight=1.0)
    trace = smooth_track(1, TRACE_FRAMES)
    result = _assert_equals_twin(trace, [ReactionTrack("turned", *_turned(trace, angle, sign))])
    weighted = _search(trace, [ReactionTrack("turned", *_turned(trace, angle, sign))], config)
    diagonal = np.diag(weighted.surface("turned").errors)
    np.testing.assert_allclose(diagonal, (BODIES - 1) * angle, rtol=1e-4, atol=ERROR_FLOOR)
    assert result.trace.bodies == BODIES


def test_twin_angle_is_accurate_near_the_identity() -> None:
    small = 1e-9
    turned = tuple(rotations.about_axis((1.0, 2.0, -1.0), small).tolist())
    assert angle_between((1.0, 0.0, 0.0, 0.0), turned) == pytest.approx(small, rel=1e-6)
    assert angle_between((1.0, 0.0, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0)) == 0.0


@settings(max_examples=25, deadline=None)
@given(
    x=st.floats(-1e3, 1e3),
    y=st.floats(-1e3, 1e3),
    yaw=st.floats(-10.0, 10.0),
    which=st.sampled_from(["trace", "reaction"]),
)
def test_placing_either_track_elsewhere_changes_nothing(
    x: float, y: float, yaw: float, which: str
) -> None:
    trace, clip = smooth_track(1, TRACE_FRAMES), smooth_track(2, 30)
    before = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    if which == "trace":
        trace = placed(trace, x, y, yaw)
    else:
        clip = placed(clip, x, y, yaw)
    after = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    np.testing.assert_allclose(after, before, rtol=1e-4, atol=ERROR_FLOOR)


def test_a_difference_in_height_counts() -> None:
    positions, quaternions = smooth_track(1, TRACE_FRAMES)
    raised = ReactionTrack("raised", positions + np.array([0.0, 0.0, 0.1]), quaternions)
    errors = _search((positions, quaternions), [raised]).surface("raised").errors
    np.testing.assert_allclose(np.diag(errors), 0.1 * BODIES, rtol=1e-4)


def test_a_track_has_no_mismatch_with_itself() -> None:
    track = smooth_track(4, TRACE_FRAMES)
    result = _search(track, [ReactionTrack("itself", *placed(track, 3.0, -2.0, 2.5))])
    diagonal = np.diag(result.surface("itself").errors)
    np.testing.assert_allclose(diagonal, 0.0, atol=ERROR_FLOOR)
    assert result.best.error <= ERROR_FLOOR
    assert result.best.exit_frame == result.best.entry_frame


def test_pelvises_that_lie_or_are_upside_down_are_searched() -> None:
    positions, quaternions = smooth_track(4, TRACE_FRAMES)
    for flip in ((0.0, 1.0, 0.0, 0.0), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)):
        level = np.broadcast_to(np.array(flip), quaternions.shape).copy()
        level[:, 1:] = quaternions[:, 1:]
        result = _assert_equals_twin((positions, level), [ReactionTrack("it", positions, level)])
        assert result.best.error <= ERROR_FLOOR


def test_ties_go_to_the_lowest_exit_then_entry_then_reaction() -> None:
    positions = np.tile(smooth_track(1, 1)[0], (30, 1, 1))
    quaternions = np.tile(smooth_track(1, 1)[1], (30, 1, 1))
    still = (positions[:TRACE_FRAMES], quaternions[:TRACE_FRAMES])
    tracks = [
        ReactionTrack("late", positions, quaternions, entry_range=(12, 20)),
        ReactionTrack("early", positions, quaternions, entry_range=(9, 20)),
        ReactionTrack("early again", positions, quaternions, entry_range=(9, 20)),
    ]
    result = _search(still, tracks)
    assert result.exit_frames.tolist() == [0, 0, 0]
    assert result.entry_frames.tolist() == [12, 9, 9]
    assert result.best.reaction == "early"


def test_a_match_does_not_depend_on_its_neighbours() -> None:
    trace, clip = smooth_track(1, TRACE_FRAMES), smooth_track(2, 60)
    whole = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    for first in (0, 3, 11):
        part = ReactionTrack("part", *clip, entry_range=(first, first + 2 * LANES + 3))
        others = [ReactionTrack("other", *smooth_track(3, 20)), part]
        errors = _search(trace, others).surface("part").errors
        np.testing.assert_array_equal(errors, whole[:, first : first + 2 * LANES + 3])


def test_searches_on_many_threads_return_the_same_bits() -> None:
    tracks = [ReactionTrack(f"{i}", *smooth_track(i, 40)) for i in range(6)]
    library = library_windows(tracks, CONFIG)
    traces = [trace_windows(*smooth_track(20 + i, TRACE_FRAMES), CONFIG) for i in range(8)]
    alone = [search(trace, library) for trace in traces]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda trace: search(trace, library), traces))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.errors, other.errors)
        np.testing.assert_array_equal(one.exit_frames, other.exit_frames)
        np.testing.assert_array_equal(one.entry_frames, other.entry_frames)


def test_trace_and_library_must_belong_together() -> None:
    library = library_windows([ReactionTrack("a", *smooth_track(1, 20))], CONFIG)
    with pytest.raises(MotionError, match="the same settings"):
        search(trace_windows(*smooth_track(1, 40), WindowErrorConfig(fps=30.0)), library)
    with pytest.raises(MotionError, match="3 bodies, the library 5"):
        search(trace_windows(*smooth_track(1, TRACE_FRAMES, 3), CONFIG), library)
    weights = dataclasses.replace(CONFIG, angle_weight=(0.2, 0.2))
    with pytest.raises(UsageError, match=f"2 values, the character has {BODIES}"):
        _search(smooth_track(1, TRACE_FRAMES), [ReactionTrack("a", *smooth_track(2, 20))], weights)
    result = search(trace_windows(*smooth_track(1, TRACE_FRAMES), CONFIG), library)
    with pytest.raises(UnknownNameError, match="unknown reaction 'b'"):
        result.surface("b")


def test_the_benchmark_reports_the_agreed_keys() -> None:
    config = dataclasses.replace(CONFIG, exit_max_s=2 / 30)
    tracks = [ReactionTrack(f"{i}", *smooth_track(i, 12)) for i in range(2)]
    result = bench.run(trace=smooth_track(7, 7), reactions=tracks, config=config)
    figures = result.to_json()
    assert {"name", "value", "unit", "baseline", "ratio", "ratio_twin", "machine"} <= set(figures)
    assert figures["pairs_per_reaction"] == 3 * 8
    assert result.ratio == pytest.approx(result.baseline / result.value)
    assert "NumPy" in result.to_text()


def test_sides_of_a_benchmark_are_timed_in_turn() -> None:
    calls: list[str] = []
    sides = [
        Contender("fast", lambda: calls.append("fast")),
        Contender("slow", lambda: calls.append("slow"), every=2),
    ]
    times = median_seconds(sides, rounds=3)
    assert calls == ["fast", "slow", "fast", "fast", "slow"]
    assert set(times) == {"fast", "slow"}
    with pytest.raises(UsageError, match="rounds is 0"):
        median_seconds(sides, rounds=0)
