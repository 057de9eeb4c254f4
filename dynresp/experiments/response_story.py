"""What the recording, pictures and video show of a response: ball, second character, events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT
from dynresp.motion.motion import Motion, move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact, Strike
from dynresp.physics.prepared_impact import GRAVITY, PreparedImpact
from dynresp.response.response import CARRY_ON, Response
from dynresp.view.story import MovingSphere, Story, StoryEvent, StoryPhase

# How long before its simulated flight a ball is shown, and a fist [s].
_BALL_SEEN_S = 1.3
_FIST_SEEN_S = 0.1
# After the simulation a ball rolls to a stop: its speed falls to 1/e in this time [s].
_ROLL_S = 0.7


@dataclass(frozen=True)
class ResponseStory:
    """A response as it is written and shown.

    Attributes:
        story: The motion from shortly before the hit on, and what goes with it.
        first: Frame of the response's motion that is the story's first.
    """

    story: Story
    first: int


def response_story(
    response: Response, impact: Impact, lead_in_s: float, title: str, subtitle: str
) -> ResponseStory:
    """Cut a response to what is shown, and add ball, second character and events.

    Args:
        response: The response.
        impact: What hit.
        lead_in_s: How much of the base motion is shown before the hit [s].
        title: First line.
        subtitle: Second line.
    """
    motion, fps = response.motion, response.motion.fps
    prepared = response.prepared
    due = round(prepared.start + prepared.due_s * fps)
    hit = due if response.contact_frame is None else response.contact_frame
    first = max(0, min(hit, len(motion) - 1) - round(lead_in_s * fps))
    shown = motion.slice(first, len(motion))
    spheres = []
    if response.impactor is not None and prepared.radius > 0.0:
        name = "fist" if prepared.weightless else "ball"
        track = _ball_track(response.impactor[:, :3], prepared, fps)[first:]
        spheres.append(MovingSphere(name, prepared.radius, track))
    others = []
    if isinstance(impact, Strike):
        others.append(_second_character(impact, prepared, first, len(shown), fps))
    story = Story(
        motion=shown,
        spheres=spheres,
        others=others,
        events=_events(response, first, shown.duration),
        phases=_phases(response, first, shown.duration),
        title=title,
        subtitle=subtitle,
    )
    return ResponseStory(story, first)


def _events(response: Response, first: int, end: float) -> list[StoryEvent]:
    fps = response.motion.fps
    events = []
    if response.contact is not None:
        at = (response.start - first) / fps + response.contact.time_s
        events.append(StoryEvent("contact", min(at, end)))
    if response.exit is not None and response.end is not None:
        events.append(StoryEvent("exit", (response.exit - first) / fps))
        events.append(StoryEvent("blend ends", (response.end - first) / fps))
    return events


def _phases(response: Response, first: int, end: float) -> list[StoryPhase]:
    fps = response.motion.fps
    if response.exit is None or response.end is None or response.contact is None:
        return [StoryPhase("base motion", 0.0, end)]
    contact = (response.start - first) / fps + response.contact.time_s
    out, done = ((frame - first) / fps for frame in (response.exit, response.end))
    return [
        StoryPhase("base motion", 0.0, contact),
        StoryPhase("physics", contact, out),
        StoryPhase("blend", out, done),
        StoryPhase("base motion" if response.choice == CARRY_ON else "reaction", done, end),
    ]


def _ball_track(track: FloatArray, prepared: PreparedImpact, fps: float) -> FloatArray:
    """Where a ball is in every frame (frames, 3), also before and after it is simulated.

    Args:
        track: (frames, 3) [m], NaN where it was not simulated.
        prepared: How it was launched.
        fps: Frame rate [1/s].
    """
    assert prepared.impactor_pose is not None
    assert prepared.impactor_velocity is not None
    full = track.copy()
    start = prepared.start
    pull = np.array([0.0, 0.0, 0.0 if prepared.weightless else -GRAVITY])
    seen = _FIST_SEEN_S if prepared.weightless else _BALL_SEEN_S
    for frame in range(start - 1, max(-1, start - 1 - round(seen * fps)), -1):
        if frame >= len(full):
            continue
        t = (frame - start) / fps
        place = prepared.impactor_pose[:3] + prepared.impactor_velocity[:3] * t + 0.5 * pull * t**2
        if place[2] < prepared.radius:
            break
        full[frame] = place
    known = np.flatnonzero(np.isfinite(track[:, 0]))
    if prepared.weightless or len(known) < 2:
        return full
    last = int(known[-1])
    place, velocity = full[last].copy(), (full[last] - full[last - 1]) * fps
    for frame in range(last + 1, len(full)):
        velocity = velocity + pull / fps
        place = place + velocity / fps
        if place[2] <= prepared.radius:
            place[2], velocity[2] = prepared.radius, 0.0
            velocity *= np.exp(-1.0 / (_ROLL_S * fps))
        full[frame] = place
    return full


def _second_character(
    impact: Strike, prepared: PreparedImpact, first: int, frames: int, fps: float
) -> Motion:
    """The whole of the second character's motion, placed as it is in the simulation."""
    assert prepared.opponent is not None
    began = impact.motion_time - prepared.due_s
    there, own = prepared.opponent.poses[0], impact.motion.sample([began])[0]
    turn = float(rotations.yaw_of(there[ROOT_QUAT]) - rotations.yaw_of(own[ROOT_QUAT]))
    shift = there[ROOT] - rotations.rotate(rotations.from_yaw(turn), own[ROOT])
    times = began + (first - prepared.start + np.arange(frames)) / fps
    poses = move_poses(impact.motion.sample(times), turn, [shift[0], shift[1], 0.0])
    return Motion(poses, fps, impact.motion.name)
