"""Fitting hands to the bars of a playground, and measuring how they hold.

When a walk jumps from one clip to another, the motion is blended, and a hand on a bar slips. So
hands are fitted after the feet (by constraints, as feet are: Lee et al. 2002, 4.1.1). While a
hand holds, one point of it stays at one point of the bar, and the hand may turn about it. Both
points come from the recorded frames; a frame counts less while a blend goes on. If the clips before
and after a jump hold different bars, the hand lets go of the first and takes the second. Between
holds the correction fades. The root follows the hands, and arms and legs follow by two-bone inverse
kinematics.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import (
    Composition,
    compose,
    standing_between,
    steps_at_rate,
)
from dynresp.locomotion.worlds.playground import Playground, recorded_playground
from dynresp.locomotion.worlds.world_contacts import PALM, palms
from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support import smoothing
from dynresp.support.errors import UsageError
from dynresp.support.runs import runs

GRIP_M = 0.036
"""Largest distance from the middle of a hand to the surface of the bar that it holds [m]."""
REGRIP_S = 0.3
"""Time in which a hand goes to another bar, after a jump to a clip that holds another one [s]."""

# Longest time in which a correction fades after a hand lets go, and grows before it takes hold [s].
_EASE_S = 0.4
# Time in which the root follows the hands [s].
_FOLLOW_S = 0.5
# Part of its length to which an arm or a leg is stretched, unless the walk stretches it more.
_STRAIGHT = 0.99
# Weight of a frame in the middle of a blend, beside 1 for a recorded one.
_MIN_WEIGHT = 1e-3
# Largest distance of a point of a hand from its middle [m].
_HAND_M = 0.06
# Corrections below this are rounding [m].
_ROUNDING_M = 1e-9
# Most steps in which the root is moved until all holds are within reach.
_ROOT_STEPS = 12


@dataclass(frozen=True, eq=False)
class Hold:
    """A time during which a hand holds a bar.

    Attributes:
        hand: 0 for the left hand, 1 for the right one.
        start: First frame.
        stop: One past the last frame.
        bar: Number of the bar.
        place: (3,) the point of the bar that is held [m].
        grip: (3,) the point of the hand that is there, in the forearm's frame [m].
    """

    hand: int
    start: int
    stop: int
    bar: int
    place: FloatArray
    grip: FloatArray


@dataclass(frozen=True, eq=False)
class Grips:
    """How well hands hold, hold by hold.

    Attributes:
        slip: (h,) largest distance of the stillest point of the hand from its mean place [m].
        off_bar: (h,) largest distance of the middle of the hand from the bar's axis [m].
    """

    slip: FloatArray
    off_bar: FloatArray


def compose_on_playground(
    graph: MotionGraph,
    character: Character,
    frames: npt.ArrayLike,
    fps: float | None = None,
    playground: Playground | None = None,
) -> Composition:
    """Play a walk through a playground, with hands on its bars.

    Args:
        graph: In `Coordinates.FIXED`, with contacts of hands; see `playground_contacts`.
        character: The character.
        frames: (k,) a walk; two frames or more.
        fps: Frame rate of the motion, by default the graph's.
        playground: The bars, by default `recorded_playground`.

    Returns:
        As `compose`; `motion` is fitted.

    Raises:
        UsageError: The graph is in other coordinates, or has no contacts of hands.
    """
    playground = playground or recorded_playground()
    played = compose(graph, character, frames, fps=fps)
    motion = played.motion
    held = find_holds(graph, character, played, playground)
    poses = _hold_on(character, motion, held)
    fitted = Motion(poses, motion.fps, "walk through a playground", motion.contacts)
    return Composition(played.frames, fitted, played.jumps, played.placements, played.unfitted)


def find_holds(
    graph: MotionGraph,
    character: Character,
    played: Composition,
    playground: Playground | None = None,
) -> list[Hold]:
    """Find when and where the hands of a composed walk hold.

    Args:
        graph: The graph of the walk.
        character: The character.
        played: The composed walk.
        playground: The bars, by default `recorded_playground`.

    Returns:
        The holds: first those of the left hand; of each hand in the order of time.

    Raises:
        UsageError: The graph is in other coordinates, or has no contacts of hands.
    """
    database, rate = graph.database, graph.config.fps
    if graph.config.coordinates is not Coordinates.FIXED or database.contacts.shape[1] < 4:
        raise UsageError(
            "hands are fitted in a graph in fixed coordinates with four columns of contacts, got "
            f"{graph.config.coordinates.value} and {database.contacts.shape[1]}; build it with "
            "Coordinates.FIXED and playground_contacts"
        )
    playground = playground or recorded_playground()
    path, fps = played.frames, played.motion.fps
    step, part = steps_at_rate(len(path), rate, fps)
    contacts = standing_between(database.contacts[path, 2:4], step, part)
    near = np.where(part < 0.5, step, step + 1)
    states = character.kinematics(database.poses[path])
    middles = palms(character, states)
    bars, _ = playground.nearest(middles)
    weights = _weights(played.jumps, len(path), max(1, round(graph.config.blend_s * rate)))
    cut = max(1, round(REGRIP_S * fps))
    holds = []
    for hand, side in enumerate(FEET):
        forearm = character.body(f"{side}_forearm")
        for start, stop in runs(contacts[:, hand]):
            for first, last in _one_bar(bars[near[start:stop], hand], cut):
                knots = np.unique(near[start + first : start + last])
                bar = playground.bars[int(np.bincount(bars[knots, hand]).argmax())]
                weight = weights[knots] / weights[knots].sum()
                held = bar.closest(middles[knots, hand])
                place = bar.closest(weight @ held)
                back = rotations.conjugate(states.quaternions[knots, forearm])
                away = weight @ rotations.rotate(back, held - middles[knots, hand])
                far = float(np.linalg.norm(away))
                away *= min(1.0, (GRIP_M + bar.radius) / max(far, 1e-9))
                number = playground.bars.index(bar)
                holds.append(Hold(hand, start + first, start + last, number, place, PALM + away))
    return holds


def grips(
    character: Character, motion: Motion, holds: list[Hold], playground: Playground | None = None
) -> Grips:
    """Measure how hands hold, from the poses alone.

    Args:
        character: The character.
        motion: The motion.
        holds: When and which bars; see `find_holds`.
        playground: The bars, by default `recorded_playground`.
    """
    playground = playground or recorded_playground()
    states = character.kinematics(motion.poses)
    middles = palms(character, states)
    slip, off = [], []
    for hold in holds:
        rows = slice(hold.start, hold.stop)
        forearm = character.body(f"{FEET[hold.hand]}_forearm")
        slip.append(_stillest(middles[rows, hold.hand], states.quaternions[rows, forearm]))
        off.append(float(playground.bars[hold.bar].distance(middles[rows, hold.hand]).max()))
    return Grips(np.array(slip), np.array(off))


def _weights(jumps: npt.NDArray[np.intp], n: int, blend: int) -> FloatArray:
    """Weight (n,) of each frame of a walk: small while a blend goes on."""
    frames = np.arange(n)
    before = np.searchsorted(jumps, frames, side="right") - 1
    weight = np.ones(n)
    inside = before >= 0
    weight[inside] = rotations.ease((frames[inside] - jumps[before[inside]]) / blend) ** 2
    return weight + _MIN_WEIGHT


def _one_bar(bars: npt.NDArray[np.intp], cut: int) -> list[tuple[int, int]]:
    """Parts of a run of contact in which one bar is nearest; later ones begin after a regrip."""
    edges = [0, *(np.flatnonzero(np.diff(bars)) + 1).tolist(), len(bars)]
    parts = [(a + (cut if a else 0), b) for a, b in itertools.pairwise(edges)]
    return [(a, b) for a, b in parts if b > a]


def _hold_on(character: Character, motion: Motion, holds: list[Hold]) -> FloatArray:
    """Poses (n, 59) with every hold in its place."""
    poses, n = np.array(motion.poses), len(motion)
    if not holds:
        return poses
    states = character.kinematics(poses)
    ease = max(1, round(_EASE_S * motion.fps))
    # Two feet, then two hands.
    shifts, weights = np.zeros((n, 4, 3)), np.zeros((n, 4))
    grip, ends = np.zeros((n, 2, 3)), np.zeros((n, 2, 3))
    grip[:] = PALM
    for hand, side in enumerate(FEET):
        mine = [hold for hold in holds if hold.hand == hand]
        forearm = character.body(f"{side}_forearm")
        _carry(grip[:, hand], mine)
        turned = rotations.rotate(states.quaternions[:, forearm], grip[:, hand])
        ends[:, hand] = states.positions[:, forearm] + turned
        for hold in mine:
            rows = slice(hold.start, hold.stop)
            shifts[rows, 2 + hand] = hold.place - ends[rows, hand]
        spans = [(hold.start, hold.stop) for hold in mine]
        weights[:, 2 + hand] = _fade(shifts[:, 2 + hand], spans, ease)
        weights[:, hand] = _fade(shifts[:, hand], runs(motion.contacts[:, hand]), ease)
    ankles = legs.ankle_positions(character, states)
    feet = states.quaternions[:, [character.body(f"{side}_foot") for side in FEET]]
    tips = np.concatenate([ankles, ends], axis=1)
    root = _root(character, states, tips, shifts, weights, motion.fps)
    # Feet and hands that are free go with the root.
    shifts += (1.0 - weights)[..., None] * root[:, None]
    poses[:, :3] += root
    poses = legs.place_ankles(character, poses, ankles + shifts[:, :2], feet)
    return _place_hands(character, poses, grip, ends + shifts[:, 2:])


def _carry(grip: FloatArray, holds: list[Hold]) -> None:
    """Set the gripping point of a hand (n, 3, in place) to that of the nearest hold."""
    for i, hold in enumerate(holds):
        first = 0 if i == 0 else (holds[i - 1].stop + hold.start) // 2
        last = len(grip) if i + 1 == len(holds) else (hold.stop + holds[i + 1].start) // 2
        grip[first:last] = hold.grip


def _fade(shift: FloatArray, spans: list[tuple[int, int]], ease: int) -> FloatArray:
    """Let a correction (n, 3, in place) fade between spans; returns each frame's weight (n,)."""
    n = len(shift)
    weight = np.zeros(n)
    bounds = [(0, 0), *spans, (n, n)]
    for start, stop in spans:
        weight[start:stop] = 1.0
    for i, (start, stop) in enumerate(spans, 1):
        before, after = start - bounds[i - 1][1], bounds[i + 1][0] - stop
        for last, step, room in ((start, -1, before), (stop - 1, 1, after)):
            away = np.arange(1, min(ease, room) + 1)
            share = 1.0 - rotations.ease(away / (len(away) + 1))
            rows = last + step * away
            shift[rows] += share[:, None] * shift[last]
            weight[rows] = np.maximum(weight[rows], share)
    return weight


