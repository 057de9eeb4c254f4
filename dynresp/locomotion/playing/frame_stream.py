"""Frames of a graph on a character's clock: played, brought to its rate, the feet fitted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.blending import KnotSteps, Playback, recorded_steps
from dynresp.locomotion.playing.composition import StepTimes, interpolate_steps, standing_between
from dynresp.motion.character import Character
from dynresp.motion.feet.foot_fitting import ComposedMotion, fit_feet, look_ahead_frames
from dynresp.motion.motion import pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError

# What was shown is kept as long as it may tell where a foot stands [s].
_KEPT_S = 1.0


class Stream:
    """A motion by graph that goes on from any other, made piece by piece.

    Attributes:
        graph: Whose frames.
        frame: The frame of the graph played last.
        placement: (4,) where its clip is put.
        end: One past the last frame of the clock for which there is a pose.
    """

    def __init__(
        self,
        graph: MotionGraph,
        character: Character,
        fps: float,
        frame: int,
        first: int,
        poses: FloatArray,
        velocity: FloatArray,
        contacts: BoolArray,
    ) -> None:
        """Begin after a motion that goes over into the graph's.

        Args:
            graph: Whose frames.
            character: The character.
            fps: Rate of the clock [1/s], at least the graph's.
            frame: A frame of the graph's database that resembles the last of the poses; what was
                recorded after it goes on.
            first: The frame of the clock at which the first of the poses is due.
            poses: (m, 59) what comes before, as it is shown; a second of it is of use.
            velocity: (45,) how the last of them moves.
            contacts: (m, 2) whether the left and the right foot stand.

        Raises:
            UsageError: The clock is slower than the graph.
        """
        if fps < graph.database.fps:
            raise UsageError(
                f"a clock of {fps:g} fps is slower than the graph, which has "
                f"{graph.database.fps:g}; build the graph with as many or fewer"
            )
        self.graph = graph
        self.end = self._begins = first + len(poses)
        self._character = character
        self._fps = fps
        self._playback = Playback.entering(graph, frame, poses[-1], velocity)
        self._first = first
        self._poses = self._source = np.array(poses)
        # As laid out last, feet fitted; and how much of that does not change any more.
        self._laid, self._settled = self._poses, len(poses)
        self._contacts = np.array(contacts)
        self._jumps: list[int] = [self.end]
        # Where the last frame of the graph is on the clock, in frames; as played, as recorded and
        # placed, and what touches.
        self._at = float(self.end - 1)
        self._pose, self._moving = self._poses[-1], np.array(velocity)
        recorded = graph.database.poses[frame : frame + 1]
        self._recorded = placement.place_poses(recorded, self._playback.placement)[0]
        self._touching = self._contacts[-1]
        # Frames of the graph and when they are due, from which the way may be changed.
        self._marks: list[tuple[int, int]] = []

    @property
    def frame(self) -> int:
        """See the class."""
        return self._playback.frame

    @property
    def placement(self) -> FloatArray:
        """See the class."""
        return self._playback.placement.copy()

    def standing(self, now: int) -> BoolArray | None:
        """(2,) which feet are to stand at a frame of the clock; None where no graph is played."""
        row = now - self._first
        if now < self._begins or row >= len(self._contacts):
            return None
        return self._contacts[row].copy()

    def extend(self, frames: npt.ArrayLike) -> None:
        """Play further frames (k,) of the graph; see `Playback.play`."""
        database, before = self.graph.database, self._playback.frame
        played = self._playback.play(frames)
        entered, count = played.frames, len(played.frames)
        steps = recorded_steps(self.graph, before, played)
        starts, ends = steps.starts, steps.ends
        starts[0] = starts[0] if played.jumps[0] else self._recorded
        knots = np.concatenate([self._pose[None], played.poses])
        moving = np.concatenate([self._moving[None], played.velocities])
        touching = np.concatenate([self._touching[None], played.contacts[:, :2]])
        ratio = self._fps / database.fps
        at = self._at + ratio * np.arange(count + 1)
        clock = np.arange(self.end, int(np.floor(at[-1] + 1e-9)) + 1)
        step = np.ceil((clock - at[0]) / ratio - 1e-9).astype(np.intp) - 1
        step = np.clip(step, 0, count - 1)
        part = np.clip((clock - at[step]) / ratio, 0.0, 1.0)
        way = StepTimes(step, part, 1.0 / database.fps, standing_between(touching, step, part))
        ours = KnotSteps(knots[:-1], knots[1:], moving[:-1], moving[1:])
        theirs = KnotSteps(starts, ends, steps.moving_starts, steps.moving_ends)
        poses, source = (interpolate_steps(self._character, x, way) for x in (ours, theirs))
        self._poses = np.concatenate([self._poses, poses])
        self._source = np.concatenate([self._source, source])
        self._contacts = np.concatenate([self._contacts, way.stands])
        jumped = clock[np.searchsorted(step, np.flatnonzero(played.jumps)).clip(0, len(clock) - 1)]
        self._jumps += [int(frame) for frame in np.unique(jumped) if frame > self._jumps[-1]]
        due = np.round(at[1:]).astype(int)
        exact = np.abs(due - at[1:]) < 1e-6
        self._marks += list(zip(due[exact].tolist(), entered[exact].tolist(), strict=True))
        self.end = self.end + len(clock)
        self._at, self._pose, self._recorded = float(at[-1]), knots[-1], ends[-1]
        self._moving = moving[-1]
        self._touching = touching[-1]

    def fitted(self, now: int) -> tuple[int, FloatArray]:
        """Fit the feet of what is to come, and forget what is long past.

        Args:
            now: What the clock shows; its frame has been shown.

        Returns:
            The first frame that has changed since the last call, and the poses (m, 59) from there
            to the end. Frames that later ones can hardly change are not changed any more.
        """
        self._forget(now - round(_KEPT_S * self._fps))
        kept = self._settled
        composed = ComposedMotion(
            self._poses,
            self._source,
            self._contacts,
            np.array(self._jumps) - self._first,
            self._fps,
            self.graph.config.blend_s,
            self._laid[:kept],
        )
        self._laid = fit_feet(self._character, composed)
        settled = max(len(self._laid) - look_ahead_frames(self._fps), now + 1 - self._first)
        self._settled = min(max(kept, settled), len(self._laid))
        return self._first + kept, self._laid[kept:]

    def branch(self, now: int) -> Stream | None:
        """A stream that leaves this one at the next frame of the graph after a frame of the clock.

        None where nothing is laid out so far ahead.
        """
        for due, frame in self._marks:
            row = due - self._first
            if due <= now or row + 1 >= len(self._laid):
                continue
            velocity = pose_velocities(self._laid[row - 1 : row + 2], self._fps)[1]
            before = slice(0, row + 1)
            return Stream(
                self.graph,
                self._character,
                self._fps,
                frame,
                self._first,
                self._laid[before],
                velocity,
                self._contacts[before],
            )
        return None

    def _forget(self, before: int) -> None:
        """Drop what was due before a frame, and jumps whose blends have ended by then."""
        gone = min(before - self._first, self._settled - 2)
        if gone <= 0:
            return
        self._first += gone
        self._poses, self._source = self._poses[gone:], self._source[gone:]
        self._contacts, self._laid = self._contacts[gone:], self._laid[gone:]
        self._settled -= gone
        blended = self._first - int(np.ceil(self.graph.config.blend_s * self._fps))
        last = self._jumps[-1]
        self._jumps = [jump for jump in self._jumps if jump > blended] or [last]
        self._marks = [mark for mark in self._marks if mark[0] >= self._first]
