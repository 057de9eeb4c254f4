"""A tiny reaction library, hits, and how responses are compared."""

from typing import Any

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import Reaction, ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact, Punch, Push
from dynresp.response.response import Response
from dynresp.response.runtime.crowd import Crowd
from tests.physics.samples import about_y, turned

# A ball so light that it hardly changes anything.
FLUFF = {"mass": 0.01, "radius": 0.05}

HITS: list[Impact] = [
    Ball(1.0),
    Ball(1.3, speed=12.0, from_deg=180.0, height=1.3),
    Ball(1.52, from_deg=80.0, mass=3.0),
    Push(1.0),
    Push(1.21, 900.0, 0.4, from_deg=-90.0, target="pelvis"),
    Punch(1.4, from_deg=20.0, target="chest"),
]


def bowing(character: Character, frames: int = 40) -> Motion:
    """The trunk bends forward, hips back."""
    bend = np.minimum(np.arange(frames) / 20.0, 1.0)
    joints = {"waist": about_y(0.9 * bend), "back": about_y(0.3 * bend)}
    for side in ("left", "right"):
        joints[f"{side}_hip"] = about_y(-0.4 * bend)
    return Motion(turned(character, joints, frames), 30.0, "bowing")


def leaning(character: Character, frames: int = 45) -> Motion:
    """The trunk bends backward, arms up."""
    bend = np.minimum(np.arange(frames) / 15.0, 1.0)
    joints = {"waist": about_y(-0.7 * bend), "back": about_y(-0.3 * bend)}
    for side in ("left", "right"):
        joints[f"{side}_shoulder"] = about_y(-1.2 * bend)
    return Motion(turned(character, joints, frames), 30.0, "leaning")


class WatchedCrowd(Crowd):
    """A crowd that remembers all that it has shown."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._poses = [[responder.pose] for responder in self.responders]

    def advance(self) -> FloatArray:
        poses = super().advance()
        for own, pose in zip(self._poses, poses, strict=True):
            own.append(pose)
        return poses

    def shown(self, i: int = 0) -> Motion:
        return Motion(np.stack(self._poses[i]), self.config.physics.fps, "shown")


def tiny_library(**motions: Motion) -> ReactionLibrary:
    reactions = [
        Reaction(name, "upper_body_front", motion, False, False, "made in the test")
        for name, motion in motions.items()
    ]
    return ReactionLibrary("tiny", tuple(reactions), "tiny")


def same_poses(a: FloatArray, b: FloatArray, atol: float) -> None:
    np.testing.assert_allclose(a[:, ROOT], b[:, ROOT], atol=atol)
    turns = rotations.angle_between(
        a[:, 3:].reshape(len(a), 14, 4), b[:, 3:].reshape(len(b), 14, 4)
    )
    np.testing.assert_allclose(turns, 0.0, atol=10 * atol)


def same_response(a: Response, b: Response) -> None:
    np.testing.assert_array_equal(a.motion.poses, b.motion.poses)
    np.testing.assert_array_equal(a.motion.contacts, b.motion.contacts)
    for name in ("start", "contact", "contact_frame", "exit", "end", "choice", "entry", "error"):
        assert getattr(a, name) == getattr(b, name), name
    assert a.errors == b.errors
    if a.impactor is not None:
        np.testing.assert_array_equal(a.impactor, b.impactor)
