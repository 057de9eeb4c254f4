"""Feet that stand: where the ankles have to be while a foot is on the ground, steps or swings.

A standing foot turns about a point of its sole that stays where it is: about the heel while the
toes are up, about the ball while the heel is up. Legs reach their ankles by two-bone inverse
kinematics (`dynresp.motion.feet.legs`), so a foot that stands does not slide at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion import ground, rotations
from dynresp.motion.builtin.keypose_spec import Lying, Stance
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray

BLEND_TIME = 0.25
"""Time over which a foot passes between standing and following its leg's joint angles [s]."""

# A standing leg is stretched to at most this part of its length: a straight knee snaps.
_STRETCH = 0.998
# A body may be this deep in the ground before the whole character is raised [m].
_DEPTH = 0.004
# The raise rises and falls over about this time [s].
_RAISE_TIME = 0.10


@dataclass(frozen=True)
class FootTargets:
    """Where one foot has to be, frame by frame.

    Attributes:
        ankles: (frames, 3) ankle joint [m], world.
        quaternions: (frames, 4) orientation of the foot, w x y z, world.
        weights: (frames,) 1 where the foot is placed so, 0 where it follows the leg's angles.
        locked: (frames,) whether it stands.
    """

    ankles: FloatArray
    quaternions: FloatArray
    weights: FloatArray
    locked: npt.NDArray[np.bool_]

    def between(self, start: int, stop: int) -> FootTargets:
        """Frames start to stop (stop not included)."""
        part = slice(start, stop)
        return FootTargets(
            self.ankles[part], self.quaternions[part], self.weights[part], self.locked[part]
        )


@dataclass(frozen=True)
class Sole:
    """The shape of a foot as far as standing needs it.

    Attributes:
        heel: (3,) middle of the sole's rear edge in the foot's frame [m].
        ball: (3,) middle of its front edge.
        points: (n, 3) points that span the foot.
        radii: (n,) how far the foot reaches around each of them [m].
    """

    heel: FloatArray
    ball: FloatArray
    points: FloatArray
    radii: FloatArray

    @staticmethod
    def of(character: Character, side: str) -> Sole:
        """The sole of a character's foot, "left" or "right"."""
        corners = ground.sole_points(character, side)
        toe = character.model.geom(f"{side}_toe")
        axis = rotations.rotate(toe.quat, np.array([0.0, 0.0, toe.size[1]]))
        points = np.concatenate([corners, [toe.pos - axis, toe.pos + axis]])
        radii = np.array([0.0] * 4 + [float(toe.size[0])] * 2)
        return Sole(corners[:2].mean(axis=0), corners[2:].mean(axis=0), points, radii)

    def ankle_height(self, quaternions: FloatArray) -> FloatArray:
        """Height of the ankle [m] at which the foot just touches the ground; (n, 4) -> (n,)."""
        heights = rotations.rotate(quaternions[:, None], self.points)[..., 2] - self.radii
        lowest: FloatArray = heights.min(axis=1)
        return -lowest


def planted(
    sole: Sole, at: npt.ArrayLike, turn: npt.ArrayLike, pitch: FloatArray, pivot: str = "auto"
) -> tuple[FloatArray, FloatArray]:
    """Ankle and orientation of a foot that stands.

    Args:
        sole: Its shape.
        at: (2,) or (frames, 2) where the ankle is over the ground while it stands flat [m].
        turn: Turn of the toes about the vertical [rad], a number or (frames,).
        pitch: (frames,) [rad], positive with the toes up.
        pivot: The edge that stays in place: "heel", "ball", or "auto" for the one that is down.

    Returns:
        Ankles (frames, 3) [m] and quaternions (frames, 4).
    """
    yaw = rotations.from_yaw(np.broadcast_to(np.asarray(turn, dtype=np.float64), pitch.shape))
    foot = rotations.multiply(yaw, rotations.about_axis((0.0, 1.0, 0.0), -pitch))
    if pivot == "auto":
        edge = np.where(pitch[:, None] > 0, sole.heel, sole.ball)
    else:
        edge = np.broadcast_to(sole.heel if pivot == "heel" else sole.ball, (len(pitch), 3))
    ankles = rotations.rotate(yaw, edge) - rotations.rotate(foot, edge)
    ankles[:, :2] += np.asarray(at)
    ankles[:, 2] = sole.ankle_height(foot)
    return ankles, foot


