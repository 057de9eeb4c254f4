"""An avatar that walks by graph, is hit, and walks on: the loop of graph and responder closed.

While it walks, some seconds of its way are planned and given to its responder. Something hits it,
and the responder takes over: simulation, blend, reaction. As soon as the blend is laid it is known
how the reaction goes on, and the avatar looks for the moment of it and the frame of the graph that
resemble each other most; from there it walks on, without waiting for the reaction's end.
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
from dynresp.support.errors import UsageError

# Returns that are remembered.
_RETURNS = 100


class Planner(Protocol):
    """What says where an avatar goes."""

    def next_frames(self, frame: int, place: FloatArray, count: int) -> IntArray:
        """Where to go on.

        Args:
            frame: The frame of the graph played last.
            place: (4,) where its clip is put; see `dynresp.locomotion.graph.placement`.
            count: How many frames are wanted.

        Returns:
            (k,) the next frames of the graph, at least one; about as many as are wanted.
        """


class RandomPlanner:
    """Goes by the graph's probabilities (eq. 1)."""

    def __init__(self, graph: MotionGraph, rng: np.random.Generator) -> None:
        """Wander by a source of chance."""
        self._graph = graph
        self._rng = rng

    def next_frames(self, frame: int, place: FloatArray, count: int) -> IntArray:
        """See `Planner.next_frames`."""
        return random_walk(self._graph, count, self._rng, frame)


@dataclass(frozen=True)
class AvatarConfig:
    """How an avatar keeps on.

    Attributes:
        ahead_s: Its way is planned for at least so long [s]. A hit looks ahead two seconds, and
            feet are fitted with regard to as much.
        piece_s: How much is planned at a time [s].
    """

    ahead_s: float = 4.0
    piece_s: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is not above 0.
        """
        for name in ("ahead_s", "piece_s"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise UsageError(f"{name} must be above 0, got {getattr(self, name)}")


class Activity(Enum):
    """What an avatar does."""

    WALKING = "walking"
    """It walks by graph, or is on its way back there: what follows is planned."""
    HIT = "hit"
    """Something has hit it, or it is met where it stood; where it goes on is not known yet."""
    STAYING = "staying"
    """Its reaction ends out of the graph's reach: it lies, or, where places count (fixed
    coordinates), stands where nobody walked. It stays so until it is hit again."""


@dataclass(frozen=True)
class GraphReturn:
    """How an avatar came back from a reaction, or did not.

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
        responder: Its run-time side, which is shown and hit.
        planner: What says where it goes.
        returns: How it came back from its last hundred reactions, in order.
        doing: What it does.
    """

    def __init__(
        self,
        character: Character,
        responder: DynamicResponder,
        planner: Planner,
        reentry: ReentryPlanner,
        start: int,
        config: AvatarConfig,
    ) -> None:
        """Begin at a frame of the graph, which the responder shows.

        Args:
            character: Its body.
            responder: At its frame 0.
            planner: What says where it goes.
            reentry: Finds the way back.
            start: The frame of the graph.
            config: Settings.
        """
        self.responder = responder
        self.planner = planner
        self.returns: deque[GraphReturn] = deque(maxlen=_RETURNS)
        self.activity = Activity.WALKING
        self._character = character
        self._reentry = reentry
        self._graph = reentry.graph
        self._config = config
        self._seen = responder.takeovers
        # What the database holds there is how it moves, turned as the avatar is.
        place = placement.compose(
            placement.of_poses(responder.pose[None])[0],
            placement.inverse(self._graph.database.planar[start]),
        )
        velocity = self._graph.database.velocities[start].copy()
        cosine, sine = np.cos(place[3]), np.sin(place[3])
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
        """(2,) which feet are to stand in the frame that is shown.

        None while it does not show its way through the graph: while something approaches it is
        simulated already, if held by the pelvis, and a reaction stands as it does.
        """
        shown = self.activity is Activity.WALKING and self.responder.phase is Phase.PLAYING
        return self._stream.standing(self.responder.frame) if shown and self._stream else None

    def plan_ahead(self) -> None:
        """Plan what is needed before the responder's next frame."""
        responder = self.responder
        if responder.takeovers != self._seen:
            self.activity = Activity.HIT
            if responder.phase not in (Phase.BLEND, Phase.PLAYING):
                return
            self._seen = responder.takeovers
            self._come_back()
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
        """Go where another planner says, as soon as possible: from the graph's next frame on.

        Args:
            planner: What says where it goes from now on. While it is hit, from when the reaction
                is blended away (`GraphConfig.blend_s` after its return) on.
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
        """Give the responder what it plays, as far ahead as asked for."""
        responder, fps = self.responder, self.responder.physics.fps
        until = responder.frame + round(self._config.ahead_s * fps)
        if stream.end >= until and not at_once:
            return
        # What was entered late is begun, too.
        until = max(until, stream.end) + round(self._config.piece_s * fps)
        while stream.end < until:
            count = int(np.ceil((until - stream.end) / fps * self._graph.database.fps))
            stream.extend(self.planner.next_frames(stream.frame, stream.placement, count))
        self._play(stream)

    def _play(self, stream: Stream) -> None:
        """Fit the feet and hand over."""
        first, poses = stream.fitted(self.responder.frame)
        free = self.responder.free_from
        assert free is not None
        late = max(free - first, 0)
        motion = Motion(poses[late:], self.responder.physics.fps, "walking by graph")
        self.responder.play(motion, first + late)

    def _come_back(self) -> None:
        """Find out when and where what it plays now goes over into the graph."""
        responder, fps = self.responder, self.responder.physics.fps
        flight, first = responder.flight, responder.free_from
        assert flight is not None
        assert first is not None
        begin = max(flight.exit, first - round(fps))
        stop = max(responder.planned_until, first + 1)
        poses = responder.planned(begin, stop + 1 - begin)
        velocities = pose_velocities(poses, fps)
        contacts = foot_contacts(self._character, self._character.kinematics(poses), fps)
        step = max(1, round(fps / self._graph.database.fps))
        moments = np.arange(first - begin, stop - begin, step)
        way = self._reentry.find(
            poses[moments], velocities[moments], contacts[moments], moments / fps
        )
        after = flight.choice.name if flight.choice is not None else "nothing"
        if way is None:
            self.returns.append(GraphReturn(responder.frame, None, None, after))
            self._stream, self.activity = None, Activity.STAYING
            return
        row = int(moments[way.moment])
        before = slice(0, row + 1)
        self.returns.append(GraphReturn(responder.frame, begin + row, way, after))
        self._stream = self._stream_from(
            way.frame, begin, poses[before], velocities[row], contacts[before]
        )
        self.activity = Activity.WALKING
        before_choice = way.detour if len(way.detour) else self._recorded(way.frame)
        if len(before_choice):
            self._stream.extend(before_choice)
        self._feed(self._stream, at_once=True)

    def _recorded(self, frame: int) -> IntArray:
        """What was recorded after a frame of the graph, for as long as a blend lasts (k,).

        A jump while the reaction is blended away would drag feet that stand farther than any of the
        graph's own.
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
