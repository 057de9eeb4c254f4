"""Where a motion goes over into a graph: the best moment and the best frame together."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.avatar.pose_index import EntryIndex, Nearest
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph, placements_between
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError
from dynresp.support.runs import runs


@dataclass(frozen=True)
class ReentryConfig:
    """When a motion may go over into a graph.

    Attributes:
        max_distance: Largest distance (eq. 2) at which the graph is within reach. Who lies is
            farther from all who walk; who stands in a guard, or still sways, is nearer.
        farthest_lying: Largest distance to a frame from which a recorded way leads back there.
        waiting: What a second of waiting costs, as a distance [1/s].
        other_feet: What it costs, as a distance, if other feet stand.
        apart: What it costs, as a distance, how far a foot is from where it is in the frame entered
            [1/m]. One that stands is held there while the body goes on, until the leg is too short
            and it slides; one that swings is put down too far away. The distance alone hardly
            tells: somebody with one foot ahead by 0.3 m is near to one who has the other ahead.
        candidates: So many frames are considered for each moment.
    """

    max_distance: float = 1.2
    farthest_lying: float = 1.7
    waiting: float = 0.02
    other_feet: float = 0.3
    apart: float = 1.0
    candidates: int = 32

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is negative or not finite, or there is no candidate.
        """
        for name in ("max_distance", "farthest_lying", "waiting", "other_feet", "apart"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise UsageError(f"{name} must be at least 0, got {getattr(self, name)}")
        if self.candidates < 1:
            raise UsageError(f"candidates must be at least 1, got {self.candidates}")


@dataclass(frozen=True, eq=False)
class GraphEntry:
    """How a motion goes over into a graph.

    Attributes:
        moment: Index of the pose that is left.
        frame: The frame that resembles it; what was recorded after it can go on.
        distance: How unlike they are (eq. 2).
        same_contacts: Whether the same feet stand.
        detour: Frames outside of the graph's component to be played after `frame`, such as a
            getting up, and then the frame by which the component is entered; empty for one whose
            next frame is in the component.
    """

    moment: int
    frame: int
    distance: float
    same_contacts: bool
    detour: IntArray


class ReentryPlanner:
    """Finds the best moment of a motion and the best frame of a graph together.

    Where no moment is near the graph, as of one who has fallen and lies, a detour may be: frames of
    the database that no walk goes through, whose recording goes on to where one can be entered. So
    who puts recordings of getting up among a graph's motions has avatars that get up.

    Attributes:
        graph: The graph.
        config: Settings.
        entries: The frames of the component that may be entered.
    """

    def __init__(
        self, graph: MotionGraph, character: Character, config: ReentryConfig | None = None
    ) -> None:
        """Lay out the graph's frames.

        Args:
            graph: The graph.
            character: Whose body it is, for where its feet stand.
            config: Settings.

        Raises:
            MotionError: No frame of the graph is followed by the one recorded after it.
        """
        self.graph = graph
        self._character = character
        self.config = config or ReentryConfig()
        frames, successors = graph.frames, graph.database.successors
        recorded = graph.targets[graph.offsets[frames]] == successors[frames]
        self.entries = EntryIndex(graph, frames[recorded])
        self._leave, self._enter = self._detours()
        far = np.flatnonzero(self._leave >= 0)
        self._ups = EntryIndex(graph, far) if len(far) else None

    def find(
        self,
        poses: FloatArray,
        velocities: FloatArray,
        contacts: npt.NDArray[np.bool_],
        times: FloatArray,
    ) -> GraphEntry | None:
        """Where the graph is entered: distance and waiting together cost least.

        A motion is not left before a moment at which the graph is out of reach: it is falling then,
        or about to.

        Args:
            poses: (m, 59) the moments, in their order.
            velocities: (m, 45) rows of `qvel`.
            contacts: (m, 2) whether the left and the right foot stand.
            times: (m,) when they are [s].

        Returns:
            None where no way leads from the last moment to the graph.
        """
        config = self.config
        seen = self.entries.nearest(poses, velocities, contacts, config.max_distance)
        far = np.flatnonzero(seen.distances > config.max_distance)
        first = int(far[-1]) + 1 if len(far) else 0
        if first < len(poses):
            late = slice(first, len(poses))
            near = self.entries.several(
                poses[late],
                velocities[late],
                contacts[late],
                config.candidates,
                config.max_distance,
            )
            costs = near.distances + config.waiting * times[late, None]
            costs += np.where(near.same_contacts, 0.0, config.other_feet)
            costs += config.apart * self._apart(poses[late], near.frames)
            row, column = np.unravel_index(np.argmin(costs), costs.shape)
            return self._way(near, (row, column), first + int(row), np.zeros(0, np.int32))
        if self._ups is None:
            return None
        last = self._ups.nearest(poses[-1:], velocities[-1:], contacts[-1:], config.farthest_lying)
        if last.distances[0] > config.farthest_lying:
            return None
        frame = int(last.frames[0])
        leave = int(self._leave[frame])
        detour = np.arange(frame + 1, leave + 2, dtype=np.int32)
        detour[-1] = self._enter[frame]
        return self._way(last, 0, len(poses) - 1, detour)

    def _apart(self, poses: FloatArray, frames: IntArray) -> FloatArray:
        """How far the farther foot is, seen from above, from where it is in a frame (m, k) [m].

        Args:
            poses: (m, 59).
            frames: (m, k) frames that could be entered, which are laid over the poses.
        """
        database, shape = self.graph.database, frames.shape
        which, used = np.unique(frames, return_inverse=True)
        ankles = legs.ankle_positions(
            self._character, self._character.kinematics(database.poses[which])
        )[used.reshape(shape)]
        own = legs.ankle_positions(self._character, self._character.kinematics(poses))[:, None]
        rows = np.repeat(np.arange(len(poses)), shape[1])
        places = placements_between(
            placement.of_poses(poses)[rows], database.planar[frames.ravel()], self.graph.config
        ).reshape(*shape, 1, 4)
        there = rotations.rotate(rotations.from_yaw(places[..., 3]), ankles) + places[..., :3]
        farther: FloatArray = np.linalg.norm((there - own)[..., :2], axis=-1).max(axis=-1)
        return farther

    @staticmethod
    def _way(
        seen: Nearest, row: int | tuple[np.intp, ...], moment: int, detour: IntArray
    ) -> GraphEntry:
        """The way back of one entry of what was looked up, and the moment it belongs to."""
        return GraphEntry(
            moment,
            int(seen.frames[row]),
            float(seen.distances[row]),
            bool(seen.same_contacts[row]),
            detour,
        )

    def _detours(self) -> tuple[IntArray, IntArray]:
        """Ways back over frames outside of the component.

        Returns:
            For every frame of the database (n,) the frame at which its recording is left, and the
            one that is entered then; -1 for those that are in the component, or near it, or lead
            nowhere.
        """
        database = self.graph.database
        leave, enter = (np.full(len(database), -1, dtype=np.int32) for _ in range(2))
        outside = np.diff(self.graph.offsets) == 0
        for begin, end in runs(outside):
            for start, stop in _within_clips(database.clip_of, begin, end):
                rows = slice(start, stop)
                seen = self.entries.nearest(
                    database.poses[rows],
                    database.velocities[rows],
                    database.contacts[rows, :2],
                    self.config.max_distance,
                )
                far = np.flatnonzero(seen.distances > self.config.max_distance)
                after = int(database.successors[stop - 1])
                if not len(far):
                    continue
                last = int(far[-1])
                if after >= 0:
                    # The recording itself goes on into the component.
                    leave[start + far], enter[start + far] = stop - 1, after
                elif last + 1 < stop - start:
                    # Left after the last frame out of reach, where it is nearest.
                    best = last + 1 + int(np.argmin(seen.distances[last + 1 :]))
                    leave[start + far] = start + best
                    enter[start + far] = database.successors[seen.frames[best]]
        return leave, enter


def _within_clips(clip_of: IntArray, begin: int, end: int) -> list[tuple[int, int]]:
    """A range of frames cut where clips meet."""
    cuts = np.flatnonzero(np.diff(clip_of[begin:end])) + begin + 1
    bounds = [begin, *cuts.tolist(), end]
    return list(itertools.pairwise(bounds))
