"""Which moments of a story a picture shows, and where the camera stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.view.story import PhaseName, Story, StoryEvent

# Moments nearer to each other than this [s] become one.
_MERGE_S = 0.07
# How long before the first event the picture begins [s].
_LEAD_S = 0.4
# Below this distance [m] travel has no direction, and the character's facing takes its place.
_TRAVEL = 0.5


@dataclass(frozen=True)
class Moment:
    """One moment to show.

    Attributes:
        time_s: When [s] from the start of the story.
        frame: The frame nearest to it.
        events: Names of what happens then.
        phase: What drives the character then.
    """

    time_s: float
    frame: int
    events: tuple[str, ...]
    phase: PhaseName | None


def choose_moments(story: Story, count: int = 8) -> list[Moment]:
    """Choose a moment before the first event, every event, and even steps from the last to the end.

    Events at the same time become one moment with several names. Without events the moments are
    evenly spaced.

    Args:
        story: What is shown.
        count: How many moments; if there are more events, all are kept.
    """
    events = sorted(story.events, key=lambda event: event.time_s)
    if not events:
        times = np.linspace(0.0, story.duration, count)
        return _merged(story, [StoryEvent("", float(t)) for t in times])
    first, last = events[0].time_s, events[-1].time_s
    marks = [StoryEvent("", max(first - _LEAD_S, 0.0)), *events]
    wanted = max(count - len(_merged(story, marks)), 1)
    marks += [StoryEvent("", float(t)) for t in np.linspace(last, story.duration, wanted + 1)[1:]]
    return _merged(story, marks)


def _merged(story: Story, marks: list[StoryEvent]) -> list[Moment]:
    moments: list[Moment] = []
    for mark in marks:
        names = (mark.name,) if mark.name else ()
        time = min(max(mark.time_s, 0.0), story.duration)
        if moments and time - moments[-1].time_s < _MERGE_S:
            old = moments[-1]
            # An event keeps its own time; a moment without a name is dropped.
            if old.events or not names:
                moments[-1] = Moment(old.time_s, old.frame, old.events + names, old.phase)
                continue
            moments.pop()
        moments.append(Moment(time, story.frame_at(time), names, story.phase_at(time)))
    return moments


def main_direction(story: Story) -> FloatArray:
    """The direction in which the main character travels, a unit vector (2,) on the ground.

    If it ends less than half a metre from its start, the direction in which it faces at first.
    """
    path = story.motion.root_positions[:, :2]
    travel = path[-1] - path[0]
    distance = float(np.linalg.norm(travel))
    if distance >= _TRAVEL:
        return np.asarray(travel / distance)
    yaw = float(rotations.yaw_of(story.motion.root_quaternions[0]))
    return np.array([np.cos(yaw), np.sin(yaw)])


def camera_yaw(story: Story, turn: float) -> float:
    """Yaw [rad] of a camera that sees the character go to the right.

    Args:
        story: What is shown.
        turn: How far the camera stands ahead of the character's side [rad]; 0 is a side view.
    """
    direction = main_direction(story)
    return float(np.arctan2(direction[1], direction[0])) + 0.5 * np.pi + turn
