from __future__ import annotations

import numpy as np
import pytest

from dynresp.support.errors import MotionError, UnknownNameError
from dynresp.view.story import MovingCapsule, MovingSphere, Story, StoryEvent, StoryPhase, row_at
from tests.view.samples import FPS, striding


def test_phase_at_each_time(story: Story) -> None:
    found = [story.phase_at(k / FPS) for k in (0, 9, 10, 14, 18, 29)]
    assert found == ["base motion", "base motion", "physics", "blend", "reaction", "reaction"]


def test_no_phase_where_the_story_does_not_say() -> None:
    story = Story(striding(10, 1.0), phases=[StoryPhase("physics", 0.1, 0.2)])
    assert story.phase_at(0.0) is None
    assert story.phase_at(0.15) == "physics"
    assert story.phase_at(0.3) is None


def test_where_phases_overlap_the_later_one_counts() -> None:
    phases = [StoryPhase("base motion", 0.0, 0.3), StoryPhase("physics", 0.1, 0.2)]
    story = Story(striding(10, 1.0), phases=phases)
    assert [story.phase_at(t) for t in (0.05, 0.15, 0.25)] == [
        "base motion",
        "physics",
        "base motion",
    ]


def test_a_phase_has_one_of_four_names() -> None:
    with pytest.raises(UnknownNameError, match=r"'blending'.*Did you mean 'blend'"):
        StoryPhase("blending", 0.0, 1.0)  # type: ignore[arg-type]
    with pytest.raises(MotionError, match="before it begins"):
        StoryPhase("blend", 1.0, 0.5)


def test_absent_rows(story: Story) -> None:
    rows = story.spheres[0].positions
    assert row_at(rows, 1) is None
    assert row_at(rows, len(rows)) is None
    np.testing.assert_array_equal(row_at(rows, 2), rows[2])


def test_arrays_are_read_only(story: Story) -> None:
    with pytest.raises(ValueError, match="read-only"):
        story.spheres[0].positions[0] = 0.0


@pytest.mark.parametrize("rows", [[[0, 0]], [0, 0, 0], [[0, np.nan, 0]], [[0, np.inf, 0]]])
def test_wrong_rows(rows: list[object]) -> None:
    with pytest.raises(MotionError, match="ball"):
        MovingSphere("ball", 0.1, np.array(rows, dtype=float))


def test_wrong_sizes() -> None:
    rows = np.zeros((2, 3))
    with pytest.raises(MotionError, match="radius"):
        MovingSphere("ball", 0.0, rows)
    with pytest.raises(MotionError, match="half_length"):
        MovingCapsule("arm", 0.1, np.nan, rows, np.zeros((2, 4)))
    with pytest.raises(MotionError, match="quaternions"):
        MovingCapsule("arm", 0.1, 0.2, rows, np.zeros((3, 4)))
    with pytest.raises(MotionError, match="not finite where it is present"):
        MovingCapsule("arm", 0.1, 0.2, rows, np.full((2, 4), np.nan))


def test_one_clock() -> None:
    motion = striding(10, 1.0)
    with pytest.raises(MotionError, match="resampled"):
        Story(motion, others=[motion.resampled(60.0)])
    with pytest.raises(MotionError, match="outside the story"):
        Story(motion, events=[StoryEvent("contact", 2.0)])