def stance_track(
    stances: Sequence[Stance], sole: Sole, times: FloatArray, outward: float
) -> FootTargets:
    """The track of one foot from its stances, in order of time.

    Args:
        stances: Where it stands and when; all of one foot.
        sole: Its shape.
        times: (frames,) [s].
        outward: +1 for the left foot, -1 for the right: the sign of a turn outward.
    """
    frames = len(times)
    ankles, feet = np.zeros((frames, 3)), rotations.identity(frames)
    weights, locked = np.zeros(frames), np.zeros(frames, dtype=np.bool_)
    if not stances:
        return FootTargets(ankles, feet, weights, locked)
    pitch = _pitch(stances, times)
    turns = [np.radians(outward * stance.turn) for stance in stances]

    for stance, turn in zip(stances, turns, strict=True):
        # Rounding: a frame on the very edge of a stance belongs to it.
        here = (times >= stance.start - 1e-9) & (times <= stance.stop + 1e-9)
        ankles[here], feet[here] = planted(sole, stance.at, turn, pitch[here])
        weights[here], locked[here] = 1.0, True

    # Before the first stance and after the last, and where the leg swings freely between two: the
    # foot leaves one stance and comes to the next by easing over to the leg's own angles and back.
    for i, (stance, turn) in enumerate(zip(stances, turns, strict=True)):
        following = stances[i + 1] if i + 1 < len(stances) else None
        preceding = stances[i - 1] if i > 0 else None
        if following is not None and following.by == "step":
            gap = _between(times, stance.stop, following.start)
            ankles[gap], feet[gap] = _step(
                sole, (stance, following), turns[i : i + 2], times[gap], pitch[gap]
            )
            weights[gap] = 1.0
        else:
            room = np.inf if following is None else 0.5 * (following.start - stance.stop)
            blend = min(BLEND_TIME, room)
            near = _between(times, stance.stop, stance.stop + blend)
            ankles[near], feet[near] = planted(sole, stance.at, turn, pitch[near])
            weights[near] = 1.0 - rotations.ease((times[near] - stance.stop) / blend)
        if preceding is None or stance.by == "free":
            room = np.inf if preceding is None else 0.5 * (stance.start - preceding.stop)
            blend = min(BLEND_TIME, room)
            near = _between(times, stance.start - blend, stance.start)
            ankles[near], feet[near] = planted(sole, stance.at, turn, pitch[near])
            weights[near] = 1.0 - rotations.ease((stance.start - times[near]) / blend)
    return FootTargets(ankles, feet, weights, locked)


def _between(times: FloatArray, start: float, stop: float) -> npt.NDArray[np.intp]:
    """Frames strictly between two times."""
    return np.flatnonzero((times > start + 1e-9) & (times < stop - 1e-9))


