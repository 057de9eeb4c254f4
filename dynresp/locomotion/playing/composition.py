"""Compose a motion from frames of a graph: played, resampled, its feet fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.locomotion.playing.blending import FrameSteps, Playback, recorded_steps
from dynresp.locomotion.playing.stance_steps import keep_feet_planted
from dynresp.motion.character import POSE_SIZE, Character
from dynresp.motion.feet.foot_fitting import MAX_ROOT_DROP, ComposedMotion, fit_feet
from dynresp.motion.motion import Motion, interpolate_with_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray
from dynresp.support.errors import MotionError

MAX_FRAMES = 500_000
"""Largest number of frames of a composed motion; an hour at 120 fps has 432,000. Composing takes
about eight times the memory of the motion (measured), at most 2 GB."""

# A frame this close to a frame of the graph is on it, as part of a step.
_ON = 1e-6
# About this many frames are resampled at a time, to save memory.
_BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Composition:
    """A walk as a motion.

    Attributes:
        frames: (k,) the frames of the graph.
        motion: The motion; frame f of the walk is at time f / graph fps.
        jumps: Indices into the walk, from 1, of frames that are reached by a jump.
        placements: (k, 4) of each frame's clip.
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
    """Compose the motion of a walk.

    Args:
        graph: The graph.
        character: The character.
        frames: (k,) a walk; two frames or more.
        place: (4,) placement of the first frame's clip.
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
            f"frames, and at most {MAX_FRAMES:,} are possible; ask for a shorter walk or a lower "
            "frame rate"
        )
    playback = Playback(graph, int(path[0]), place)
    start = np.array(place, dtype=np.float64)
    played = playback.play(path[1:])
    database = graph.database
    first = placement.place_poses(database.poses[path[:1]], start)
    keyframes = np.concatenate([first, played.poses])
    moving = placement.place_velocities(database.velocities[path[:1]], start)
    moving = np.concatenate([moving, played.velocities])
    contacts = standing_between(database.contacts[path, :2], step, part)
    poses, source = (np.empty((len(step), POSE_SIZE)) for _ in range(2))
    block = max(1, int(_BLOCK * graph.config.fps / fps))
    for begin in range(0, len(path) - 1, block):
        some = slice(begin, min(begin + block, len(path) - 1))
        rows = slice(*np.searchsorted(step, [some.start, some.stop]))
        steps = recorded_steps(graph, int(path[begin]), played, some)
        times = StepTimes(step[rows] - begin, part[rows], 1.0 / graph.config.fps, contacts[rows])
        after = slice(some.start + 1, some.stop + 1)
        ours = FrameSteps(keyframes[some], keyframes[after], moving[some], moving[after])
        poses[rows], source[rows] = (interpolate_steps(character, x, times) for x in (ours, steps))
    jumps = np.flatnonzero(played.jumps) + 1
    # The first frame of the motion after each frame that was left.
    entered = np.unique(np.searchsorted(step, jumps - 1))
    blend_s = graph.config.blend_s
    composed = ComposedMotion(poses, source, contacts, entered, fps, blend_s, poses[:1], ground)
    fitted = fit_feet(character, composed, max_root_drop)
    # Free memory for the motion.
    del composed, source, keyframes, moving
    return Composition(
        frames=path,
        motion=Motion(fitted, fps, "walk by graph", contacts),
        jumps=jumps,
        placements=np.concatenate([start[None], played.placements]),
        unfitted=poses,
    )


@dataclass(frozen=True, eq=False)
class StepTimes:
    """Times of a motion's frames within the steps between frames of a graph.

    Attributes:
        step: (n,) the step of each frame; see `steps_at_rate`.
        part: (n,) its part of that step that has passed; see `steps_at_rate`.
        seconds: Duration of a step [s].
        stands: (n, 2) which feet stand; see `standing_between`.
    """

    step: npt.NDArray[np.intp]
    part: FloatArray
    seconds: float
    stands: BoolArray


def interpolate_steps(character: Character, steps: FrameSteps, times: StepTimes) -> FloatArray:
    """Interpolate poses (n, 59) within steps; planted feet stay."""
    at = times.step
    poses = interpolate_with_velocities(
        steps.starts[at],
        steps.ends[at],
        steps.start_velocities[at],
        steps.end_velocities[at],
        times.part,
        times.seconds,
    )
    ends = steps.starts, steps.ends
    return keep_feet_planted(character, poses, ends, at, times.part, times.stands)


def standing_between(
    contacts: BoolArray, step: npt.NDArray[np.intp], part: FloatArray
) -> BoolArray:
    """Which feet stand within steps: those that stand at both ends.

    A foot that comes down moves fast until the end of the step, and one that is lifted from its
    start on; held during the step, it would be held in the wrong position.

    Args:
        contacts: (k, 2) at the frames of the graph.
        step: (n,) see `steps_at_rate`.
        part: (n,) see `steps_at_rate`.

    Returns:
        (n, 2).
    """
    before, after = contacts[step], contacts[step + 1]
    there = part[:, None]
    return np.where(there <= 0.0, before, after & (before | (there >= 1.0 - _ON)))


def steps_at_rate(count: int, rate: float, fps: float) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Steps in which the frames of a motion at another frame rate are.

    Args:
        count: Number of frames of the graph, two or more.
        rate: Their frame rate [1/s].
        fps: Frame rate of the motion [1/s].

    Returns:
        (n,) index of each frame's step, and (n,) the part of the step that has passed, in (0, 1].
        A frame at the end of a step belongs to that step. Only the first frame has part 0.
    """
    frames = int(np.floor((count - 1) * fps / rate + 1e-9)) + 1
    at = np.arange(frames) * rate / fps
    step = np.clip(np.ceil(at - 1e-9).astype(np.intp) - 1, 0, count - 2)
    return step, np.clip(at - step, 0.0, 1.0)
