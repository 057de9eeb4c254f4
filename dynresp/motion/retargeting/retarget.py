"""From any person's skeleton to the character, with its feet on the floor.

Each body of the character takes the rotation of the source's segment away from the source's rest
pose, after the two rest poses have been aligned (the sources rest with the arms out, the character
with hanging arms). The root and the ankles keep the source's path, scaled by leg length, so that a
foot that stands in the source stands here, too, although thigh and shank have other lengths. What
is then still above the floor, or in it, is set on it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, Character, default_character
from dynresp.motion.feet import legs
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.retargeting.floor import find_floor, settle
from dynresp.motion.retargeting.rest_pose import with_upright_rest
from dynresp.motion.retargeting.segments import Segments, find_segments
from dynresp.motion.rotations import FloatArray

_DOWN = np.array([0.0, 0.0, -1.0])
_UP = np.array([0.0, 0.0, 1.0])
# Sine of the least flexion (25 degrees) at which a limb shows the plane in which it bends.
_BENT = 0.42
# Joints of the character's own skeleton lie where its bodies do, within this [m].
_SAME_PLACE = 0.002
# A foot stands firmly under a straight leg if thigh and shank are within 35 degrees of the vertical
# (the cosine), and its ankle is slower than this [m/s] and no higher than this [m] above where it
# stands lowest; for at least so long [s].
_STANDING_LEG = 0.82
_STANDING_SPEED = 0.4
_STANDING_RISE = 0.04
_STANDING_S = 0.1
# In three quarters of that time it is within 12 degrees of how it stands on average (the cosine);
# else how it tips has nothing to do with calibration.
_STEADY = 0.978
# A foot that stands tipped forward or backward by more than this [rad] is meant to: its heel is up.
_HEEL_UP = np.radians(10.0)


def retarget(
    skeleton: SkeletonMotion, character: Character | None = None, *, flat_floor: bool = True
) -> Motion:
    """Carry a skeleton's motion over to the character.

    Args:
        skeleton: The source.
        character: The character, by default the product's.
        flat_floor: Whether the source stood on level ground; if not (stairs, terrain,
            playgrounds), where it mostly stands is put at height 0 and nothing else is moved.

    Returns:
        A motion with the source's frames, rate and name, and foot contacts found.

    Raises:
        MotionError: The skeleton is not a person's.
    """
    character = character or default_character()
    segments = find_segments(skeleton)
    skeleton = with_upright_rest(skeleton, segments)
    poses, ankles = _follow(skeleton, segments, character)
    poses = legs.place_ankles(character, poses, ankles)
    poses[:, 2] -= find_floor(character, poses, skeleton.fps)
    if flat_floor:
        poses = settle(character, poses, skeleton.fps)
    states = character.kinematics(poses)
    contacts = foot_contacts(character, states, skeleton.fps)
    return Motion(poses, skeleton.fps, skeleton.name, contacts)


def _follow(
    skeleton: SkeletonMotion, segments: Segments, character: Character
) -> tuple[FloatArray, FloatArray]:
    """Poses (frames, 59) that turn as the source does, and where its ankles go (frames, 2, 3)."""
    rest = skeleton.rest_positions()
    across = rest[segments.limbs["left"]["hip"]] - rest[segments.limbs["right"]["hip"]]
    # At rest the source faces in this direction: left to right crossed with up.
    forward = rotations.from_yaw(np.arctan2(-across[0], across[1]))

    world = np.empty((skeleton.frames, len(character.body_names), 4))

    def follow(body: str, joint: int, correction: FloatArray | None = None) -> None:
        turn = forward if correction is None else rotations.multiply(correction, forward)
        world[:, character.body(body)] = rotations.multiply(skeleton.rotations[:, joint], turn)

    follow("pelvis", segments.pelvis)
    follow("chest", segments.chest)
    follow("head", segments.head)
    if segments.abdomen is None:
        pelvis, chest = (world[:, character.body(name)] for name in ("pelvis", "chest"))
        world[:, character.body("abdomen")] = rotations.slerp(pelvis, chest, np.array(0.5))
    else:
        follow("abdomen", segments.abdomen)
    for side, limb in segments.limbs.items():
        for body, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        ):
            bone = rest[limb[end]] - rest[limb[start]]
            follow(f"{side}_{body}", limb[start], rotations.between_vectors(_DOWN, bone))
        toes = rest[limb["toe"]] - rest[limb["ankle"]]
        toes = rotations.rotate(rotations.conjugate(forward), toes)
        # Feet point where the toes do; how far the sole is below the ankle, the source cannot say.
        toe_out = np.arctan2(toes[1], toes[0]) if np.hypot(toes[0], toes[1]) > 0.01 else 0.0
        follow(f"{side}_foot", limb["ankle"], rotations.from_yaw(np.clip(toe_out, -0.6, 0.6)))

    points = skeleton.joint_positions()
    scale = _leg_length(character) / _source_leg_length(rest, segments)
    ankles = scale * np.stack([points[:, segments.limbs[x]["ankle"]] for x in FEET], axis=1)
    if not _is_ours(skeleton, rest, forward, character):
        _straighten_hinges(world, character)
        _level_feet(world, character, ankles, skeleton.fps)
    poses = np.empty((skeleton.frames, 59))
    hips = [points[:, segments.limbs[side]["hip"]] for side in FEET]
    poses[:, ROOT] = scale * np.mean(hips, axis=0)
    poses[:, 3:] = character.local_rotations(world).reshape(skeleton.frames, -1)
    return poses, ankles


def _is_ours(
    skeleton: SkeletonMotion, rest: FloatArray, forward: FloatArray, character: Character
) -> bool:
    """Whether this is the character itself, as exported: then nothing is to be calibrated."""
    if not set(character.body_names) <= set(skeleton.names):
        return False
    joints = [skeleton.names.index(name) for name in character.body_names]
    found = rotations.rotate(rotations.conjugate(forward), rest[joints] - rest[joints[0]])
    own = character.kinematics(character.rest_pose).positions[0]
    return bool(np.abs(found - (own - own[0])).max() < _SAME_PLACE)


def _straighten_hinges(world: FloatArray, character: Character) -> None:
    """Turn upper arms and thighs about their own axes so that elbows and knees bend as hinges do.

    The zero of such turns depends on each source's calibration, and differs by 30
    degrees and more. One constant turn of the upper part, chosen so that over the whole motion the
    forearm bends forward and the shank backward, and one of the lower part, chosen so that it is
    not twisted on average, make motions of different sources comparable.

    Args:
        world: (frames, 14, 4) orientations of the bodies; changed in place.
        character: The character.
    """
    for side in FEET:
        for upper, lower, forward in (("upper_arm", "forearm", 1.0), ("thigh", "shank", -1.0)):
            above, below = character.body(f"{side}_{upper}"), character.body(f"{side}_{lower}")
            joint = rotations.multiply(rotations.conjugate(world[:, above]), world[:, below])
            bend = forward * rotations.rotate(joint, _DOWN)[:, :2]
            # A nearly straight limb shows no bending plane.
            bent = bend[np.linalg.norm(bend, axis=1) > _BENT]
            if len(bent):
                x, y = bent.sum(axis=0)
                turn = rotations.about_axis(_UP, np.arctan2(y, x))
                world[:, above] = rotations.multiply(world[:, above], turn)
                joint = rotations.multiply(rotations.conjugate(turn), joint)
            # What twist is left between the two, on average, is calibration as well.
            twist = rotations.yaw_of(joint)
            mean = np.arctan2(np.sin(twist).sum(), np.cos(twist).sum())
            untwist = rotations.about_axis(_UP, -mean)
            world[:, below] = rotations.multiply(world[:, below], untwist)


def _level_feet(world: FloatArray, character: Character, ankles: FloatArray, fps: float) -> None:
    """Turn the feet so that they are level, on average, while they stand under a straight leg.

    Sources do not say how the sole is oriented under the ankle, and their feet are tipped by 20
    degrees and more in the rest pose (sideways, where the legs are spread). One constant turn
    levels each foot.

    Args:
        world: (frames, 14, 4) orientations of the bodies; changed in place.
        character: The character.
        ankles: (frames, 2, 3) [m].
        fps: Frame rate [1/s].
    """
    for i, side in enumerate(FEET):
        foot = character.body(f"{side}_foot")
        upright = np.ones(len(world), dtype=bool)
        for part in ("thigh", "shank"):
            leg = rotations.rotate(world[:, character.body(f"{side}_{part}")], _UP)
            upright &= leg[:, 2] > _STANDING_LEG
        height = ankles[:, i, 2]
        if not upright.any():
            continue
        low = height < np.quantile(height[upright], 0.1) + _STANDING_RISE
        standing = upright & low & (_speeds(ankles[:, i], fps) < _STANDING_SPEED)
        if np.count_nonzero(standing) < _STANDING_S * fps:
            continue
        ups = rotations.rotate(rotations.conjugate(world[standing, foot]), _UP)
        up = ups.sum(axis=0)
        if np.quantile(ups @ up / np.linalg.norm(up), 0.25) < _STEADY:
            continue
        if abs(np.arctan2(up[0], up[2])) > _HEEL_UP:
            up[0] = 0.0
        world[:, foot] = rotations.multiply(world[:, foot], rotations.between_vectors(_UP, up))


def _speeds(points: FloatArray, fps: float) -> FloatArray:
    """Speeds [m/s] of a point (frames, 3); of a single frame zero."""
    if len(points) < 2:
        return np.zeros(len(points))
    return np.asarray(np.linalg.norm(np.gradient(points, 1.0 / fps, axis=0), axis=1))


def _leg_length(character: Character) -> float:
    """Hip to knee to ankle [m]."""
    bodies = [character.body("left_shank"), character.body("left_foot")]
    return float(np.linalg.norm(character.offsets[bodies], axis=1).sum())


def _source_leg_length(rest: FloatArray, segments: Segments) -> float:
    lengths = [
        np.linalg.norm(rest[limb[a]] - rest[limb[b]])
        for limb in segments.limbs.values()
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    return float(np.sum(lengths) / 2.0)


def t_pose_frames(character: Character, motion: Motion) -> npt.NDArray[np.bool_]:
    """Frames (frames,) in which the character stands straight with both arms held out.

    Recordings begin and end with such a pose for calibration; it is not part of the motion.
    """
    states = character.kinematics(motion.poses)
    held = np.ones(len(motion), dtype=bool)
    for side in FEET:
        sign = 1.0 if side == "left" else -1.0
        chest = states.quaternions[:, character.body("chest")]
        outward = rotations.rotate(chest, np.array([0.0, sign, 0.0]))
        for part, limit in (("upper_arm", 36.0), ("forearm", 36.0)):
            bone = rotations.rotate(states.quaternions[:, character.body(f"{side}_{part}")], _DOWN)
            cosine = np.clip(np.sum(bone * outward, axis=-1), -1.0, 1.0)
            held &= np.degrees(np.arccos(cosine)) < limit
        thigh = rotations.rotate(states.quaternions[:, character.body(f"{side}_thigh")], _UP)
        held &= thigh[:, 2] > np.cos(np.radians(25.0))
    return held


def trim_t_poses(character: Character, motion: Motion, lead_s: float = 0.4) -> Motion:
    """Cut off T-poses at the start and the end, and the time it takes to leave or enter them.

    Args:
        character: The character.
        motion: Any motion.
        lead_s: Time [s] that is cut beyond the T-pose itself, while the arms go down or up.

    Returns:
        The rest of the motion; the motion itself where it has no T-pose at its ends. A motion
        that is nothing else but a T-pose is returned whole.
    """
    flags = t_pose_frames(character, motion)
    if not flags.any() or flags.all():
        return motion
    lead = round(lead_s * motion.fps)
    near = max(1, round(0.5 * motion.fps))
    start, stop = 0, len(motion)
    if flags[:near].any():
        start = _run_end(flags, near) + lead
    if flags[-near:].any():
        stop = len(motion) - _run_end(flags[::-1], near) - lead
    if stop - start < 2:
        return motion
    return replace(motion.slice(start, stop), name=motion.name)


def _run_end(flags: npt.NDArray[np.bool_], near: int) -> int:
    """One past the last flag of the first run of flags, which begins within the first `near`."""
    first = int(np.argmax(flags[:near]))
    after = np.flatnonzero(~flags[first:])
    return first + int(after[0]) if len(after) else len(flags)
