"""One avatar: it walks by a motion graph, is hit, reacts, and walks on.

While it walks, the next seconds of its walk are planned and given to its responder. When something
hits it, the responder takes over: simulation, blend, reaction. Once the blend is planned, the rest
of the reaction is known. The avatar then finds the moment of the reaction and the frame of the
graph that resemble each other most, and walks on from there before the reaction ends.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.avatar.graph_entry import GraphEntry, ReentryPlanner
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.frame_stream import Stream
from dynresp.motion.character import Character
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact
from dynresp.response.runtime.dynamic_responder import DynamicResponder, Phase
from dynresp.support.arrays import IntArray

AHEAD_S = 4.0
"""The walk is planned at least so far ahead [s]. A hit looks ahead two seconds, and fitting feet
needs as much."""
PIECE_S = 1.0
"""How much is planned at a time [s]."""
# Returns that are kept.
_RETURNS = 100


class Planner(Protocol):
    """Decides where an avatar goes."""

    def next_frames(self, frame: int, placement: FloatArray, count: int) -> IntArray:
        """The frames to play next.

        Args:
            frame: The frame of the graph that was played last.
            placement: (4,) of its clip; see `dynresp.locomotion.graph.placement`.
            count: How many frames are wanted.

        Returns:
            (k,) the next frames of the graph: at least one, about `count`.
        """


class RandomPlanner:
    """Walks at random, by the graph's probabilities (eq. 1)."""

    def __init__(self, graph: MotionGraph, rng: np.random.Generator) -> None:
        """Walk through a graph by a random generator."""
        self._graph = graph
        self._rng = rng

    def next_frames(self, frame: int, placement: FloatArray, count: int) -> IntArray:
        """See `Planner.next_frames`."""
        return random_walk(self._graph, count, self._rng, frame)


class Activity(Enum):
    """What an avatar is doing."""

    WALKING = "walking"
    """It walks by graph, or returns to it: the next frames are planned."""
    HIT = "hit"
    """Something has hit it; where it walks on is not known yet."""
    STAYING = "staying"
    """Its reaction ends out of the graph's reach: it lies, or, in fixed coordinates, stands where
    nobody walked. It stays there until it is hit again."""


@dataclass(frozen=True)
class GraphReturn:
    """How an avatar returned from a reaction to the graph, or did not.

    Attributes:
        decided: Frame of the clock in which it was decided.
        moment: Frame of the clock at which the reaction is left; None if the avatar stays.
        entry: Where the graph is entered; None if the avatar stays.
        reaction: Name of the reaction that is left; `carry_on` or "nothing" if there was none.
    """

    decided: int
    moment: int | None
    entry: GraphEntry | None
    reaction: str


