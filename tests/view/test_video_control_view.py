import numpy as np
import pytest

from dynresp.motion.builtin.builtin_motions import load_builtin
from dynresp.view.video_control_view import (
    ActionTimeline,
    VideoControlStory,
    VideoMoment,
    _part,
    _runs,
    letter,
    write_video_control,
)


def moment(time_s: float, rows: slice, columns: slice) -> VideoMoment:
    """A grey picture with somebody in a part of it."""
    mask = np.zeros((240, 320), dtype=np.uint8)
    mask[rows, columns] = 255
    return VideoMoment(time_s, np.full((240, 320, 3), 120, dtype=np.uint8), mask)


def watched(moments: list[VideoMoment], actions: int) -> VideoControlStory:
    motion = load_builtin("walk")
    actions_seen = [None, *(k % actions for k in range(19))]
    line = ActionTimeline(
        [0.1 * (k + 1) for k in range(20)], actions_seen, actions_seen, [0, *actions_seen[1:]]
    )
    poses = np.repeat(motion.poses[:1], actions, axis=0)
    return VideoControlStory(motion, moments, line, poses, ["goes on, turns left"] * actions)


@pytest.mark.parametrize("actions", [1, 12])
def test_it_is_drawn(tmp_path, actions: int) -> None:
    everywhere = moment(0.3, slice(None), slice(None))
    moments = [everywhere, *(moment(0.1 * k, slice(50, 90), slice(9 * k, 40)) for k in range(4))]
    write_video_control(watched(moments, actions), tmp_path / "a.png", "Title", "of $x.mp4")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_a_video_in_which_nobody_is_at_the_moments_shown(tmp_path) -> None:
    write_video_control(watched([], 3), tmp_path / "a.png", "", "")
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("rows", "columns"),
    [
        (slice(100, 120), slice(100, 110)),
        (slice(0, 10), slice(310, 320)),
        (slice(20, 220), slice(100, 150)),
        (slice(0, 240), slice(0, 320)),
    ],
)
def test_pictures_are_cut_around_the_person(rows: slice, columns: slice) -> None:
    part = _part([moment(0.0, rows, columns)])
    for cut, person, whole in zip(part, (rows, columns), (240, 320), strict=True):
        assert 0 <= cut.start <= person.start
        assert person.stop <= cut.stop <= whole
    high, wide = (cut.stop - cut.start for cut in part)
    assert wide / high == pytest.approx(4 / 3, rel=0.02)
    assert wide >= 0.35 * 320


def test_steps_of_one_action_are_one() -> None:
    ends = np.array([0.1, 0.2, 0.3, 0.4])
    runs = _runs(ends - 0.1, ends, [None, 2, 2, 1])
    assert [number for *_, number in runs] == [None, 2, 1]
    np.testing.assert_allclose([run[:2] for run in runs], [(0, 0.1), (0.1, 0.3), (0.3, 0.4)])
    assert letter(2) == "C"
