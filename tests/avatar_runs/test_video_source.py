from collections.abc import Iterator

import numpy as np
import pytest

from dynresp.avatar_runs.video_source import evenly, later, open_source
from dynresp.locomotion.vision.segmentation import Picture
from dynresp.support.errors import MotionFileError, UsageError


class Clock:
    """A clock that shows the time to which a test sets it."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def delivered(clock: Clock, times_s: list[float]) -> Iterator[Picture]:
    """A camera whose pictures come at these times and show their number."""
    for number, time_s in enumerate(times_s):
        clock.now = 100.0 + time_s
        yield np.full((2, 2, 3), number, dtype=np.uint8)


def numbers(pictures: Iterator[Picture]) -> list[int]:
    return [int(picture[0, 0, 0]) for picture in pictures]


def test_pictures_in_time_pass_as_they_are() -> None:
    clock = Clock()
    times = (np.arange(90) / 30.0).tolist()
    assert numbers(evenly(delivered(clock, times), 30.0, clock)) == list(range(90))


def test_a_slow_camera_shows_pictures_twice() -> None:
    clock = Clock()
    given = numbers(evenly(delivered(clock, [k / 15.0 for k in range(30)]), 30.0, clock))
    assert given == [0, *(k for k in range(1, 30) for _ in range(2))]


def test_pictures_of_a_fast_camera_are_dropped() -> None:
    clock = Clock()
    given = numbers(evenly(delivered(clock, [k / 60.0 for k in range(120)]), 30.0, clock))
    assert given == list(range(0, 120, 2))


@pytest.mark.parametrize("seed", range(5))
def test_the_number_of_pictures_follows_the_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clock = Clock()
    times = np.cumsum(rng.uniform(0.0, 0.2, 200))
    given = numbers(evenly(delivered(clock, times.tolist()), 30.0, clock))
    assert len(given) == pytest.approx((times[-1] - times[0]) * 30.0 + 1, abs=1)
    assert given == sorted(given)


def test_after_a_break_time_goes_on_where_it_stopped() -> None:
    clock = Clock()
    times = [k / 30.0 for k in range(30)] + [3600.0 + k / 30.0 for k in range(30)]
    assert numbers(evenly(delivered(clock, times), 30.0, clock)) == list(range(60))


def test_the_first_seconds_can_be_left_out() -> None:
    clock = Clock()
    seconds: list[float] = []
    pictures = later(delivered(clock, [0.5 * k for k in range(20)]), 5.0, seconds.append, clock)
    assert numbers(pictures) == list(range(10, 20))
    assert seconds == pytest.approx([0.5 * k for k in range(10)])


def test_wrong_sources_are_refused() -> None:
    for text in ("camera:", "camera:-1", "camera:x"):
        with pytest.raises(UsageError, match="camera:N"):
            open_source(text)
    with pytest.raises(MotionFileError, match="no such file"):
        open_source("cameras.mp4")
