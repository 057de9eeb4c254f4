"""Follow a path piece by piece: search ahead, play a part, go back where nothing leads on."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.sketch.path_search import FACING, MARGIN_M, FoundPath, SearchGraph
from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.paths import distances_to, resampled
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import DynrespError
from dynresp.support.progress import Progress

SPACING = 0.1
"""Distance of the points of the path that is followed [m]."""
HORIZON_M = 2.5
"""How far ahead along the path each search looks [m]."""
COMMIT_S = 1.0
"""How much of a result is played before the next search [s]."""
BUDGET = 4000
"""Most edges that a search looks at; up to 160 times as many where it finds nothing."""
ARRIVAL_M = 0.25
"""How near to the end of the path the avatar must come [m]; for a path shorter than twice this,
within half of its length."""
# Most states that are looked at in one neighbourhood.
_CROWDED = 12
# Factor of the budget for coming near to an end that cannot be reached.
_MORE = 16
# Where a search finds nothing, others follow: how far back they start [s], the factor of the
# budget, the divisor of the costs, and the most states in a neighbourhood. If there is a path at
# all, it is found soonest by looking first at what is nearest to the goal, whatever it costs. So
# narrow passages are found, too: much that costs less than turning sideways can be tried first.
_RETRIES = (
    (0.0, 16, 1.0, 12),
    (0.0, 16, 3.0, 12),
    (2.0, 16, 10.0, 40),
    (4.0, 16, 10.0, 40),
    (2.0, 160, 10.0, 40),
    (4.0, 160, 10.0, 120),
    (8.0, 160, 30.0, 120),
)
# If that fails as well, a disc of this radius closes the place [m], at most so often.
_CLOSED_M, _MAX_CLOSED = 0.3, 4
# Within this distance of a narrow place the facing of the avatar does not count [m].
_NARROW_M = 0.8
# Blending adds at most this to how far a pose reaches from its root [m].
_BLENDED_REACH_M = 0.5


@dataclass(frozen=True, eq=False)
class SketchedWalk:
    """A walk along a sketch.

    Attributes:
        frames: (k,) the walk; the first is the frame of the start.
        placements: (k, 4) of their clips.
        roots: (k, 4) x, y, z [m] and yaw [rad] of the root.
        path: (p, 2) the path that was followed: the sketch, bent around obstacles [m].
        off_path: (k,) distance of the root to it [m].
        arrived: Whether the end was reached.
        looked: Edges that the searches looked at.
        collided: Those dropped for a collision.
        backtracks: How often a part was taken back because nothing led on.
        detours: How often a place was closed because no search got through.
        planning_s: Time that the searches took [s].
    """

    frames: IntArray
    placements: FloatArray
    roots: FloatArray
    path: FloatArray
    off_path: FloatArray
    arrived: bool
    looked: int
    collided: int
    backtracks: int
    detours: int
    planning_s: float


@dataclass(frozen=True, eq=False)
class _Joint:
    """A point of a walk from which a search may start again.

    Attributes:
        state: Where the avatar is.
        progress: Progress along the path [points].
        played: Frames of the walk so far.
    """

    state: AvatarState
    progress: float
    played: int


class Follower:
    """Makes one walk along a path.

    Attributes:
        begin: (2,) where the walk starts [m].
    """

    def __init__(
        self,
        graph: SearchGraph,
        start: AvatarState,
        world: World | None,
        stop: bool,
        progress: Progress | None,
    ) -> None:
        """Prepare to walk.

        Args:
            graph: The graph to walk through.
            start: Where the avatar is.
            world: Obstacles; None for open ground.
            stop: Whether the walk must end standing; otherwise the avatar may be walking there.
            progress: Called with the state of the work.

        Raises:
            UsageError: The start is not in the graph's component.
        """
        check_in_component(graph.graph, start.frame)
        self.graph, self.start, self.world = graph, start, world
        self.stop = stop
        self.report = progress or _report_nothing
        self.begin = start.root(graph.graph)[:2]
        self.fps = graph.graph.database.fps
        self.grid: CollisionGrid | None = None
        if world is not None:
            self.grid = CollisionGrid.of(world, graph.reach_m + _BLENDED_REACH_M)
        self.looked = self.collided = self.backtracks = 0

    def walk(self, path_from: Callable[[FloatArray], FloatArray]) -> SketchedWalk:
        """Walk along a path.

        Args:
            path_from: Gives the path (k, 2) that keeps out of closed discs (n, 3), rows of x, y
                and radius [m].

        Raises:
            DynrespError: There is no path between the obstacles.
        """
        began = time.perf_counter()
        closed = np.zeros((0, 3))
        if self.world is not None:
            self.report("looking for a path between the obstacles", 0, 1)
        path = _long_enough(path_from(closed))
        arrived, stuck = self._along(path)
        while not arrived and self.world is not None and len(closed) < _MAX_CLOSED:
            ahead = path[int(stuck) : int(stuck + HORIZON_M / SPACING) + 1]
            narrowest = ahead[np.argmin(self.world.distances(ahead))]
            closed = np.concatenate([closed, [[*narrowest, _CLOSED_M]]])
            try:
                path = _long_enough(path_from(closed))
            except DynrespError:
                break
            arrived, stuck = self._along(path)
        if not arrived:
            self._come_near()
        frames, placements = self.frames, self.placements
        roots = placement.compose(placements, self.graph.graph.database.planar[frames])
        return SketchedWalk(
            frames=frames,
            placements=placements,
            roots=roots,
            path=path,
            off_path=distances_to(path, roots[:, :2]),
            arrived=arrived,
            looked=self.looked,
            collided=self.collided,
            backtracks=self.backtracks,
            detours=len(closed),
            planning_s=time.perf_counter() - began,
        )

    def _along(self, path: FloatArray) -> tuple[bool, float]:
        """Walk from the start along a path; whether its end was reached, and how far it went."""
        self.path, self.end = path, len(path) - 1.0
        self.facing = self._facing(path)
        self.frames = np.array([self.start.frame], dtype=np.int32)
        self.placements = self.start.placement[None]
        self.joints = [_Joint(self.start, 0.0, 1)]
        commit = round(COMMIT_S * self.fps)
        while True:
            at = self.joints[-1]
            self.report("looking for a path through the graph", int(at.progress), int(self.end))
            target = min(at.progress + HORIZON_M / SPACING, self.end)
            if not (
                self._advance(at, target, commit, BUDGET, 1.0, _CROWDED)
                or self._advance_from_farther_back(target)
            ):
                return False, at.progress
            if target == self.end and self.arrived:
                return True, self.end

    def _facing(self, path: FloatArray) -> FloatArray:
        """Weight of facing along a path: 0 near places that are narrow for a body."""
        facing = np.full(len(path), FACING)
        if self.grid is not None:
            wide = self.graph.half_width_m + 2.0 * MARGIN_M
            narrow = self.grid.distances(path) < wide
            around = round(_NARROW_M / SPACING)
            near = np.convolve(narrow, np.ones(2 * around + 1))[around : around + len(path)]
            facing[near > 0] = 0.0
        return facing

    def _come_near(self) -> None:
        """Go as near to the end as possible, where it cannot be reached."""
        at = self.joints[-1]
        target = min(at.progress + HORIZON_M / SPACING, self.end)
        budget = _MORE * BUDGET
        self._play(at, self._search(at, target, budget, 1.0, _CROWDED), None)

    def _advance_from_farther_back(self, target: float) -> bool:
        """Search again with more budget and from earlier joints."""
        latest = self.joints[-1].played
        for tried, (back_s, more, greed, crowded) in enumerate(_RETRIES):
            if more > _MORE:
                self.report("found none nearby, looking farther", tried, len(_RETRIES))
            earlier = [j for j in self.joints if j.played <= latest - back_s * self.fps]
            joint = earlier[-1] if earlier else self.joints[0]
            if self._advance(joint, target, None, more * BUDGET, greed, crowded):
                self.backtracks += 1
                return True
        return False

    def _advance(
        self,
        at: _Joint,
        target: float,
        commit: int | None,
        budget: int,
        greed: float,
        crowded: int,
    ) -> bool:
        """Search from a joint to a target, and replace what was played after the joint.

        Args:
            at: The joint.
            target: Progress along the path to reach [points].
            commit: Play the first edges of the result, up to so many frames; None to play all.
            budget: Most edges to look at.
            greed: See `SearchGraph.search`.
            crowded: Most states in one neighbourhood.

        Returns:
            Whether the search got there. If not, nothing changes.
        """
        found = self._search(at, target, budget, greed, crowded)
        if found.arrived:
            self._play(at, found, commit if target < self.end else None)
            self.arrived = target == self.end
        return found.arrived

    def _search(
        self, at: _Joint, target: float, budget: int, greed: float, crowded: int
    ) -> FoundPath:
        last = target == self.end
        arrival_m = min(ARRIVAL_M, 0.5 * self.end * SPACING)
        found = self.graph.search(
            at.state, self.path, self.facing, SPACING, at.progress, target,
            budget, crowded, self.grid, arrival_m if last else None,
            last and self.stop, greed,
        )  # fmt: skip
        self.looked += found.looked
        self.collided += found.collided
        return found

    def _play(self, at: _Joint, found: FoundPath, commit: int | None) -> None:
        """Play the first edges of a result from a joint; what was played after it is removed."""
        edges = len(found.joints)
        if commit is not None:
            edges = 1 + int(np.searchsorted(found.joints[:-1] + 1, commit))
        del self.joints[self.joints.index(at) + 1 :]
        for joint, progress, left in zip(
            found.joints[:edges], found.progress, found.displacements, strict=False
        ):
            state = AvatarState(int(found.frames[joint]), found.placements[joint], left)
            self.joints.append(_Joint(state, float(progress), at.played + int(joint) + 1))
        stop = self.joints[-1].played - at.played
        self.frames = np.concatenate([self.frames[: at.played], found.frames[:stop]])
        self.placements = np.concatenate([self.placements[: at.played], found.placements[:stop]])


def _report_nothing(stage: str, done: int, of: int) -> None:
    """Used where no progress is wanted."""


def _long_enough(path: FloatArray) -> FloatArray:
    """Points `SPACING` apart, two of them at least."""
    points = resampled(path, SPACING)
    return points if len(points) > 1 else np.repeat(points, 2, axis=0)
