"""Play frames of a graph piece by piece on a character's clock: resampled, the feet fitted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.blending import FrameSteps, Playback, recorded_steps
from dynresp.locomotion.playing.composition import StepTimes, interpolate_steps, standing_between
from dynresp.motion.character import Character
from dynresp.motion.feet.foot_fitting import ComposedMotion, fit_feet, look_ahead_frames
from dynresp.motion.motion import pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError

# Frames already shown are kept this long, since they tell where a foot stands [s].
_KEPT_S = 1.0


class Stream:
    """A motion by graph that continues any other motion, made piece by piece.

    Attributes:
        graph: The graph.
        frame: The frame of the graph played last.
        placement: (4,) of its clip.
        end: One past the last frame of the clock that has a pose.
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
        """Start after a motion.

        Args:
            graph: The graph.
            character: The character.
            fps: Frame rate of the clock [1/s], at least the graph's.
            frame: A frame of the graph's database that resembles the last pose. The frame recorded
                after it is played next.
            first: The frame of the clock at which the first pose is shown.
            poses: (m, 59) the motion before, as shown; one second is enough.
            velocity: (45,) velocity of the last pose.
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
        # The poses with fitted feet, and how many of them are final.
        self._fitted, self._settled = self._poses, len(poses)
        self._contacts = np.array(contacts)
        self._jumps: list[int] = [self.end]
        # The last frame of the graph: its time on the clock in frames; its pose as played, and as
        # recorded and placed; its contacts.
        self._at = float(self.end - 1)
        self._pose, self._moving = self._poses[-1], np.array(velocity)
        recorded = graph.database.poses[frame : frame + 1]
        self._recorded = placement.place_poses(recorded, self._playback.placement)[0]
        self._touching = self._contacts[-1]
        # Times on the clock, and frames of the graph, at which the walk may be changed.
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
        """(2,) which feet should stand at a frame of the clock; None where no graph is played."""
        row = now - self._first
        if now < self._begins or row >= len(self._contacts):
            return None
        return self._contacts[row].copy()

    def extend(self, frames: npt.ArrayLike) -> None:
        """Append frames (k,) of the graph; see `Playback.play`."""
        database, before = self.graph.database, self._playback.frame
        played = self._playback.play(frames)
        entered, count = played.frames, len(played.frames)
        steps = recorded_steps(self.graph, before, played)
        starts, ends = steps.starts, steps.ends
        starts[0] = starts[0] if played.jumps[0] else self._recorded
        keyframes = np.concatenate([self._pose[None], played.poses])
        moving = np.concatenate([self._moving[None], played.velocities])
        touching = np.concatenate([self._touching[None], played.contacts[:, :2]])
        ratio = self._fps / database.fps
        at = self._at + ratio * np.arange(count + 1)
        clock = np.arange(self.end, int(np.floor(at[-1] + 1e-9)) + 1)
        step = np.ceil((clock - at[0]) / ratio - 1e-9).astype(np.intp) - 1
        step = np.clip(step, 0, count - 1)
        part = np.clip((clock - at[step]) / ratio, 0.0, 1.0)
        times = StepTimes(step, part, 1.0 / database.fps, standing_between(touching, step, part))
        ours = FrameSteps(keyframes[:-1], keyframes[1:], moving[:-1], moving[1:])
        theirs = FrameSteps(starts, ends, steps.start_velocities, steps.end_velocities)
        poses, source = (interpolate_steps(self._character, x, times) for x in (ours, theirs))
        self._poses = np.concatenate([self._poses, poses])
        self._source = np.concatenate([self._source, source])
        self._contacts = np.concatenate([self._contacts, times.stands])
        jumped = clock[np.searchsorted(step, np.flatnonzero(played.jumps)).clip(0, len(clock) - 1)]
        self._jumps += [int(frame) for frame in np.unique(jumped) if frame > self._jumps[-1]]
        due = np.round(at[1:]).astype(int)
        exact = np.abs(due - at[1:]) < 1e-6
        self._marks += list(zip(due[exact].tolist(), entered[exact].tolist(), strict=True))
        self.end = self.end + len(clock)
        self._at, self._pose, self._recorded = float(at[-1]), keyframes[-1], ends[-1]
        self._moving = moving[-1]
        self._touching = touching[-1]

    def fitted(self, now: int) -> tuple[int, FloatArray]:
        """Fit the feet of the coming poses, and forget poses that are long past.

        Args:
            now: The frame of the clock; it has been shown.

        Returns:
            The first frame that has changed since the last call, and the poses (m, 59) from there
            to the end. Frames that later ones hardly influence are final.
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
            self._fitted[:kept],
        )
        self._fitted = fit_feet(self._character, composed)
        settled = max(len(self._fitted) - look_ahead_frames(self._fps), now + 1 - self._first)
        self._settled = min(max(kept, settled), len(self._fitted))
        return self._first + kept, self._fitted[kept:]

    def branch(self, now: int) -> Stream | None:
        """A stream that leaves this one at the first frame of the graph after a frame of the clock.

        None if this stream does not reach that far.
        """
        for due, frame in self._marks:
            row = due - self._first
            if due <= now or row + 1 >= len(self._fitted):
                continue
            velocity = pose_velocities(self._fitted[row - 1 : row + 2], self._fps)[1]
            before = slice(0, row + 1)
            return Stream(
                self.graph,
                self._character,
                self._fps,
                frame,
                self._first,
                self._fitted[before],
                velocity,
                self._contacts[before],
            )
        return None

    def _forget(self, before: int) -> None:
        """Drop poses before a frame of the clock, and jumps whose blends have ended by then."""
        gone = min(before - self._first, self._settled - 2)
        if gone <= 0:
            return
        self._first += gone
        self._poses, self._source = self._poses[gone:], self._source[gone:]
        self._contacts, self._fitted = self._contacts[gone:], self._fitted[gone:]
        self._settled -= gone
        blended = self._first - int(np.ceil(self.graph.config.blend_s * self._fps))
        last = self._jumps[-1]
        self._jumps = [jump for jump in self._jumps if jump > blended] or [last]
        self._marks = [mark for mark in self._marks if mark[0] >= self._first]