def _step(
    sole: Sole,
    stances: tuple[Stance, Stance],
    turns: Sequence[float],
    times: FloatArray,
    pitch: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The foot in the air: off the ball where it stood, onto the heel where it comes to stand."""
    before, after = stances
    u = (times - before.stop) / (after.start - before.stop)
    share = rotations.ease(u)
    turn = turns[0] + share * (turns[1] - turns[0])
    leaving, foot = planted(sole, before.at, turn, pitch, "ball")
    coming, _ = planted(sole, after.at, turn, pitch, "heel")
    path = leaving + share[:, None] * (coming - leaving)
    path[:, 2] += after.lift * 16.0 * u**2 * (1.0 - u) ** 2
    path[:, 2] = np.maximum(path[:, 2], sole.ankle_height(foot))
    return path, foot


def _pitch(stances: Sequence[Stance], times: FloatArray) -> FloatArray:
    """Pitch of a foot over time [rad], toes up positive: through the stances' angles by PCHIP."""
    from scipy.interpolate import PchipInterpolator

    points: dict[float, float] = {}
    for stance in stances:
        length = stance.stop - stance.start
        flat = -stance.heel
        points[stance.start] = stance.land if stance.land else flat
        points[stance.start + min(0.10, length / 3)] = flat
        points[stance.stop - min(stance.push_time, length / 2)] = flat
        points[stance.stop] = flat - stance.push
    at = np.array(sorted(points))
    curve = PchipInterpolator(at, np.radians([points[t] for t in at]))
    pitch: FloatArray = curve(np.clip(times, at[0], at[-1]))
    return pitch


def place_feet(
    character: Character, poses: FloatArray, tracks: Sequence[FootTargets], fps: float
) -> FloatArray:
    """Bring the feet onto their tracks; the root is lowered where a leg would be too short.

    Args:
        character: The character.
        poses: (frames, 59) with the legs' own angles.
        tracks: Of the left and the right foot.
        fps: Frame rate [1/s].

    Returns:
        (frames, 59); the feet are nowhere below the ground.
    """
    out = poses.copy()
    out[:, 2] -= _smooth_cover(_too_far(character, poses, tracks), fps)
    states = character.kinematics(out)
    ankles, feet = legs.ankle_positions(character, states).copy(), []
    for i, (side, track) in enumerate(zip(FEET, tracks, strict=True)):
        own = states.quaternions[:, character.body(f"{side}_foot")]
        foot = rotations.slerp(own, track.quaternions, track.weights)
        weight = track.weights[:, None]
        ankles[:, i] += weight * (track.ankles - ankles[:, i])
        least = Sole.of(character, side).ankle_height(foot)
        ankles[:, i, 2] = np.maximum(ankles[:, i, 2], least)
        feet.append(foot)
    return legs.place_ankles(character, out, ankles, np.stack(feet, axis=1))


def _too_far(character: Character, poses: FloatArray, tracks: Sequence[FootTargets]) -> FloatArray:
    """By how much the root must come down for the standing legs to reach the ground (frames,)."""
    states = character.kinematics(poses)
    drop = np.zeros(len(poses))
    for side, track in zip(FEET, tracks, strict=True):
        shank, foot = character.body(f"{side}_shank"), character.body(f"{side}_foot")
        length = np.linalg.norm(character.offsets[[shank, foot]], axis=1).sum()
        away = states.positions[:, character.body(f"{side}_thigh")] - track.ankles
        level = np.sum(away[:, :2] ** 2, axis=1)
        reach = np.sqrt(np.maximum((_STRETCH * length) ** 2 - level, 0.0))
        drop = np.maximum(drop, np.where(track.locked, away[:, 2] - reach, 0.0))
    return drop


def rest_on_ground(
    character: Character,
    poses: FloatArray,
    placed: FloatArray,
    lying: Sequence[Lying],
    fps: float,
    propped: npt.NDArray[np.bool_],
) -> FloatArray:
    """Raise the character where it is in the ground; where it lies, also lower it onto it.

    Args:
        character: The character.
        poses: (frames, 59) to correct.
        placed: The same with feet and hands placed, whose bodies are looked at.
        lying: When the lowest body touches the ground.
        fps: Frame rate [1/s].
        propped: (frames, 2) whether the left and the right hand are led over the ground; it is
            the rest of the body then that lies on it.

    Returns:
        (frames, 59), with another height of the root.
    """
    from scipy.ndimage import gaussian_filter1d

    trunk_and_limbs = [i for i, name in enumerate(character.body_names) if "foot" not in name]
    heights = ground.clearances(character, character.kinematics(placed))
    for i, side in enumerate(FEET):
        heights[propped[:, i], character.body(f"{side}_forearm")] = np.inf
    height = heights[:, trunk_and_limbs].min(axis=1)
    times = np.arange(len(poses)) / fps
    share = np.zeros(len(poses))
    for span in lying:
        # A span that reaches the motion's end, or its beginning, does not ease there.
        start = span.start if span.start > times[0] else -np.inf
        stop = span.stop if span.stop < times[-1] else np.inf
        inside = np.minimum(times - start, stop - times)
        share = np.maximum(share, rotations.ease(inside / span.ease))
    down = -gaussian_filter1d(share * height, 0.02 * fps, mode="nearest")
    raised = _smooth_cover(np.maximum(-(height + down) - _DEPTH, 0.0), fps)
    out = poses.copy()
    out[:, 2] += down + raised
    return out


def _smooth_cover(needed: FloatArray, fps: float) -> FloatArray:
    """A smooth curve that is nowhere below the needed one, and zero where nothing is near."""
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d

    if not needed.any():
        return np.zeros(len(needed))
    half = max(1, round(_RAISE_TIME * fps))
    wide = maximum_filter1d(needed, 2 * half + 1, mode="nearest")
    cover: FloatArray = gaussian_filter1d(wide, half / 3.0, truncate=3.0, mode="nearest")
    return cover