class Avatar:
    """One character that walks by graph.

    Attributes:
        responder: Plays the motion and takes the hits.
        planner: Decides where it goes.
        returns: How it returned from its last hundred reactions, in order.
        activity: What it is doing.
    """

    def __init__(
        self,
        character: Character,
        responder: DynamicResponder,
        planner: Planner,
        reentry: ReentryPlanner,
        start: int,
    ) -> None:
        """Start at a frame of the graph, which the responder shows.

        Args:
            character: Its body.
            responder: At its frame 0.
            planner: Decides where it goes.
            reentry: Finds how it returns to the graph.
            start: The frame of the graph.
        """
        self.responder = responder
        self.planner = planner
        self.returns: deque[GraphReturn] = deque(maxlen=_RETURNS)
        self.activity = Activity.WALKING
        self._character = character
        self._reentry = reentry
        self._graph = reentry.graph
        self._seen = responder.takeovers
        # It moves as in the database, turned by the placement.
        start_placement = placement.compose(
            placement.of_poses(responder.pose[None])[0],
            placement.inverse(self._graph.database.planar[start]),
        )
        velocity = self._graph.database.velocities[start].copy()
        cosine, sine = np.cos(start_placement[3]), np.sin(start_placement[3])
        velocity[:2] = np.array([[cosine, -sine], [sine, cosine]]) @ velocity[:2]
        self._stream: Stream | None = self._stream_from(
            start,
            responder.frame,
            responder.pose[None],
            velocity,
            self._graph.database.contacts[start : start + 1, :2],
        )

    @property
    def standing(self) -> npt.NDArray[np.bool_] | None:
        """(2,) which feet should stand in the frame that is shown.

        None unless it shows a walk by graph. From before a contact on it is simulated, and a
        reaction has its own contacts.
        """
        shown = self.activity is Activity.WALKING and self.responder.phase is Phase.PLAYING
        return self._stream.standing(self.responder.frame) if shown and self._stream else None

    def plan_ahead(self) -> None:
        """Plan what the responder needs before its next frame."""
        responder = self.responder
        if responder.takeovers != self._seen:
            self.activity = Activity.HIT
            if responder.phase not in (Phase.BLEND, Phase.PLAYING):
                return
            self._seen = responder.takeovers
            self._return_to_graph()
        if responder.phase is Phase.PHYSICS:
            self.activity = Activity.HIT
        elif self._stream is not None:
            self._feed(self._stream)

    def hit(self, impact: Impact) -> None:
        """Let something hit the avatar.

        Args:
            impact: What hits it; its time counts from now.

        Raises:
            SpecError: See `DynamicResponder.hit`.
        """
        self.responder.hit(impact)

    def steer(self, planner: Planner) -> None:
        """Follow another planner as soon as possible: from the graph's next frame on.

        Args:
            planner: Decides where it goes from now on. During a hit it takes over once the
                reaction is blended away (`GraphConfig.blend_s` after the return).
        """
        self.planner = planner
        free = self.responder.free_from
        if self.activity is not Activity.WALKING or self._stream is None or free is None:
            return
        branch = self._stream.branch(max(self.responder.frame, free - 1))
        if branch is not None:
            self._stream = branch
            self._feed(branch, at_once=True)

    # -- steps ----------------------------------------------------------------------------------

    def _feed(self, stream: Stream, at_once: bool = False) -> None:
        """Give the responder what it plays next, `AHEAD_S` ahead."""
        responder, fps = self.responder, self.responder.physics.fps
        until = responder.frame + round(AHEAD_S * fps)
        if stream.end >= until and not at_once:
            return
        # Also where the graph is entered only later.
        until = max(until, stream.end) + round(PIECE_S * fps)
        while stream.end < until:
            count = int(np.ceil((until - stream.end) / fps * self._graph.database.fps))
            stream.extend(self.planner.next_frames(stream.frame, stream.placement, count))
        self._play(stream)

    def _play(self, stream: Stream) -> None:
        """Fit the feet and give the poses to the responder."""
        first, poses = stream.fitted(self.responder.frame)
        free = self.responder.free_from
        assert free is not None
        skip = max(free - first, 0)
        motion = Motion(poses[skip:], self.responder.physics.fps, "walking by graph")
        self.responder.play(motion, first + skip)

    def _return_to_graph(self) -> None:
        """Decide when and where the reaction enters the graph, or that the avatar stays."""
        responder, fps = self.responder, self.responder.physics.fps
        hit, first = responder.last_hit, responder.free_from
        assert hit is not None
        assert first is not None
        begin = max(hit.exit, first - round(fps))
        stop = max(responder.planned_until, first + 1)
        poses = responder.planned(begin, stop + 1 - begin)
        velocities = pose_velocities(poses, fps)
        contacts = foot_contacts(self._character, self._character.kinematics(poses), fps)
        step = max(1, round(fps / self._graph.database.fps))
        moments = np.arange(first - begin, stop - begin, step)
        entry = self._reentry.find(
            poses[moments], velocities[moments], contacts[moments], moments / fps
        )
        reaction = hit.choice.name if hit.choice is not None else "nothing"
        if entry is None:
            self.returns.append(GraphReturn(responder.frame, None, None, reaction))
            self._stream, self.activity = None, Activity.STAYING
            return
        row = int(moments[entry.moment])
        before = slice(0, row + 1)
        self.returns.append(GraphReturn(responder.frame, begin + row, entry, reaction))
        self._stream = self._stream_from(
            entry.frame, begin, poses[before], velocities[row], contacts[before]
        )
        self.activity = Activity.WALKING
        fixed = entry.detour if len(entry.detour) else self._recorded(entry.frame)
        if len(fixed):
            self._stream.extend(fixed)
        self._feed(self._stream, at_once=True)

    def _recorded(self, frame: int) -> IntArray:
        """Frames recorded after a frame of the graph, for as long as a blend lasts (k,).

        A jump while the reaction is blended away would drag standing feet farther than any jump of
        the graph does.
        """
        graph, path = self._graph, [frame]
        for _ in range(round(graph.config.blend_s * graph.database.fps)):
            following = int(graph.database.successors[path[-1]])
            if graph.targets[graph.offsets[path[-1]]] != following:
                break
            path.append(following)
        return np.array(path[1:], dtype=np.int32)

    def _stream_from(
        self,
        frame: int,
        first: int,
        poses: FloatArray,
        velocity: FloatArray,
        contacts: npt.NDArray[np.bool_],
    ) -> Stream:
        fps = self.responder.physics.fps
        return Stream(self._graph, self._character, fps, frame, first, poses, velocity, contacts)
