"""The alignment equals its slow twin: mismatches, slopes, samples and descent."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from dynresp.response.alignment.alignment import Aligner, AlignmentConfig
from dynresp.response.search.full_search import ERROR_FLOOR, search
from dynresp.response.windows.windows import (
    LANES,
    ReactionTrack,
    WindowErrorConfig,
    library_windows,
    trace_windows,
)
from studies.benchmarks import alignment_speed as bench
from tests.oracles import alignment as twin
from tests.response.alignment_samples import (
    ALL,
    BODIES,
    FRAMES,
    WINDOW,
    align_one,
    flipped,
    placed,
    reactions,
    sliding,
    smooth_track,
)

# -- mismatches --------------------------------------------------------------------------------


def test_mismatches_at_whole_frames_are_those_of_the_full_search() -> None:
    tracks = [
        ReactionTrack("whole", *smooth_track(2, 30, 14)),
        ReactionTrack("late", *flipped(smooth_track(3, 30, 14), 1), entry_range=(7, 20)),
    ]
    window = WindowErrorConfig(
        fps=30.0,
        position_weight=tuple(np.linspace(0.5, 2.0, 14).tolist()),
        angle_weight=tuple(np.linspace(0.3, 0.0, 14).tolist()),
    )
    trace = flipped(placed(smooth_track(1, 25, 14), 300.0, -70.0, 2.0), 2)
    aligner = Aligner(tracks, window)
    found = search(trace_windows(*trace, window), library_windows(tracks, window))
    for name in aligner.names:
        surface = found.surface(name)
        errors = aligner.errors(*trace, name, surface.exit_frames[:, None], surface.entry_frames)
        np.testing.assert_allclose(errors, surface.errors, rtol=1e-4, atol=ERROR_FLOOR)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    exit_frame=st.floats(0.0, 12.0),
    entry_frame=st.floats(3.0, 14.0),
    position_weight=st.floats(0.0, 3.0),
    angle_weight=st.floats(0.01, 3.0),
    bodies=st.integers(1, 14),
)
def test_mismatches_between_frames_are_those_of_the_twin(
    seed: int,
    exit_frame: float,
    entry_frame: float,
    position_weight: float,
    angle_weight: float,
    bodies: int,
) -> None:
    window = dataclasses.replace(WINDOW, position_weight=position_weight, angle_weight=angle_weight)
    trace = flipped(smooth_track(seed, FRAMES, bodies), 1)
    clip = flipped(smooth_track(seed + 1, 24, bodies), 2)
    aligner = Aligner([ReactionTrack("it", *clip, entry_range=(3, 15))], window)
    expected = twin.error_between(trace, clip, exit_frame, entry_frame, window)
    found = aligner.errors(*trace, "it", exit_frame, entry_frame)
    assert found.shape == ()
    assert float(found) == pytest.approx(expected, rel=1e-4, abs=ERROR_FLOOR)


def test_mismatches_of_pelvises_that_lie_or_are_upside_down() -> None:
    trace, clip = smooth_track(1), smooth_track(2, 24)
    for flip in ((math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0), (0.0, 1.0, 0.0, 0.0)):
        for _, quaternions in (trace, clip):
            quaternions[:, 0] = flip
        aligner = Aligner([ReactionTrack("it", *clip)], WINDOW)
        expected = twin.error_between(trace, clip, 3.3, 4.8, WINDOW)
        found = aligner.errors(*trace, "it", 3.3, 4.8)
        assert float(found) == pytest.approx(expected, rel=1e-4)
        assert 0.0 < align_one(aligner, trace).error < 100.0


@pytest.mark.parametrize("seed", range(6))
def test_slopes_are_those_of_the_twin(seed: int) -> None:
    from dynresp.response.alignment import alignment_kernel as kernel
    from dynresp.response.alignment import mismatch_kernel as mismatch

    trace, clip = smooth_track(seed), smooth_track(seed + 50, 24)
    aligner = Aligner([ReactionTrack("it", *clip)], WINDOW)
    assert kernel.LANES == LANES
    length = (FRAMES + 1) * BODIES + kernel.LANES
    rows = np.empty(mismatch.ROWS * length, np.float32)
    assert mismatch.lay_out(*trace, FRAMES, rows)
    track = mismatch.Track(rows, length, BODIES)
    layout = aligner._clips.layouts[0]
    reaction = mismatch.Track(aligner._clips.rows, layout[kernel.LENGTH], BODIES)
    latest = int(layout[kernel.LATER])
    rng = np.random.default_rng(seed)
    slope = njit(lambda *arguments: mismatch.slopes_between(*arguments))
    for _ in range(4):
        # Between whole frames, where the slope has a step.
        at = rng.integers(2, 12) + rng.uniform(0.1, 0.9)
        entry = rng.integers(0, 19) + rng.uniform(0.1, 0.9)
        found = slope(track, at, 12.0, reaction, entry, latest, aligner._weights)
        step = 1e-4
        sides = [
            [twin.error_between(trace, clip, at + s, entry + m, WINDOW) for s, m in pair]
            for pair in (((-step, 0), (step, 0)), ((0, -step), (0, step)))
        ]
        expected = [(after - before) / (2 * step) for before, after in sides]
        own = twin.error_between(trace, clip, at, entry, WINDOW)
        assert found[0] == pytest.approx(own, rel=1e-4)
        np.testing.assert_allclose(found[1:], expected, rtol=1e-3, atol=1e-4)


# -- sampling and descent ----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("sets_without_gain", [1, 2, 99])
def test_samples_are_those_of_the_twin(seed: int, sets_without_gain: int) -> None:
    config = AlignmentConfig(refine=False, sets_without_gain=sets_without_gain)
    (track,) = reactions(seed + 10)
    trace = smooth_track(seed)
    expected = twin.sample(trace, track, WINDOW, config)
    found = align_one(Aligner([track], WINDOW, config), trace)
    assert found.error == pytest.approx(expected.error, rel=1e-4)
    assert found.exit_frame == pytest.approx(expected.exit_frame)
    assert found.entry_frame == pytest.approx(expected.entry_frame)
    assert (found.sets, found.evaluations) == (expected.sets, expected.count)
    assert found.complete is expected.complete is True
    assert not found.refined


@pytest.mark.parametrize("seed", range(12))
def test_a_descent_stays_within_bounds_and_gets_as_low_as_scipy(seed: int) -> None:
    (positions, quaternions), track = sliding(2.35 + 0.7 * seed)
    # Like the reaction, with other movements of the bodies added.
    trace = 0.8 * positions + 0.2 * smooth_track(seed)[0], quaternions
    start = twin.sample(trace, track, WINDOW, AlignmentConfig())
    found = align_one(Aligner([track], WINDOW), trace)
    plain = align_one(Aligner([track], WINDOW, AlignmentConfig(refine=False)), trace)
    assert found.refined
    assert found.error < plain.error
    assert found.evaluations > start.count
    assert WINDOW.exit_frames[0] <= found.exit_frame <= start.last
    assert 0.0 <= found.entry_frame <= 40 - WINDOW.window_frames
    at = (found.exit_frame, found.entry_frame)
    own = twin.error_between(trace, (track.positions, track.quaternions), *at, WINDOW)
    assert found.error == pytest.approx(own, rel=1e-4)
    scipy = twin.descend(trace, track, WINDOW, start)
    assert found.error <= 1.01 * scipy[0]


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    starts=st.integers(1, 4),
    step=st.floats(1 / 60, 1.0),
    sets_without_gain=st.integers(1, 9),
)
def test_descent_and_more_starts_never_make_the_mismatch_larger(
    seed: int, starts: int, step: float, sets_without_gain: int
) -> None:
    config = AlignmentConfig(step, sets_without_gain, starts)
    tracks = [ReactionTrack("it", *smooth_track(seed + 1, 30), entry_range=(4, 20))]
    trace = smooth_track(seed)
    found = align_one(Aligner(tracks, WINDOW, config), trace)
    plain = align_one(Aligner(tracks, WINDOW, dataclasses.replace(config, refine=False)), trace)
    single = align_one(Aligner(tracks, WINDOW, dataclasses.replace(config, starts=1)), trace)
    assert found.error <= single.error <= plain.error
    assert found.sets == single.sets == plain.sets
    assert 2.0 <= found.exit_frame <= 12.0
    assert 4.0 <= found.entry_frame <= 19.0


def test_a_match_between_frames_is_found() -> None:
    trace, track = sliding(6.4)
    found = align_one(Aligner([track], WINDOW, ALL), trace)
    worst = float(Aligner([track], WINDOW).errors(*trace, "itself", 5.0, 25.0))
    assert found.error < 0.01 * worst
    assert found.entry_frame - found.exit_frame == pytest.approx(6.4, abs=0.05)


@settings(max_examples=20, deadline=None)
@given(
    x=st.floats(-1e3, 1e3),
    y=st.floats(-1e3, 1e3),
    yaw=st.floats(-10.0, 10.0),
    which=st.sampled_from(["trace", "reaction"]),
)
def test_placing_either_track_elsewhere_changes_nothing(
    x: float, y: float, yaw: float, which: str
) -> None:
    trace, clip = smooth_track(1), smooth_track(2, 24)
    before = align_one(Aligner([ReactionTrack("it", *clip)], WINDOW), trace)
    if which == "trace":
        trace = placed(trace, x, y, yaw)
    else:
        clip = placed(clip, x, y, yaw)
    aligner = Aligner([ReactionTrack("it", *clip)], WINDOW)
    again = aligner.errors(*trace, "it", before.exit_frame, before.entry_frame)
    assert float(again) == pytest.approx(before.error, rel=1e-4, abs=ERROR_FLOOR)
    assert align_one(aligner, trace).error == pytest.approx(before.error, rel=1e-3)


# -- real hits ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.mocap
def test_alignments_of_real_hits_are_nearly_as_good_as_the_full_search(
    motions_folder: Path,
) -> None:
    """Within 2 % of the full search in 95 % of cases."""
    cases = bench.simulated(11, 400, motions_folder)
    assert "core" in cases.about
    library = library_windows(cases.tracks, cases.window)
    windows = [
        trace_windows(*trace, cases.window)
        for trace in zip(cases.positions, cases.quaternions, strict=True)
    ]
    best = bench.exhaustive(cases, windows, library).errors
    aligner = Aligner(cases.tracks, cases.window)
    rows = np.arange(len(best))
    random = np.random.default_rng(0).integers(best.shape[1], size=len(best))
    for chosen in (best.argmin(axis=1), random):
        found = aligner.align_many(cases.positions, cases.quaternions, chosen)
        ratio = found.errors / best[rows, chosen]
        assert np.mean(ratio <= bench.NEAR) >= 0.95
        assert np.median(ratio) <= 1.0
        assert found.complete.all()
