"""From frames of a graph to a motion: played, brought to a frame rate, its feet fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.locomotion.playing.blending import KnotSteps, Playback, recorded_steps
from dynresp.locomotion.playing.stance_steps import keep_feet_planted
from dynresp.motion.character import POSE_SIZE, Character
from dynresp.motion.feet.foot_fitting import MAX_ROOT_DROP, ComposedMotion, fit_feet
from dynresp.motion.motion import Motion, interpolate_with_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray
from dynresp.support.errors import MotionError

MAX_FRAMES = 500_000
"""So many frames are composed at once: an hour at 120 a second takes 432,000. The motion is held in
memory about eight times over meanwhile (measured), in 2 GB at most."""

# A frame so near to a knot is on it, as part of the way between two.
_ON = 1e-6
# About so many frames are brought to a frame rate at a time, which saves memory.
_BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Composition:
    """A walk as a motion.

    Attributes:
        frames: (k,) the frames of the graph.
        motion: What is played; frame f of the walk is due at f / graph fps.
        jumps: Frames of the walk, from 1, that are reached by a jump.
        placements: (k, 4) where the clip of each frame was put.
        unfitted: (n, 59) the motion before its feet were fitted.
    """

    frames: IntArray
    motion: Motion
    jumps: npt.NDArray[np.intp]
    placements: FloatArray
    unfitted: FloatArray


def compose(
    graph: MotionGraph,
    character: Character,
    frames: npt.ArrayLike,
    place: npt.ArrayLike = IDENTITY,
    fps: float | None = None,
    ground: FloatArray | None = None,
    max_root_drop: float = MAX_ROOT_DROP,
) -> Composition:
    """Play a walk from its first frame on.

    Args:
        graph: Whose frames.
        character: The character.
        frames: (k,) a walk; two frames or more.
        place: (4,) where the clip of the first frame is put.
        fps: Frame rate of the motion, by default the graph's.
        ground: (n, 2) height of the ground under each foot [m], by default 0.
        max_root_drop: How far the root is lowered at most for legs that are too short [m].

    Raises:
        MotionError: The motion would have more than `MAX_FRAMES` frames.
    """
    fps = fps or graph.config.fps
    path = np.asarray(frames, dtype=np.int32)
    step, part = steps_at_rate(len(path), graph.config.fps, fps)
    if len(step) > MAX_FRAMES:
        raise MotionError(
            f"a walk of {len(path) / graph.config.fps:.0f} s at {fps:g} fps has {len(step):,} "
            f"frames, and at most {MAX_FRAMES:,} are held in memory at once; ask for a shorter "
            "one or for fewer frames a second"
        )
    playback = Playback(graph, int(path[0]), place)
    start = np.array(place, dtype=np.float64)
    played = playback.play(path[1:])
    database = graph.database
    first = placement.place_poses(database.poses[path[:1]], start)
    knots = np.concatenate([first, played.poses])
    moving = placement.place_velocities(database.velocities[path[:1]], start)
    moving = np.concatenate([moving, played.velocities])
    contacts = standing_between(database.contacts[path, :2], step, part)
    poses, source = (np.empty((len(step), POSE_SIZE)) for _ in range(2))
    block = max(1, int(_BLOCK * graph.config.fps / fps))
    for begin in range(0, len(path) - 1, block):
        some = slice(begin, min(begin + block, len(path) - 1))
        rows = slice(*np.searchsorted(step, [some.start, some.stop]))
        steps = recorded_steps(graph, int(path[begin]), played, some)
        way = StepTimes(step[rows] - begin, part[rows], 1.0 / graph.config.fps, contacts[rows])
        after = slice(some.start + 1, some.stop + 1)
        ours = KnotSteps(knots[some], knots[after], moving[some], moving[after])
        poses[rows], source[rows] = (interpolate_steps(character, x, way) for x in (ours, steps))
    jumps = np.flatnonzero(played.jumps) + 1
    # The first frame of the motion after the frame left.
    entered = np.unique(np.searchsorted(step, jumps - 1))
    blend_s = graph.config.blend_s
    composed = ComposedMotion(poses, source, contacts, entered, fps, blend_s, poses[:1], ground)
    fitted = fit_feet(character, composed, max_root_drop)
    # Memory that the motion needs to be made.
    del composed, source, knots, moving
    return Composition(
        frames=path,
        motion=Motion(fitted, fps, "walk by graph", contacts),
        jumps=jumps,
        placements=np.concatenate([start[None], played.placements]),
        unfitted=poses,
    )


@dataclass(frozen=True, eq=False)
class StepTimes:
    """Where frames lie among the steps from knot to knot.

    Attributes:
        step: (n,) see `steps_at_rate`.
        part: (n,) see `steps_at_rate`.
        seconds: How long a step takes [s].
        stands: (n, 2) see `standing_between`.
    """

    step: npt.NDArray[np.intp]
    part: FloatArray
    seconds: float
    stands: BoolArray


def interpolate_steps(character: Character, steps: KnotSteps, way: StepTimes) -> FloatArray:
    """Poses (n, 59) among knots, whose feet do not leave them where they stand."""
    at = way.step
    poses = interpolate_with_velocities(
        steps.starts[at], steps.ends[at], steps.moving_starts[at], steps.moving_ends[at], way.part,
        way.seconds,
    )  # fmt: skip
    ends = steps.starts, steps.ends
    return keep_feet_planted(character, poses, ends, at, way.part, way.stands)


def standing_between(
    contacts: BoolArray, step: npt.NDArray[np.intp], part: FloatArray
) -> BoolArray:
    """Which feet stand in frames among knots: between two knots those that stand at both.

    A foot that comes down, or is lifted, moves fast until the knot at which it stands, or from it
    on; were it held before, it would be held in the wrong place.

    Args:
        contacts: (k, 2) at the knots.
        step: (n,) see `steps_at_rate`.
        part: (n,) see `steps_at_rate`.

    Returns:
        (n, 2).
    """
    before, after = contacts[step], contacts[step + 1]
    there = part[:, None]
    return np.where(there <= 0.0, before, after & (before | (there >= 1.0 - _ON)))


def steps_at_rate(count: int, rate: float, fps: float) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Where the frames of a motion at another rate lie among knots.

    Args:
        count: How many knots, two or more.
        rate: Knots a second.
        fps: Frames a second.

    Returns:
        (n,) the knot before each frame, and (n,) how far it is on the way to the next, in (0, 1];
        a frame on a knot belongs to the way that leads there, but for the first of all.
    """
    frames = int(np.floor((count - 1) * fps / rate + 1e-9)) + 1
    at = np.arange(frames) * rate / fps
    step = np.clip(np.ceil(at - 1e-9).astype(np.intp) - 1, 0, count - 2)
    return step, np.clip(at - step, 0.0, 1.0)
