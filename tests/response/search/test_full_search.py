import dataclasses
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.bench import full_search_speed as bench
from dynresp.bench.measure import Contender, median_seconds
from dynresp.bench.window_error_twin import angle_between
from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.response.search.full_search import ERROR_FLOOR, FullSearchResult, search
from dynresp.response.windows.windows import (
    LANES,
    ReactionTrack,
    WindowErrorConfig,
    facing_frames,
    library_windows,
    make_windows,
    trace_windows,
)
from dynresp.support.errors import MotionError, UnknownNameError, UsageError
from tests.oracles import window_error

Track = tuple[FloatArray, FloatArray]
BODIES = 5
CONFIG = WindowErrorConfig(fps=30.0, window_s=5 / 30, exit_max_s=6 / 30)
TRACE_FRAMES = 6 + 5


def _track(seed: int, frames: int, bodies: int = BODIES) -> Track:
    rng = np.random.default_rng(seed)
    rest = np.random.default_rng(99).normal(scale=0.4, size=(bodies, 3))
    return bench.synthetic_track(rng, rest, frames)


def _placed(track: Track, x: float, y: float, yaw: float) -> Track:
    positions, quaternions = track
    turn = rotations.from_yaw(yaw)
    moved = rotations.rotate(turn, positions) + np.array([x, y, 0.0])
    return moved, rotations.multiply(turn, quaternions)


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
        ReactionTrack(f"reaction {i}", *_track((seed + i + 1) % 2**32, length))
        for i, length in enumerate(frames)
    ]
    _assert_equals_twin(_track(seed, TRACE_FRAMES), tracks, config)


def test_equals_its_twin_at_full_size() -> None:
    config = WindowErrorConfig(
        fps=30.0,
        exit_min_s=0.1,
        position_weight=tuple(np.linspace(0.5, 2.0, 14).tolist()),
        angle_weight=tuple(np.linspace(0.3, 0.0, 14).tolist()),
    )
    tracks = [
        ReactionTrack("short", *_track(2, 61, 14)),
        ReactionTrack("late", *_track(3, 40, 14), entry_range=(7, 20)),
    ]
    result = _assert_equals_twin(_track(1, 25, 14), tracks, config)
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
def test_angles_hold_from_the_identity_to_half_a_turn(angle: float, sign: float) -> None:
    config = dataclasses.replace(CONFIG, position_weight=0.0, angle_weight=1.0)
    trace = _track(1, TRACE_FRAMES)
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
    trace, clip = _track(1, TRACE_FRAMES), _track(2, 30)
    before = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    if which == "trace":
        trace = _placed(trace, x, y, yaw)
    else:
        clip = _placed(clip, x, y, yaw)
    after = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    np.testing.assert_allclose(after, before, rtol=1e-4, atol=ERROR_FLOOR)


def test_a_difference_in_height_counts() -> None:
    positions, quaternions = _track(1, TRACE_FRAMES)
    raised = ReactionTrack("raised", positions + np.array([0.0, 0.0, 0.1]), quaternions)
    errors = _search((positions, quaternions), [raised]).surface("raised").errors
    np.testing.assert_allclose(np.diag(errors), 0.1 * BODIES, rtol=1e-4)


def test_a_track_matches_itself_without_error() -> None:
    track = _track(4, TRACE_FRAMES)
    result = _search(track, [ReactionTrack("itself", *_placed(track, 3.0, -2.0, 2.5))])
    diagonal = np.diag(result.surface("itself").errors)
    np.testing.assert_allclose(diagonal, 0.0, atol=ERROR_FLOOR)
    assert result.best.error <= ERROR_FLOOR
    assert result.best.exit_frame == result.best.entry_frame


def test_lying_and_upside_down_pelvises_are_searched() -> None:
    positions, quaternions = _track(4, TRACE_FRAMES)
    for flip in ((0.0, 1.0, 0.0, 0.0), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)):
        level = np.broadcast_to(np.array(flip), quaternions.shape).copy()
        level[:, 1:] = quaternions[:, 1:]
        result = _assert_equals_twin((positions, level), [ReactionTrack("it", positions, level)])
        assert result.best.error <= ERROR_FLOOR
    assert facing_frames((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))[1] == 0.0


def test_ties_go_to_the_lowest_exit_then_entry_then_reaction() -> None:
    positions = np.tile(_track(1, 1)[0], (30, 1, 1))
    quaternions = np.tile(_track(1, 1)[1], (30, 1, 1))
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
    trace, clip = _track(1, TRACE_FRAMES), _track(2, 60)
    whole = _search(trace, [ReactionTrack("clip", *clip)]).surface("clip").errors
    for first in (0, 3, 11):
        part = ReactionTrack("part", *clip, entry_range=(first, first + 2 * LANES + 3))
        others = [ReactionTrack("other", *_track(3, 20)), part]
        errors = _search(trace, others).surface("part").errors
        np.testing.assert_array_equal(errors, whole[:, first : first + 2 * LANES + 3])


def test_searches_on_many_threads_return_the_same_bits() -> None:
    tracks = [ReactionTrack(f"{i}", *_track(i, 40)) for i in range(6)]
    library = library_windows(tracks, CONFIG)
    traces = [trace_windows(*_track(20 + i, TRACE_FRAMES), CONFIG) for i in range(8)]
    alone = [search(trace, library) for trace in traces]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda trace: search(trace, library), traces))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.errors, other.errors)
        np.testing.assert_array_equal(one.exit_frames, other.exit_frames)
        np.testing.assert_array_equal(one.entry_frames, other.entry_frames)


