"""Motions that slide their feet, and motions composed of two with a blend."""

from dataclasses import replace

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.feet import legs
from dynresp.motion.feet.foot_fitting import ComposedMotion
from dynresp.motion.feet.skating import foot_slides
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import FEET, Motion, move_poses
from dynresp.motion.rotations import FloatArray
from tests.physics.samples import standing

FPS = 30.0
BLEND_S = 0.8


def walk(character: Character, seconds: float = 6.0) -> Motion:
    """The built-in walk, with its contacts."""
    motion = load_builtin("walk").resampled(FPS)
    poses = motion.poses[: round(seconds * FPS)]
    contacts = foot_contacts(character, character.kinematics(poses), FPS)
    return Motion(poses, FPS, "walk", contacts)


def drifting(character: Character, rng: np.random.Generator, seconds: float = 6.0) -> Motion:
    """A walk on a floor that drifts and turns a little under it."""
    motion = walk(character, seconds)
    time = np.arange(len(motion)) / FPS
    poses = motion.poses.copy()
    for axis in range(2):
        poses[:, axis] += 0.05 * np.sin(rng.uniform(1.0, 2.5) * time + rng.uniform(0.0, 6.0))
    turn = rotations.from_yaw(0.08 * np.sin(rng.uniform(1.0, 2.5) * time))
    poses[:, ROOT_QUAT] = rotations.multiply(turn, poses[:, ROOT_QUAT])
    return Motion(poses, FPS, "drifting", motion.contacts)


def jumping(character: Character, rng: np.random.Generator, cuts: int = 1) -> ComposedMotion:
    """A walk that is left and entered elsewhere, each time turned and shifted a little.

    What differs fades over the blend, blends overlap where there are several cuts.
    """
    motion = walk(character, 12.0)
    blend = round(BLEND_S * FPS)
    poses, source, contacts, jumps = (
        [motion.poses[:1]],
        [motion.poses[:1]],
        [motion.contacts[:1]],
        [],
    )
    at, clip, residual, since = 1, motion.poses, None, 0
    for cut in range(cuts + 1):
        length = round(rng.uniform(0.4, 0.8) * FPS) if cut < cuts else 60
        frames = np.arange(at, at + (length if cut else 40))
        stretch = clip[frames]
        played = stretch.copy()
        if residual is not None:
            left = 1.0 - rotations.ease((since + np.arange(len(frames))) / blend)
            played[:, ROOT] += left[:, None] * residual[0]
            part = rotations.from_rotation_vector(left[:, None, None] * residual[1])
            turned = rotations.multiply(played[:, 3:].reshape(len(frames), 14, 4), part)
            played[:, 3:] = turned.reshape(len(frames), -1)
        poses.append(played)
        source.append(stretch)
        contacts.append(motion.contacts[frames])
        if cut == cuts:
            break
        jumps.append(sum(map(len, poses)))
        entry = _alike(motion, int(frames[-1]), rng)
        clip = move_poses(motion.poses, rng.uniform(-0.15, 0.15), (0.0, 0.0, 0.0))
        here = played[-1]
        there = clip[entry - 1]
        shift = np.append(here[:2] - there[:2] + rng.normal(scale=0.03, size=2), 0.0)
        clip = clip + np.append(shift, np.zeros(56))
        there = clip[entry - 1]
        off = rotations.multiply(
            rotations.conjugate(there[3:].reshape(14, 4)), here[3:].reshape(14, 4)
        )
        residual = (here[ROOT] - there[ROOT], rotations.to_rotation_vector(off))
        at, since = entry, 1
    return ComposedMotion(
        np.concatenate(poses), np.concatenate(source), np.concatenate(contacts), jumps, FPS, BLEND_S
    )


def _alike(motion: Motion, frame: int, rng: np.random.Generator) -> int:
    """A frame before which the walk is much as it is at another."""
    others = np.arange(20, 100)
    others = others[np.abs(others - 1 - frame) > 4]
    joints = motion.joint_quaternions
    off = rotations.angle_between(joints[others - 1], joints[frame]).sum(axis=1)
    same = (motion.contacts[others - 1] == motion.contacts[frame]).all(axis=1)
    best = others[same][np.argsort(off[same])]
    return int(best[rng.integers(4)])