def _root(
    character: Character,
    states: BodyStates,
    tips: FloatArray,
    shifts: FloatArray,
    weights: FloatArray,
    fps: float,
) -> FloatArray:
    """Shift (n, 3) [m] of the root that follows the holds, so that arms and legs reach them.

    Args:
        character: The character.
        states: Its bodies as played.
        tips: (n, 4, 3) ankles, then gripping points of the hands [m].
        shifts: (n, 4, 3) their corrections [m].
        weights: (n, 4) how firmly each is held, 0 to 1.
        fps: Frame rate [1/s].
    """
    root = shifts.sum(axis=1) / np.maximum(weights.sum(axis=1), 1.0)[:, None]
    half = max(1, round(0.5 * _FOLLOW_S * fps))
    root = smoothing.average(root, half)
    joints, reach = [], []
    for k, (upper, lower) in enumerate((("thigh", "shank"), ("upper_arm", "forearm"))):
        for i, side in enumerate(FEET):
            first, second = (character.body(f"{side}_{part}") for part in (upper, lower))
            bones = np.linalg.norm(character.offsets[second])
            tip = tips[:, 2 * k + i] - states.positions[:, second]
            longest = _STRAIGHT * (bones + np.linalg.norm(tip, axis=1))
            joints.append(states.positions[:, first])
            played = np.linalg.norm(tips[:, 2 * k + i] - joints[-1], axis=1)
            reach.append(np.maximum(longest, played))
    away = tips + shifts - np.stack(joints, axis=1)
    far = np.stack(reach, axis=1)
    half_draw = max(1, round(0.25 * _FOLLOW_S * fps))
    for _ in range(_ROOT_STEPS):
        # Feet and hands that are free go with the root.
        left = away - weights[..., None] * root[:, None]
        length = np.linalg.norm(left, axis=-1)
        short = weights * np.maximum(length - far, 0.0) / np.maximum(length, 1e-9)
        if not (short > 0.0).any():
            break
        root += smoothing.average((short[..., None] * left).sum(axis=1), half_draw)
    return root


