"""Windows: facing frames, and tracks and libraries that are refused."""

from collections.abc import Callable

import pytest

from dynresp.response.windows.windows import (
    ReactionTrack,
    WindowErrorConfig,
    facing_frames,
    library_windows,
    make_windows,
    trace_windows,
)
from dynresp.support.errors import MotionError
from tests.oracles.alignment import Track
from tests.response.alignment_samples import BAD_TRACKS, smooth_track

CONFIG = WindowErrorConfig(fps=30.0, window_s=5 / 30, exit_max_s=6 / 30)
TRACE_FRAMES = 6 + 5


def test_a_pelvis_upside_down_has_a_yaw_of_zero() -> None:
    assert facing_frames((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))[1] == 0.0


def test_shared_arrays_are_read_only() -> None:
    library = library_windows([ReactionTrack("a", *smooth_track(1, 20))], CONFIG)
    for array in (library.buffer, library.offsets, library.windows[0].data):
        with pytest.raises(ValueError, match="read-only"):
            array.ravel()[...] = 0


@pytest.mark.parametrize(("spoil", "message"), BAD_TRACKS)
def test_bad_tracks_are_refused(spoil: Callable[[Track], Track], message: str) -> None:
    with pytest.raises(MotionError, match=f"simulated trace: .*{message}"):
        trace_windows(*spoil(smooth_track(1, TRACE_FRAMES)), CONFIG)
    with pytest.raises(MotionError, match=f"reaction 'a': .*{message}"):
        library_windows([ReactionTrack("a", *spoil(smooth_track(1, 20)))], CONFIG)


def test_tracks_too_short_for_a_window_are_refused() -> None:
    with pytest.raises(MotionError, match=r"simulated trace: has 10 frames.* need 11"):
        trace_windows(*smooth_track(1, TRACE_FRAMES - 1), CONFIG)
    with pytest.raises(MotionError, match="reaction 'a': has 4 frames, a window needs 5"):
        library_windows([ReactionTrack("a", *smooth_track(1, 4))], CONFIG)
    with pytest.raises(MotionError, match="no window"):
        make_windows(*smooth_track(1, 20), [], CONFIG)


@pytest.mark.parametrize("bounds", [(-1, 3), (3, 3), (0, 17)])
def test_entry_bounds_outside_the_clip_are_refused(bounds: tuple[int, int]) -> None:
    with pytest.raises(MotionError, match="first < last <= 16"):
        library_windows([ReactionTrack("a", *smooth_track(1, 20), entry_range=bounds)], CONFIG)


def test_unusable_libraries_are_refused() -> None:
    track = ReactionTrack("a", *smooth_track(1, 20))
    with pytest.raises(MotionError, match="empty"):
        library_windows([], CONFIG)
    with pytest.raises(MotionError, match="more than once: a"):
        library_windows([track, track], CONFIG)
    with pytest.raises(MotionError, match="'b' has 3 bodies, reaction 'a' has 5"):
        library_windows([track, ReactionTrack("b", *smooth_track(1, 20, 3))], CONFIG)
