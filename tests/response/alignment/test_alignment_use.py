"""The alignment in use: growing traces, whole exits, many traces, and input that is refused."""

import dataclasses
import math
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from dynresp.response.alignment.alignment import Aligner, Alignment, AlignmentConfig
from dynresp.response.search.full_search import ERROR_FLOOR
from dynresp.response.windows.windows import ReactionTrack
from dynresp.support.errors import MotionError, UnknownNameError, UsageError
from tests.oracles.alignment import Track, interpolated
from tests.response.alignment_samples import (
    ALL,
    BAD_TRACKS,
    FRAMES,
    WINDOW,
    align_one,
    reactions,
    sliding,
    smooth_track,
)

# -- sets, and traces that grow ----------------------------------------------------------------


def test_sampling_ends_where_further_sets_do_not_improve() -> None:
    trace, track = sliding(6.0)
    # The first set has a perfect match.
    for sets_without_gain in (1, 2, 3):
        config = AlignmentConfig(sets_without_gain=sets_without_gain)
        found = align_one(Aligner([track], WINDOW, config), trace)
        assert (found.sets, found.complete) == (1 + sets_without_gain, True)
        assert found.error <= ERROR_FLOOR
    assert align_one(Aligner([track], WINDOW, ALL), trace).sets == 5


def test_a_trace_may_grow_until_the_search_is_complete() -> None:
    incomplete = complete = 0
    for seed in range(12):
        aligner = Aligner(reactions(seed + 10), WINDOW)
        trace = smooth_track(seed)
        whole = align_one(aligner, trace)
        # Exits 2, 4.5, 7, 9.5, 12 and windows of 5 frames.
        for sets, frames in enumerate((7, 10, 12, 15, 17), 1):
            part = align_one(aligner, (trace[0][:frames], trace[1][:frames]))
            assert part.sets <= sets
            if part.complete:
                assert part == whole
                complete += sets < 5
                break
            assert part.sets == sets < whole.sets
            assert part.exit_frame <= frames - WINDOW.window_frames
            incomplete += 1
        else:
            pytest.fail("the whole trace was not enough")
    assert incomplete
    assert complete


def test_frames_after_the_last_window_are_ignored() -> None:
    aligner = Aligner(reactions(2), WINDOW)
    trace = smooth_track(1, FRAMES + 4)
    whole = align_one(aligner, (trace[0][:FRAMES], trace[1][:FRAMES]))
    trace[0][FRAMES:] = math.nan
    assert align_one(aligner, trace) == whole


def test_one_exit_and_few_entries() -> None:
    """As for no reaction (carry on): one exit, and entries around it."""
    window = dataclasses.replace(WINDOW, exit_min_s=0.25, exit_max_s=0.25)
    trace = smooth_track(1)
    base = ReactionTrack("base", *interpolated(trace, 4.7, 11), entry_range=(0, 7))
    aligner = Aligner([base], window)
    found = align_one(aligner, trace)
    assert (found.exit_frame, found.sets, found.complete) == (8.0, 1, True)
    assert found.entry_frame == pytest.approx(3.3, abs=0.05)
    single = ReactionTrack("one", base.positions, base.quaternions, entry_range=(3, 4))
    found = align_one(Aligner([single], window), trace)
    assert (found.exit_frame, found.entry_frame, found.refined) == (8.0, 3.0, False)


# -- whole exit frames -------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_snapping_shifts_exit_and_entry_together(seed: int) -> None:
    aligner = Aligner(reactions(seed + 10), WINDOW)
    trace = smooth_track(seed)
    found = align_one(aligner, trace)
    whole = aligner.snap(*trace, found)
    assert whole.exit_frame in (math.floor(found.exit_frame), math.ceil(found.exit_frame))
    shifted = found.entry_frame + whole.exit_frame - found.exit_frame
    shifted = min(max(shifted, 0.0), 19.0)
    # The entry moves with the exit, and then to the best one close by.
    assert abs(whole.entry_frame - shifted) <= 1.0
    there = aligner.errors(*trace, whole.reaction, whole.exit_frame, shifted)
    assert whole.error <= float(there) + 1e-6
    own = aligner.errors(*trace, whole.reaction, whole.exit_frame, whole.entry_frame)
    assert whole.error == pytest.approx(float(own))
    again = aligner.snap(*trace, whole)
    assert again.exit_frame == whole.exit_frame
    assert again.error <= whole.error + 1e-6


def test_snapping_takes_the_better_frame_and_keeps_the_entry_within_its_bounds() -> None:
    trace, track = sliding(0.0)
    aligner = Aligner([track], WINDOW)
    found = Alignment("itself", 1.0, 6.2, 6.2, 0, 1, True, True)
    whole = aligner.snap(*trace, found)
    assert (whole.exit_frame, whole.evaluations) == (6.0, 18)
    assert whole.entry_frame == pytest.approx(6.0)
    assert whole.error <= ERROR_FLOOR
    bounded = Aligner([dataclasses.replace(track, entry_range=(7, 12))], WINDOW)
    edge = Alignment("itself", 1.0, 6.9, 7.0, 0, 1, True, True)
    assert bounded.snap(*trace, edge).entry_frame >= 7.0
    with pytest.raises(MotionError, match=r"exit is at frame 6.9.* from 0 to 3"):
        aligner.snap(trace[0][:8], trace[1][:8], edge)


# -- many at once ------------------------------------------------------------------------------