def _place_hands(
    character: Character, poses: FloatArray, grip: FloatArray, wanted: FloatArray
) -> FloatArray:
    """Bend the arms so that a point of each hand (n, 2, 3, in the forearm's frame) is as wanted."""
    states = character.kinematics(poses)
    world = states.quaternions.copy()
    for hand, side in enumerate(FEET):
        upper, forearm = (character.body(f"{side}_{part}") for part in ("upper_arm", "forearm"))
        elbow = states.positions[:, forearm]
        tip = elbow + rotations.rotate(world[:, forearm], grip[:, hand])
        # An elbow bends forward, a knee backward.
        lateral = rotations.rotate(world[:, upper], np.array([0.0, -1.0, 0.0]))
        moved = np.linalg.norm(wanted[:, hand] - tip, axis=1) > _ROUNDING_M
        turns = legs.bend_turns(
            states.positions[moved, upper], elbow[moved], tip[moved], lateral[moved],
            wanted[moved, hand],
        )  # fmt: skip
        for body, turn in zip((upper, forearm), turns, strict=True):
            world[moved, body] = rotations.multiply(turn, world[moved, body])
    out = poses.copy()
    out[:, 3:] = character.local_rotations(world).reshape(len(poses), -1)
    return out


def _stillest(middles: FloatArray, turns: FloatArray) -> float:
    """Largest distance of the stillest point of a hand from its mean place [m].

    Args:
        middles: (n, 3) the middle of the hand [m].
        turns: (n, 4) orientations of the forearm.
    """
    axes = np.stack([rotations.rotate(turns, axis) for axis in np.eye(3)], axis=-1)
    # middle + axes @ point should be the same at all times.
    matrix = (axes - axes.mean(axis=0)).reshape(-1, 3)
    point = np.linalg.lstsq(matrix, -(middles - middles.mean(axis=0)).ravel(), rcond=None)[0]
    point *= min(1.0, _HAND_M / max(float(np.linalg.norm(point)), 1e-9))
    spreads = []
    for choice in (point, np.zeros(3)):
        ends = middles + axes @ choice
        spreads.append(float(np.linalg.norm(ends - ends.mean(axis=0), axis=1).max()))
    return min(spreads)
