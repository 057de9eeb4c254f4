"""The motions that dynresp makes itself, so that all of it works without any motion capture.

Each is a file of `reactions/builtin`: a walk from published gait curves, key poses with timing,
which splines and inverse kinematics turn into motion, and courses, which are planned step by step.
They take the place of motion capture that is not there, and are named "built-in" everywhere.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dynresp.motion import ground
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import Label, Motion
from dynresp.support.errors import UnknownNameError
from dynresp.support.paths import reactions_folder

if TYPE_CHECKING:
    from dynresp.motion.builtin.course_spec import Course
    from dynresp.motion.builtin.footing import FootTargets
    from dynresp.motion.builtin.keypose_spec import BuiltinSpec
    from dynresp.motion.rotations import FloatArray

# How often a body that gets up on knees and hands is set on the ground.
_SETTLED = 6

PREFIX = "built-in: "
"""How the name of a built-in motion begins."""
FLAT = ("walk", "stroll", "footwork")
"""Slugs of those that move on level ground: enough for a motion graph without any recording."""


@dataclass(frozen=True)
class BuiltinInfo:
    """What a built-in motion is.

    Attributes:
        slug: What `load_builtin` takes: its file's name without ".toml".
        name: For people.
        kind: "walk", "idle", "guard", "punch" or "locomotion" for base motions, "get_up" for what
            follows a fall, "reaction" for the others.
        strategy: Of a reaction, such as "side_fall"; None for a base motion.
        what: What happens in it.
        source: Where its numbers come from; empty if they were chosen by hand.
    """

    slug: str
    name: str
    kind: str
    strategy: str | None
    what: str
    source: str


def builtin_folder() -> Path:
    """Folder of the built-in motions' files."""
    return reactions_folder() / "builtin"


def builtin_names() -> tuple[str, ...]:
    """Slugs of all built-in motions, sorted."""
    return tuple(sorted(file.stem for file in builtin_folder().glob("*.toml")))


def builtin_info(name: str) -> BuiltinInfo:
    """What a built-in motion is.

    Raises:
        UnknownNameError: There is no such built-in motion.
        SpecError: Its file is wrong.
    """
    spec = _spec(name)
    return BuiltinInfo(name, spec.name, spec.kind, spec.strategy, spec.what, spec.source)


def load_builtin(name: str, character: Character | None = None) -> Motion:
    """Make a built-in motion; made once, then kept in memory and in the user's cache folder.

    Args:
        name: One of `builtin_names`.
        character: The product's own by default.

    Returns:
        The motion, facing +X at its start, on the floor z = 0 (that about the stool also on the
        stool), named "built-in: ...", with foot contacts. A reaction has its strategy as a
        label; one that is planned step by step has the names of its phrases, such as "sit".

    Raises:
        UnknownNameError: There is no such built-in motion.
        SpecError: Its file is wrong.
    """
    return _made(name, character or default_character())


def make_motion(spec: BuiltinSpec, character: Character) -> Motion:
    """Turn a file's contents into a motion."""
    poses, tracks = make_poses(spec, character)
    name = PREFIX + spec.name
    planned = np.stack([track.locked for track in tracks], axis=1)
    if spec.course is not None:
        # Feet do not always stand on the floor z = 0; the plan says where they stand.
        return Motion(poses, spec.fps, name, planned, _phrases(spec.course, spec.fps, len(poses)))
    label = Label(spec.strategy or spec.kind, 0, len(poses))
    if spec.kind == "get_up":
        # The feet of somebody who lies down touch the floor without standing on it.
        return Motion(poses, spec.fps, name, planned, (label,))
    contacts = ground.foot_contacts(character, character.kinematics(poses), spec.fps)
    return Motion(poses, spec.fps, name, contacts, (label,))


def make_poses(spec: BuiltinSpec, character: Character) -> tuple[FloatArray, list[FootTargets]]:
    """Poses (frames, 59) of a file, and where its left and right foot were to be."""
    from dynresp.motion.builtin import course, footing, hands, keyposes
    from dynresp.motion.builtin import steady_walk as gait

    if spec.course is not None:
        return course.course_poses(spec, character)
    if spec.gait is not None:
        return gait.walk_poses(spec, character)
    times, channels = keyposes.key_channels(spec, character)
    poses = keyposes.channel_poses(channels, character)
    tracks = []
    for side, outward in (("left", 1.0), ("right", -1.0)):
        stances = [stance for stance in spec.stance if stance.foot == side]
        sole = footing.Sole.of(character, side)
        tracks.append(footing.stance_track(stances, sole, times, outward))
    led = hands.hand_tracks(spec.prop, character, times)
    propped = np.stack([track.weights > 0.0 for track in led], axis=1)
    # Again: raising the root changes how the legs bend, and so what is lowest.
    for _ in range(_SETTLED if spec.prop else 2):
        placed = footing.place_feet(character, poses, tracks, spec.fps)
        placed = hands.place_hands(character, placed, led)
        poses = footing.rest_on_ground(character, poses, placed, spec.lying, spec.fps, propped)
    placed = footing.place_feet(character, poses, tracks, spec.fps)
    return hands.place_hands(character, placed, led), tracks


def _phrases(course: Course, fps: float, frames: int) -> tuple[Label, ...]:
    """A label for each phrase of a route."""
    from dynresp.motion.builtin.course_plan import plan_course

    return tuple(
        Label(name, round(start * fps), min(round(stop * fps), frames))
        for name, start, stop in plan_course(course).phrases
    )


def _file_of(name: str) -> Path:
    names = builtin_names()
    if name not in names:
        raise UnknownNameError("built-in motion", name, names)
    return builtin_folder() / f"{name}.toml"


@functools.cache
def _spec(name: str) -> BuiltinSpec:
    from dynresp.motion.builtin.keypose_spec import read_spec

    return read_spec(_file_of(name))


@functools.lru_cache(maxsize=64)
def _made(name: str, character: Character) -> Motion:
    from dynresp.motion.builtin.motion_cache import kept_motion

    return kept_motion(_file_of(name), character, lambda: make_motion(_spec(name), character))
