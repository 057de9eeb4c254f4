from __future__ import annotations

import numpy as np
import pytest

from dynresp.view.raster import Projection
from dynresp.view.story import Story, StoryEvent
from dynresp.view.story_moments import camera_yaw, choose_moments, main_direction
from tests.view.samples import FPS, story_of, striding


def test_every_event_and_both_sides(story: Story) -> None:
    moments = choose_moments(story, 8)
    names = [moment.events for moment in moments]
    assert names.index(("contact",)) == 1
    assert ("exit",) in names
    assert ("entry",) in names
    assert moments[-1].time_s == pytest.approx(story.duration)
    times = np.array([moment.time_s for moment in moments])
    assert (np.diff(times) >= 0.07 - 1e-9).all()
    assert [moment.phase for moment in moments][:3] == ["base motion", "physics", "blend"]


def test_events_that_fall_together_share_a_moment() -> None:
    events = [StoryEvent("contact", 0.5), StoryEvent("exit", 0.52), StoryEvent("entry", 0.9)]
    moments = choose_moments(story_of(striding(40, 1.0), events=events, phases=[]), 6)
    assert ("contact", "exit") in [moment.events for moment in moments]
    assert [m.time_s for m in moments if m.events == ("contact", "exit")] == [0.5]


def test_without_events_evenly() -> None:
    story = Story(striding(61, 1.0))
    times = [moment.time_s for moment in choose_moments(story, 5)]
    np.testing.assert_allclose(times, np.linspace(0, 2, 5))


def test_a_single_frame() -> None:
    moments = choose_moments(Story(striding(1, 1.0)), 8)
    assert [moment.frame for moment in moments] == [0]


@pytest.mark.parametrize("yaw", [-2.0, 0.0, 1.1])
def test_the_camera_sees_the_character_go_right(yaw: float) -> None:
    motion = striding(int(2 * FPS), 1.0, yaw)
    story = Story(motion)
    np.testing.assert_allclose(main_direction(story), [np.cos(yaw), np.sin(yaw)], atol=1e-9)
    view = Projection.looking(camera_yaw(story, 0.3), 0.2)
    way = view.screen(motion.root_positions[-1] - motion.root_positions[0])
    assert way[0] > 1.5
    # It stands ahead, so the character comes towards it.
    assert way[2] > 0.3


def test_on_the_spot_facing_takes_the_place_of_travel() -> None:
    story = Story(striding(30, 0.0, 2.0))
    np.testing.assert_allclose(main_direction(story), [np.cos(2.0), np.sin(2.0)], atol=1e-9)
