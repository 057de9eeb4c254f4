"""Return from a reaction to a motion graph: the best moment and the best frame, found together."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.avatar.pose_index import EntryIndex, NearestFrames
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph, placements_between
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.feet import legs
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.runs import runs

MAX_DISTANCE = 1.2
"""Largest distance (eq. 2) at which the graph is within reach. Somebody who lies is farther than
this from all frames of walking; somebody who stands in a guard, or still sways, is nearer."""
MAX_LYING_DISTANCE = 1.7
"""Largest distance to a frame of a detour, such as the recording of getting up."""
WAITING_COST = 0.02
"""What one second of waiting costs, as a distance [1/s]."""
OTHER_FEET_COST = 0.3
"""What it costs, as a distance, if other feet stand."""
FOOT_OFFSET_COST = 1.0
"""What a metre between a foot and its position in the frame entered costs, as a distance [1/m].

A standing foot is held while the body goes on, until the leg is too short and the foot slides; a
swinging foot is put down too far away. The distance alone hardly shows this: a pose with one foot
0.3 m ahead is near to a pose with the other foot ahead."""
CANDIDATES = 32
"""Frames that are considered for each moment."""


@dataclass(frozen=True, eq=False)
class GraphEntry:
    """How a motion enters a graph.

    Attributes:
        moment: Index of the pose that is left.
        frame: The frame that resembles it. The frame recorded after it is played next.
        distance: How unlike they are (eq. 2).
        same_contacts: Whether the same feet stand.
        detour: Frames outside the graph's component that are played after `frame`, such as getting
            up, then the frame at which the component is entered. Empty if the frame recorded after
            `frame` is in the component.
    """

    moment: int
    frame: int
    distance: float
    same_contacts: bool
    detour: IntArray


class ReentryPlanner:
    """Finds the best moment of a motion and the best frame of a graph together.

    If no moment is near the graph, for example after a fall, a detour may lead back: frames of
    the database that no walk uses, whose recording ends near the component. So avatars get up if
    the graph's motions hold recordings of getting up.

    Attributes:
        graph: The graph.
        entries: The frames of the component at which it may be entered.
    """

    def __init__(self, graph: MotionGraph, character: Character) -> None:
        """Index the graph's frames.

        Args:
            graph: The graph.
            character: The character of its motions.

        Raises:
            MotionError: No frame of the graph is followed by the one recorded after it.
        """
        self.graph = graph
        self._character = character
        frames, successors = graph.frames, graph.database.successors
        recorded = graph.targets[graph.offsets[frames]] == successors[frames]
        self.entries = EntryIndex(graph, frames[recorded])
        self._leave, self._enter = self._detours()
        far = np.flatnonzero(self._leave >= 0)
        self._detour_index = EntryIndex(graph, far) if len(far) else None

    def find(
        self,
        poses: FloatArray,
        velocities: FloatArray,
        contacts: npt.NDArray[np.bool_],
        times: FloatArray,
    ) -> GraphEntry | None:
        """Find where the graph is entered: distance and waiting together cost least.

        A motion is never left before a moment at which the graph is out of reach: the character
        falls then, or is about to.

        Args:
            poses: (m, 59) the moments, in order of time.
            velocities: (m, 45) rows of `qvel`.
            contacts: (m, 2) whether the left and the right foot stand.
            times: (m,) times of the moments [s].

        Returns:
            None if the graph cannot be reached from the last moment.
        """
        seen = self.entries.nearest(poses, velocities, contacts, MAX_DISTANCE)
        far = np.flatnonzero(seen.distances > MAX_DISTANCE)
        first = int(far[-1]) + 1 if len(far) else 0
        if first < len(poses):
            late = slice(first, len(poses))
            near = self.entries.nearest_several(
                poses[late],
                velocities[late],
                contacts[late],
                CANDIDATES,
                MAX_DISTANCE,
            )
            costs = near.distances + WAITING_COST * times[late, None]
            costs += np.where(near.same_contacts, 0.0, OTHER_FEET_COST)
            costs += FOOT_OFFSET_COST * self._foot_offsets(poses[late], near.frames)
            row, column = np.unravel_index(np.argmin(costs), costs.shape)
            return _entry(near, (row, column), first + int(row), np.zeros(0, np.int32))
        if self._detour_index is None:
            return None
        last = self._detour_index.nearest(
            poses[-1:], velocities[-1:], contacts[-1:], MAX_LYING_DISTANCE
        )
        if last.distances[0] > MAX_LYING_DISTANCE:
            return None
        frame = int(last.frames[0])
        leave = int(self._leave[frame])
        detour = np.arange(frame + 1, leave + 2, dtype=np.int32)
        detour[-1] = self._enter[frame]
        return _entry(last, 0, len(poses) - 1, detour)

    def _foot_offsets(self, poses: FloatArray, frames: IntArray) -> FloatArray:
        """Larger distance on the ground between a pose's feet and a frame's (m, k) [m].

        Args:
            poses: (m, 59).
            frames: (m, k) frames that could be entered; each is placed over its pose.
        """
        database, shape = self.graph.database, frames.shape
        which, used = np.unique(frames, return_inverse=True)
        ankles = legs.ankle_positions(
            self._character, self._character.kinematics(database.poses[which])
        )[used.reshape(shape)]
        own = legs.ankle_positions(self._character, self._character.kinematics(poses))[:, None]
        rows = np.repeat(np.arange(len(poses)), shape[1])
        placements = placements_between(
            placement.of_poses(poses)[rows], database.planar[frames.ravel()], self.graph.config
        ).reshape(*shape, 1, 4)
        there = (
            rotations.rotate(rotations.from_yaw(placements[..., 3]), ankles) + placements[..., :3]
        )
        larger: FloatArray = np.linalg.norm((there - own)[..., :2], axis=-1).max(axis=-1)
        return larger

    def _detours(self) -> tuple[IntArray, IntArray]:
        """Find how recordings outside the component lead into it.

        Returns:
            For every frame of the database (n,) the frame at which its recording is left, and the
            frame that is entered then; -1 if the frame is in the component, or near it, or does
            not lead there.
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
                    MAX_DISTANCE,
                )
                far = np.flatnonzero(seen.distances > MAX_DISTANCE)
                after = int(database.successors[stop - 1])
                if not len(far):
                    continue
                last = int(far[-1])
                if after >= 0:
                    # The recording itself goes on into the component.
                    leave[start + far], enter[start + far] = stop - 1, after
                elif last + 1 < stop - start:
                    # Left where it is nearest, after the last frame out of reach.
                    best = last + 1 + int(np.argmin(seen.distances[last + 1 :]))
                    leave[start + far] = start + best
                    enter[start + far] = database.successors[seen.frames[best]]
        return leave, enter


def _within_clips(clip_of: IntArray, begin: int, end: int) -> list[tuple[int, int]]:
    """A range of frames, cut where clips meet."""
    cuts = np.flatnonzero(np.diff(clip_of[begin:end])) + begin + 1
    bounds = [begin, *cuts.tolist(), end]
    return list(itertools.pairwise(bounds))


def _entry(
    found: NearestFrames, row: int | tuple[np.intp, ...], moment: int, detour: IntArray
) -> GraphEntry:
    """The entry that one row of a look-up stands for."""
    return GraphEntry(
        moment,
        int(found.frames[row]),
        float(found.distances[row]),
        bool(found.same_contacts[row]),
        detour,
    )
