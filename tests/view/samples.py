"""Made-up motions and stories for the tests of views."""

from __future__ import annotations

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import default_character
from dynresp.motion.motion import Motion
from dynresp.view.story import MovingSphere, Story, StoryEvent, StoryPhase

FPS = 30.0


def striding(frames: int, speed: float, yaw: float = 0.3) -> Motion:
    """Someone who swings arms and legs once a second and glides along at a speed [m/s]."""
    character = default_character()
    poses = np.tile(character.rest_pose, (frames, 1))
    swing = 0.5 * np.sin(2 * np.pi * np.arange(frames) / FPS)
    for joint, sign in (("left_hip", 1), ("right_hip", -1), ("left_shoulder", -1)):
        at = 7 + 4 * character.joint(joint)
        poses[:, at : at + 4] = rotations.about_axis((0, 1, 0), sign * swing)
    poses[:, 0] = speed * np.arange(frames) / FPS
    return Motion(poses, FPS, "striding").moved(yaw, (1.0, -2.0, 0.0))


def story_of(motion: Motion, **parts: object) -> Story:
    """A ball comes from ahead and meets the chest at a third of the motion."""
    hit = len(motion) // 3
    chest = default_character().kinematics(motion.poses).centers[hit, 2]
    steps = np.arange(len(motion)) - hit
    ahead = rotations.rotate(rotations.from_yaw(0.3), (1.0, 0.0, 0.0))
    way = chest + ahead * (0.23 + 0.15 * np.abs(steps)[:, None])
    way[:2] = np.nan
    times = np.array([hit, hit + 4, hit + 8, len(motion) - 1]) / FPS
    given: dict[str, object] = {
        "spheres": [MovingSphere("ball", 0.12, way)],
        "events": [
            StoryEvent(name, t)
            for name, t in zip(("contact", "exit", "entry"), times[:3], strict=True)
        ],
        "phases": [
            StoryPhase("base motion", 0.0, times[0]),
            StoryPhase("physics", times[0], times[1]),
            StoryPhase("blend", times[1], times[2]),
            StoryPhase("reaction", times[2], times[3]),
        ],
        "title": "a <ball> & a walk",
        "subtitle": "made for a test",
    }
    return Story(motion, **(given | parts))  # type: ignore[arg-type]