def test_shared_arrays_are_read_only() -> None:
    library = library_windows([ReactionTrack("a", *_track(1, 20))], CONFIG)
    for array in (library.buffer, library.offsets, library.windows[0].data):
        with pytest.raises(ValueError, match="read-only"):
            array.ravel()[...] = 0


def test_durations_become_frames_at_the_given_rate() -> None:
    default = WindowErrorConfig(fps=30.0)
    assert default.window_frames == 10
    assert default.exit_frames == range(16)
    assert default.entry_step == 1
    fast = WindowErrorConfig(fps=120.0, exit_min_s=0.1)
    assert fast.window_frames == 40
    assert fast.exit_frames == range(12, 61)
    assert fast.entry_step == 4
    weights = default.frame_weights()
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(np.diff(weights) < 0)
    assert weights[-1] == pytest.approx(0.01 * weights[0])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fps", 0.0),
        ("fps", math.nan),
        ("window_s", -1.0),
        ("exit_min_s", -0.1),
        ("exit_max_s", -0.1),
        ("entry_step_s", 0.0),
        ("position_weight", -1.0),
        ("angle_weight", (0.1, math.inf)),
    ],
)
def test_values_out_of_range_are_named(field: str, value: object) -> None:
    with pytest.raises(UsageError, match=field):
        dataclasses.replace(CONFIG, **{field: value})  # type: ignore[arg-type]


def test_weights_of_zero_and_of_the_wrong_length_are_refused() -> None:
    with pytest.raises(UsageError, match="all zero"):
        dataclasses.replace(CONFIG, position_weight=0.0, angle_weight=(0.0, 0.0))
    config = dataclasses.replace(CONFIG, angle_weight=(0.2, 0.2))
    with pytest.raises(UsageError, match=f"2 values, the character has {BODIES}"):
        _search(_track(1, TRACE_FRAMES), [ReactionTrack("a", *_track(2, 20))], config)


def _nan_position(track: Track) -> Track:
    track[0][3, 2, 1] = math.nan
    return track


def _infinite_quaternion(track: Track) -> Track:
    track[1][3, 2, 1] = math.inf
    return track


def _long_quaternion(track: Track) -> Track:
    track[1][3, 2] *= 1.1
    return track


def _without_quaternions(track: Track) -> Track:
    return track[0], track[1][..., :3]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_nan_position, "not finite, the first at frame 3, body 2"),
        (_infinite_quaternion, "not finite, the first at frame 3, body 2"),
        (_long_quaternion, "frame 3, body 2 has length 1.1"),
        (_without_quaternions, "expected .frames, bodies, 3."),
    ],
)
def test_bad_tracks_are_refused(spoil: Callable[[Track], Track], message: str) -> None:
    with pytest.raises(MotionError, match=f"simulated trace: .*{message}"):
        trace_windows(*spoil(_track(1, TRACE_FRAMES)), CONFIG)
    with pytest.raises(MotionError, match=f"reaction 'a': .*{message}"):
        library_windows([ReactionTrack("a", *spoil(_track(1, 20)))], CONFIG)


def test_tracks_too_short_for_a_window_are_refused() -> None:
    with pytest.raises(MotionError, match=r"simulated trace: has 10 frames.* need 11"):
        trace_windows(*_track(1, TRACE_FRAMES - 1), CONFIG)
    with pytest.raises(MotionError, match="reaction 'a': has 4 frames, a window needs 5"):
        library_windows([ReactionTrack("a", *_track(1, 4))], CONFIG)
    with pytest.raises(MotionError, match="no window"):
        make_windows(*_track(1, 20), [], CONFIG)


@pytest.mark.parametrize("bounds", [(-1, 3), (3, 3), (0, 17)])
def test_entry_bounds_outside_the_clip_are_refused(bounds: tuple[int, int]) -> None:
    with pytest.raises(MotionError, match="first < last <= 16"):
        library_windows([ReactionTrack("a", *_track(1, 20), entry_range=bounds)], CONFIG)


def test_libraries_that_make_no_sense_are_refused() -> None:
    track = ReactionTrack("a", *_track(1, 20))
    with pytest.raises(MotionError, match="empty"):
        library_windows([], CONFIG)
    with pytest.raises(MotionError, match="more than once: a"):
        library_windows([track, track], CONFIG)
    with pytest.raises(MotionError, match="'b' has 3 bodies, reaction 'a' has 5"):
        library_windows([track, ReactionTrack("b", *_track(1, 20, 3))], CONFIG)


def test_trace_and_library_must_belong_together() -> None:
    library = library_windows([ReactionTrack("a", *_track(1, 20))], CONFIG)
    with pytest.raises(MotionError, match="the same settings"):
        search(trace_windows(*_track(1, 40), WindowErrorConfig(fps=30.0)), library)
    with pytest.raises(MotionError, match="3 bodies, the library 5"):
        search(trace_windows(*_track(1, TRACE_FRAMES, 3), CONFIG), library)
    result = search(trace_windows(*_track(1, TRACE_FRAMES), CONFIG), library)
    with pytest.raises(UnknownNameError, match="unknown reaction 'b'"):
        result.surface("b")


def test_benchmark_reports_what_the_contract_names() -> None:
    config = dataclasses.replace(CONFIG, exit_max_s=2 / 30)
    tracks = [ReactionTrack(f"{i}", *_track(i, 12)) for i in range(2)]
    result = bench.run(trace=_track(7, 7), reactions=tracks, config=config)
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