def worst_slide(character: Character, poses: FloatArray, contacts: FloatArray) -> float:
    """The farthest that a standing foot slides from a frame to the next [m]."""
    slides = foot_slides(character, character.kinematics(poses))
    return float(np.max(np.where(contacts[:-1] & contacts[1:], slides, 0.0)))


def foot_states(character: Character, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ankles (frames, 2, 3) and orientations of the feet (frames, 2, 4)."""
    states = character.kinematics(poses)
    bodies = [character.body(f"{side}_foot") for side in FEET]
    return states.positions[:, bodies], states.quaternions[:, bodies]


def same_poses(a: FloatArray, b: FloatArray, atol: float) -> None:
    """As poses: a rotation has two signs."""
    np.testing.assert_allclose(a[:, :3], b[:, :3], atol=atol)
    turns = rotations.angle_between(
        a[:, 3:].reshape(len(a), 14, 4), b[:, 3:].reshape(len(b), 14, 4)
    )
    np.testing.assert_allclose(turns, 0.0, atol=10.0 * atol)


def unjumped(motion: Motion, fitted: FloatArray | None = None) -> ComposedMotion:
    return ComposedMotion(motion.poses, motion.poses, motion.contacts, [], FPS, BLEND_S, fitted)


def crouched(character: Character, poses: FloatArray, depth: float = 0.08) -> FloatArray:
    """The same, with the root lower and the knees bent so that the feet stay."""
    ankles, _ = foot_states(character, poses)
    low = np.array(poses)
    low[:, 2] -= depth
    return legs.place_ankles(character, low, ankles)


def standing_over(
    character: Character, shift: float, crouch: float = 0.08
) -> tuple[ComposedMotion, FloatArray]:
    """Somebody who stands through a whole blend onto one who stands elsewhere, then lifts a foot.

    Returns:
        It, and where the ankles (2, 3) were before.
    """
    poses = crouched(character, standing(character, 4.0, FPS).poses, crouch)
    moved = poses.copy()
    moved[:, 0] += shift
    jump, blend = 40, 30
    left = 1.0 - rotations.ease((np.arange(len(poses)) - jump) / blend)
    played = moved.copy()
    played[:, 0] -= shift * left
    source = np.concatenate([poses[:jump], moved[jump:]])
    contacts = np.ones((len(poses), 2), dtype=bool)
    contacts[90:100, 0] = False
    composed = ComposedMotion(played, source, contacts, [jump], FPS, blend / FPS)
    contacts = contacts.copy()
    contacts[90:, 0] = False
    return replace(composed, contacts=contacts), foot_states(character, poses[:1])[0][0]


def dragged(character: Character, shift: float) -> ComposedMotion:
    """Somebody who stands on one leg, then on the other, which two blends carry on by a shift each.

    The body stays; the second stance lasts 0.7 s, both blends reach beyond its end.
    """
    poses = crouched(character, standing(character, 4.0, FPS).poses, 0.05)
    n, blend = len(poses), 30
    contacts = np.zeros((n, 2), dtype=bool)
    contacts[:40, 1] = contacts[50:72, 0] = contacts[84:, 1] = True
    ankles, _ = foot_states(character, poses)
    played, source = ankles.copy(), ankles.copy()
    jumps = [54, 62]
    for jump in jumps:
        since = np.arange(n) - jump
        played[:, 0, 0] += shift * (
            rotations.ease(since / blend) - rotations.ease((since - 30) / 20)
        )
        source[:, 0, 0] += shift * ((since >= 0) - rotations.ease((since - 30) / 20))
    return ComposedMotion(
        legs.place_ankles(character, poses, played), legs.place_ankles(character, poses, source),
        contacts, jumps, FPS, blend / FPS,
    )  # fmt: skip
