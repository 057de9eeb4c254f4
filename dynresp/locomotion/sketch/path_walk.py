"""A walk along a path in the making: stretch by stretch, taken back where it leads nowhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.sketch.path_search import Found, SearchConfig, SearchGraph
from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.obstacles import World
from dynresp.locomotion.worlds.paths import distances_to, resampled
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.checks import check_numbers
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.progress import Progress

SPACING = 0.1
"""Distance of the points of the path that is walked along [m]."""
MOST_LOOKED = 10_000_000
"""The most ways that one search may look at: as many places are remembered, in about 1 GB."""
# The most states that are looked at in one neighbourhood.
_CROWDED = 12
# How many times the budget is spent on coming near to where no way leads.
_MORE = 16
# Where nothing is found the search begins anew: how far back [s], with how many times the budget,
# with costs counted how many times less, and with how many states in a neighbourhood. What has a
# way at all is found soonest by looking first at what is nearest to the goal, whatever it has cost;
# that is also how narrow passages are found, before which there is a lot to try that costs less
# than turning sideways.
_AGAIN = (
    (0.0, 16, 1.0, 12),
    (0.0, 16, 3.0, 12),
    (2.0, 16, 10.0, 40),
    (4.0, 16, 10.0, 40),
    (2.0, 160, 10.0, 40),
    (4.0, 160, 10.0, 120),
    (8.0, 160, 30.0, 120),
)
# A place where that did not help either is closed with a disc of this radius [m], at most so often.
_CLOSED_M, _MOST_CLOSED = 0.3, 4
# How far from a narrow place it does not count where the avatar faces [m].
_NARROW_M = 0.8
# Poses reach farther from their root by at most this when blended [m].
_BLENDED_REACH_M = 0.5


@dataclass(frozen=True)
class SketchConfig:
    """How a sketch is followed.

    Attributes:
        search: What a good way is.
        horizon_m: How far ahead along the path a way is looked for [m].
        commit_s: How much of it is played before the next one is looked for [s].
        budget: Most ways that are looked at each time, at most `MOST_LOOKED`; where none is found,
            up to 160 times as many, but no more than that either.
        arrival_m: How near to its end the avatar must come [m]; to that of a path shorter than
            twice this, within half of its length.
        stop: Whether it must stand there; otherwise it may be walking.

    Raises:
        UsageError: A number makes no sense.
    """

    search: SearchConfig = field(default_factory=SearchConfig)
    horizon_m: float = 2.5
    commit_s: float = 1.0
    budget: int = 4000
    arrival_m: float = 0.25
    stop: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)
        for name, kind in (("search", SearchConfig), ("stop", bool)):
            if not isinstance(getattr(self, name), kind):
                given = type(getattr(self, name)).__name__
                raise UsageError(f"{name} must be a {kind.__name__}, got {given}")
        for name in ("horizon_m", "commit_s", "budget", "arrival_m"):
            if not getattr(self, name) > 0:
                raise UsageError(f"{name} must be above 0, got {getattr(self, name)}")
        if self.budget > MOST_LOOKED:
            raise UsageError(
                f"budget must be at most {MOST_LOOKED} ways, got {str(self.budget)[:40]}: room for "
                "all of them is made before the search begins"
            )


@dataclass(frozen=True, eq=False)
class SketchedWalk:
    """A walk along a sketch.

    Attributes:
        frames: (k,) the walk, beginning with the frame of the start.
        placements: (k, 4) of their clips.
        roots: (k, 4) x, y, z [m] and yaw [rad] of the root.
        path: (p, 2) what was walked along: the sketch, bent around obstacles [m].
        off_path: (k,) distance of the root to it [m].
        arrived: Whether the end was reached.
        looked: Ways that the searches have looked at.
        collided: Those dropped for a collision.
        backtracks: How often a stretch was taken back because it led nowhere.
        detours: How often a place was closed because there is no getting through.
        planning_s: Time that the planning took [s].
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
    """A place in a walk from which it may be planned anew.

    Attributes:
        state: Where the avatar is.
        progress: How much of the path is done [points].
        played: How many frames of the walk.
    """

    state: AvatarState
    progress: float
    played: int