def test_many_have_the_bits_that_each_has_alone() -> None:
    aligner = Aligner(reactions(20, 21, 22), WINDOW)
    traces = [smooth_track(seed) for seed in range(16)]
    rows = np.random.default_rng(0).integers(0, 3, size=(16, 2))
    stacked = [np.stack(part) for part in zip(*traces, strict=True)]

    def alone(n: int) -> list[Alignment]:
        return aligner.align(*traces[n], [aligner.names[row] for row in rows[n]])

    many = aligner.align_many(*stacked, rows)
    first = aligner.align_many(*stacked, rows[:, 0])
    with ThreadPoolExecutor(4) as pool:
        each = list(pool.map(alone, range(16)))
    assert many.errors.shape == (16, 2)
    for n, found in enumerate(each):
        for k, one in enumerate(found):
            assert one.reaction == many.names[many.rows[n, k]]
            assert one.error == many.errors[n, k]
            assert one.exit_frame == many.exit_frames[n, k]
            assert one.entry_frame == many.entry_frames[n, k]
            assert one.evaluations == many.evaluations[n, k]
            assert one.sets == many.sets[n, k]
            assert one.complete == many.complete[n, k]
            assert one.refined == many.refined[n, k]
    np.testing.assert_array_equal(first.errors, many.errors[:, 0])
    none = aligner.align_many(*(part[:0] for part in stacked), rows[:0])
    assert none.errors.shape == (0, 2)


def test_rows_that_do_not_fit_are_refused() -> None:
    aligner = Aligner(reactions(20, 21), WINDOW)
    trace = [part[None] for part in smooth_track(1)]
    for rows in ([2], [-1], [0.5], [0, 1], 0):
        with pytest.raises(MotionError, match="whole number from 0 to 1"):
            aligner.align_many(*trace, rows)


def test_an_aligner_can_be_pickled() -> None:
    aligner = Aligner(reactions(20), WINDOW)
    again = pickle.loads(pickle.dumps(aligner))
    assert align_one(again, smooth_track(1)) == align_one(aligner, smooth_track(1))


# -- errors ------------------------------------------------------------------------------------


def _short(track: Track) -> Track:
    return track[0][:4], track[1][:4]


def _of_one_frame(track: Track) -> Track:
    return track[0][0], track[1][0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        *BAD_TRACKS,
        (_short, "has 4 frames"),
        (_of_one_frame, "expected .frames, bodies, 3."),
    ],
)
def test_bad_tracks_are_refused(spoil: Callable[[Track], Track], message: str) -> None:
    aligner = Aligner(reactions(2), WINDOW)
    bad = spoil(smooth_track(1))
    both = [np.stack([part, part]) for part in bad]
    with pytest.raises(MotionError, match=f"simulated trace: .*{message}"):
        align_one(aligner, bad)
    with pytest.raises(MotionError, match=f"simulated trace: .*{message}"):
        aligner.errors(*bad, aligner.names[0], 3, 3)
    with pytest.raises(MotionError, match=f"simulated trace: .*{message}"):
        aligner.align_many(*both, [0, 0])
    with pytest.raises(MotionError, match=f"reaction 'a': .*{message}"):
        Aligner([ReactionTrack("a", *spoil(smooth_track(1, 24)))], WINDOW)


def test_traces_too_short_for_the_earliest_exit_or_of_another_character_are_refused() -> None:
    aligner = Aligner(reactions(2), WINDOW)
    with pytest.raises(MotionError, match=r"has 6 frames.* frames 2 to 2 need 7"):
        align_one(aligner, smooth_track(1, 6))
    with pytest.raises(MotionError, match="trace has 3 bodies, the reactions 5"):
        align_one(aligner, smooth_track(1, FRAMES, 3))


def test_frames_and_names_out_of_bounds_are_refused() -> None:
    aligner = Aligner([ReactionTrack("a", *smooth_track(2, 24), entry_range=(3, 10))], WINDOW)
    trace = smooth_track(1)
    with pytest.raises(MotionError, match=r"'a': exit frames from -1 to 12\.5.* 0 to 12"):
        aligner.errors(*trace, "a", [-1.0, 12.5], 4.0)
    with pytest.raises(MotionError, match=r"entry frames from 2 to 4.* 3 to 9"):
        aligner.errors(*trace, "a", 4.0, [2, 4])
    with pytest.raises(MotionError, match="exit frames from nan"):
        aligner.errors(*trace, "a", math.nan, 4.0)
    with pytest.raises(UnknownNameError, match="unknown reaction 'b'"):
        align_one(aligner, trace, "b")
    assert aligner.errors(*trace, "a", [], []).shape == (0,)


def test_unusable_libraries_are_refused() -> None:
    track = reactions(1)[0]
    with pytest.raises(MotionError, match="empty"):
        Aligner([], WINDOW)
    with pytest.raises(MotionError, match="more than once: reaction 1"):
        Aligner([track, track], WINDOW)
    with pytest.raises(MotionError, match="'b' has 3 bodies, reaction 'reaction 1' has 5"):
        Aligner([track, ReactionTrack("b", *smooth_track(1, 20, 3))], WINDOW)
    for bounds in ((-1, 3), (3, 3), (0, 21)):
        with pytest.raises(MotionError, match="first < last <= 20"):
            Aligner([dataclasses.replace(track, entry_range=bounds)], WINDOW)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("step_s", 0.0),
        ("step_s", math.nan),
        ("step_s", math.inf),
        ("sets_without_gain", 0),
        ("starts", 0),
        ("most_iterations", 0),
    ],
)
def test_settings_out_of_range_are_named(field: str, value: float) -> None:
    with pytest.raises(UsageError, match=field):
        dataclasses.replace(ALL, **{field: value})  # type: ignore[arg-type]