class Follower:
    """A walk in the making.

    Attributes:
        config: How the path is followed.
        begin: (2,) where the walk begins [m].
    """

    def __init__(
        self,
        graph: SearchGraph,
        start: AvatarState,
        world: World | None,
        config: SketchConfig | None,
        progress: Progress | None,
    ) -> None:
        """Prepare to walk.

        Args:
            graph: Where the avatar walks through.
            start: Where it is.
            world: Obstacles; None for open ground.
            config: How the path is followed.
            progress: Told how far it is.

        Raises:
            UsageError: The start is not in the graph's component.
        """
        check_in_component(graph.graph, start.frame)
        self.graph, self.start, self.world = graph, start, world
        self.config = config or SketchConfig()
        self.tell = progress or _tell_nobody
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
            self.tell("looking for a path between the obstacles", 0, 1)
        path = _long_enough(path_from(closed))
        arrived, stuck = self._along(path)
        while not arrived and self.world is not None and len(closed) < _MOST_CLOSED:
            ahead = path[int(stuck) : int(stuck + self.config.horizon_m / SPACING) + 1]
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
        commit = round(self.config.commit_s * self.fps)
        while True:
            at = self.joints[-1]
            self.tell("looking for a way", int(at.progress), int(self.end))
            target = min(at.progress + self.config.horizon_m / SPACING, self.end)
            if not (
                self._advance(at, target, commit, self.config.budget, self.config.search, _CROWDED)
                or self._advance_from_farther_back(target)
            ):
                return False, at.progress
            if target == self.end and self.arrived:
                return True, self.end

    def _facing(self, path: FloatArray) -> FloatArray:
        """How facing counts along a path: not at all near places that are narrow for a body."""
        facing = np.full(len(path), self.config.search.facing)
        if self.grid is not None:
            wide = self.graph.half_width_m + 2.0 * self.config.search.margin_m
            narrow = self.grid.distances(path) < wide
            around = round(_NARROW_M / SPACING)
            near = np.convolve(narrow, np.ones(2 * around + 1))[around : around + len(path)]
            facing[near > 0] = 0.0
        return facing

    def _come_near(self) -> None:
        """Go as far as there is a way, where none leads on."""
        at = self.joints[-1]
        target = min(at.progress + self.config.horizon_m / SPACING, self.end)
        budget = _MORE * self.config.budget
        self._play(at, self._search(at, target, budget, self.config.search, _CROWDED), None)

    def _advance_from_farther_back(self, target: float) -> bool:
        """Look for a way to where none was found, longer and from earlier joints."""
        latest = self.joints[-1].played
        costs = self.config.search
        for tried, (back_s, more, greed, crowded) in enumerate(_AGAIN):
            if more > _MORE:
                self.tell("there is none at hand, looking farther", tried, len(_AGAIN))
            earlier = [j for j in self.joints if j.played <= latest - back_s * self.fps]
            joint = earlier[-1] if earlier else self.joints[0]
            greedy = replace(costs, pace=costs.pace / greed, jump=costs.jump / greed**2)
            if self._advance(joint, target, None, more * self.config.budget, greedy, crowded):
                self.backtracks += 1
                return True
        return False

    def _advance(
        self,
        at: _Joint,
        target: float,
        commit: int | None,
        budget: int,
        search: SearchConfig,
        crowded: int,
    ) -> bool:
        """Go on from a joint to a target; what was walked after the joint is taken back.

        Args:
            at: The joint.
            target: How much of the path is to be done [points].
            commit: After how many frames the first ways of it suffice; None where all are to be
                played.
            budget: Most ways to look at.
            search: What a good way is.
            crowded: Most states in one neighbourhood.

        Returns:
            Whether there is such a way. If there is none, nothing is changed.
        """
        found = self._search(at, target, budget, search, crowded)
        if found.arrived:
            self._play(at, found, commit if target < self.end else None)
            self.arrived = target == self.end
        return found.arrived

    def _search(
        self, at: _Joint, target: float, budget: int, search: SearchConfig, crowded: int
    ) -> Found:
        last = target == self.end
        arrival_m = min(self.config.arrival_m, 0.5 * self.end * SPACING)
        found = self.graph.search(
            at.state, self.path, self.facing, SPACING, at.progress, target, search,
            min(budget, MOST_LOOKED), crowded, self.grid, arrival_m if last else None,
            last and self.config.stop,
        )  # fmt: skip
        self.looked += found.looked
        self.collided += found.collided
        return found

    def _play(self, at: _Joint, found: Found, commit: int | None) -> None:
        """Play the first ways of what was found at a joint; what was walked after it is gone."""
        ways = len(found.joints)
        if commit is not None:
            ways = 1 + int(np.searchsorted(found.joints[:-1] + 1, commit))
        del self.joints[self.joints.index(at) + 1 :]
        for joint, progress, left in zip(
            found.joints[:ways], found.progress, found.displacements, strict=False
        ):
            state = AvatarState(int(found.frames[joint]), found.placements[joint], left)
            self.joints.append(_Joint(state, float(progress), at.played + int(joint) + 1))
        stop = self.joints[-1].played - at.played
        self.frames = np.concatenate([self.frames[: at.played], found.frames[:stop]])
        self.placements = np.concatenate([self.placements[: at.played], found.placements[:stop]])


def _tell_nobody(stage: str, done: int, of: int) -> None:
    """Where nobody asked for progress."""


def _long_enough(path: FloatArray) -> FloatArray:
    """Points `SPACING` apart, two of them at least."""
    points = resampled(path, SPACING)
    return points if len(points) > 1 else np.repeat(points, 2, axis=0)
