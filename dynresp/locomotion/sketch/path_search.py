"""Best-first search through a motion graph along a path (Lee et al. 2002, section 5.2).

The paper's objective is E(p) = |p_g - p| - c (p_g - p) . u (eq. 8), with u the facing direction.
Both terms are lengths if u has unit length, so c is a plain number: E = d (1 - c cos(angle to the
goal)). Two things follow. With c of 1 or more it pays to be far away as long as one looks at the
goal, so c must stay below 1; and near the goal facing counts for nothing. Here d is the length of
the way left along the path plus the distance to it, so that a bend is no local minimum, and the
angle is that to a point a little ahead on the path. To E is added what the way there has cost:
time at a pace, more of it the farther the avatar strays, and the distance of each jump (eq. 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.footprints import body_arrays, footprints
from dynresp.locomotion.worlds.paths import window_m
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.checks import check_numbers
from dynresp.support.errors import UsageError

FARTHEST_AHEAD_M = 100.0
"""How far ahead on a path the point may be that the avatar should face [m]."""


@dataclass(frozen=True)
class SearchConfig:
    """What a good way is, and how long one is looked for.

    Attributes:
        facing: c of eq. 8, at least 0 and below 1.
        ahead_m: How far ahead on the path the point is that the avatar should face, at most
            `FARTHEST_AHEAD_M` [m].
        pace: What a second costs [m]. Well below the speed of walking the search is greedy; at
            that speed and above it looks at all there is.
        stray: At a distance d from the path a second costs 1 + stray d^2 times as much [1/m^2].
        jump: What a jump costs for each unit of its distance (eq. 2) [m].
        farthest_m: Ways that lead farther from the path than this are dropped [m].
        margin_m: By how much footprints are widened [m]. They are those of the poses as played;
            the margin must hold what lies between two frames, and the fitting of the feet.

    Raises:
        UsageError: A number makes no sense.
    """

    facing: float = 0.2
    ahead_m: float = 0.6
    pace: float = 0.5
    stray: float = 15.0
    jump: float = 4.0
    farthest_m: float = 1.2
    margin_m: float = 0.03

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)
        if not 0 <= self.facing < 1:
            raise UsageError(
                f"facing must be at least 0 and below 1, got {self.facing}: from 1 on it would pay "
                "to be far from the goal"
            )
        for name in ("ahead_m", "pace", "stray", "jump", "margin_m"):
            if not getattr(self, name) >= 0:
                raise UsageError(f"{name} must be 0 or more, got {getattr(self, name)}")
        if self.ahead_m > FARTHEST_AHEAD_M:
            raise UsageError(
                f"ahead_m must be at most {FARTHEST_AHEAD_M:g}, got {self.ahead_m}: nobody faces "
                "what is farther ahead"
            )
        if not self.farthest_m > 0:
            raise UsageError(f"farthest_m must be above 0, got {self.farthest_m}")


@dataclass(frozen=True, eq=False)
class Found:
    """A way that a search has found.

    Attributes:
        frames: (k,) played after the state it began from.
        placements: (k, 4) of their clips.
        joints: (j,) ascending indices into frames, the last frame of each of its ways.
        progress: (j,) how much of the path is done there [points].
        displacements: (j, 91) what is left of blends there; see `AvatarState`. Zeros where there
            are no boxes.
        arrived: Whether its last frame is where the search was to end; otherwise it comes as near
            as any that was looked at.
        looked: Ways that were taken from the heap.
        collided: Ways among them that were dropped for a collision.
    """

    frames: IntArray
    placements: FloatArray
    joints: npt.NDArray[np.intp]
    progress: FloatArray
    displacements: FloatArray
    arrived: bool
    looked: int
    collided: int


class SearchGraph:
    """A motion graph laid out for the search. Made once, it serves any number of them.

    Attributes:
        graph: The graph.
        character: Whose it is.
        footprints: (n, 4) float32, of each frame; see `dynresp.locomotion.worlds.footprints`.
        half_width_m: Half of how much ground it mostly covers sideways [m].
        reach_m: Farthest that any of them reaches from its root [m].
        ends: (n,) the first frame from each on, itself included, from which other ways lead than
            the recorded one; -1 outside of the graph's component.
        still: (n,) where the avatar stands, and goes on standing for half a second.
    """

    def __init__(self, graph: MotionGraph, character: Character | None = None) -> None:
        """Lay out a graph.

        Args:
            graph: The graph.
            character: Whose it is, by default the product's own.
        """
        database = graph.database
        self.graph = graph
        self.character = character or default_character()
        feet = footprints(self.character, database.poses)
        self.footprints = feet.astype(np.float32)
        corners = np.hypot(np.abs(feet[:, :2]).max(axis=1), np.abs(feet[:, 2:]).max(axis=1))
        self.half_width_m = 0.5 * float(np.median(feet[:, 3] - feet[:, 2]))
        self.reach_m = float(corners.max())
        self.ends = _ends(graph)
        self.still = _still(graph)
        self._planar = np.ascontiguousarray(database.planar[:, [0, 1, 3]])
        self._body = body_arrays(self.character)
        self._anywhere = np.ones(len(database), dtype=bool)

    def search(
        self,
        start: AvatarState,
        path: FloatArray,
        facing: FloatArray,
        spacing: float,
        progress: float,
        target: float,
        config: SearchConfig,
        budget: int,
        crowded: int,
        grid: CollisionGrid | None = None,
        arrival_m: float | None = None,
        stop: bool = False,
    ) -> Found:
        """Find the best way along a path.

        Args:
            start: Where it begins.
            path: (p, 2) points `spacing` apart, at least two [m].
            facing: (p,) c of eq. 8 along it, at least 0 and below 1.
            spacing: Their distance along the path [m].
            progress: How much of the path is done [points].
            target: How much of it is to be done [points].
            config: What a good way is.
            budget: Most ways to take from the heap.
            crowded: Most states to look at in one neighbourhood: a quarter of a metre, 30 degrees.
            grid: The world's boxes.
            arrival_m: How near to the path's last point it must end [m]; None where it may pass
                the target at any distance.
            stop: Whether it must end standing.

        Raises:
            UsageError: The start is not in the graph's component.
        """
        # Numba takes a third of a second to import, the kernel longer when first compiled.
        from dynresp.locomotion.sketch import path_search_kernel as kernel

        check_in_component(self.graph, start.frame)
        settings = np.zeros(kernel.SETTINGS)
        settings[kernel.PACE], settings[kernel.STRAY] = config.pace, config.stray
        settings[kernel.JUMP] = config.jump
        settings[kernel.AHEAD], settings[kernel.FARTHEST] = config.ahead_m, config.farthest_m
        settings[kernel.MARGIN], settings[kernel.SPACING] = config.margin_m, spacing
        settings[kernel.FRAME_TIME] = 1.0 / self.graph.database.fps
        settings[kernel.TARGET] = target
        settings[kernel.REACHED] = target - (arrival_m or 0.0) / spacing - 1e-9
        settings[kernel.RADIUS] = np.inf if arrival_m is None else arrival_m
        settings[kernel.WINDOW] = np.ceil(window_m(self.graph.database.fps) / spacing)
        settings[kernel.BLEND] = self.graph.config.blend_s
        settings[kernel.BLEND_RATE] = self.graph.config.blend_rate_s
        begin = np.array([*start.placement[[0, 1, 3]], progress, 0.0])
        playing = np.zeros(kernel.PLAYED)
        playing[: kernel.OFFSET] = start.placement
        playing[kernel.AGE] = self.graph.config.blend_s
        if start.displacement is not None:
            playing[kernel.OFFSET :] = start.displacement
        told = np.empty(3, dtype=np.int64)
        database = self.graph.database
        chain, done, rows = kernel.search_kernel(
            start.frame, begin, playing, settings, path, facing, budget, crowded,
            self.graph.offsets, self.graph.targets, self.graph.distances, self.graph.placements,
            self._planar, self.ends, self.still if stop else self._anywhere, self.footprints,
            (database.poses, database.velocities), self._body, (grid or _NOTHING).arrays, told,
        )  # fmt: skip
        return self._found(start, chain, done, rows[:, kernel.OFFSET :], told)

    def _found(
        self,
        start: AvatarState,
        chain: npt.NDArray[np.int64],
        done: FloatArray,
        displacements: FloatArray,
        told: npt.NDArray[np.int64],
    ) -> Found:
        """Play a chain of ways."""
        frames, placements, lengths = [], [], []
        at = start.placement
        for index, way in enumerate(chain):
            at = placement.compose(at, self.graph.placements[way])
            entry = self.graph.targets[way]
            last = self.ends[entry]
            if index == len(chain) - 1 and told[0] >= 0:
                last = told[0]
            played = np.arange(entry, last + 1, dtype=np.int32)
            frames.append(played)
            placements.append(np.broadcast_to(at, (len(played), 4)))
            lengths.append(len(played))
        return Found(
            np.concatenate([np.zeros(0, dtype=np.int32), *frames]),
            np.concatenate([np.zeros((0, 4)), *placements]),
            np.cumsum(lengths, dtype=np.intp) - 1,
            done,
            displacements,
            bool(told[0] >= 0),
            int(told[1]),
            int(told[2]),
        )


_NOTHING = CollisionGrid(
    np.array([0.0, 0.0, 1.0]),
    np.zeros((0, 0), dtype=np.float32),
    np.zeros(1, dtype=np.int32),
    np.zeros(0, dtype=np.int32),
    np.zeros((0, 6)),
)


def _ends(graph: MotionGraph) -> IntArray:
    """See `SearchGraph.ends`."""
    n = len(graph.database)
    ways = np.diff(graph.offsets)
    single = np.flatnonzero(ways == 1)
    goes_on = np.zeros(n, dtype=bool)
    goes_on[single] = graph.targets[graph.offsets[single]] == graph.database.successors[single]
    frames = np.arange(n)
    ends = np.where(goes_on, n, frames)
    # The nearest frame from each on that does not just go on.
    ends = np.minimum.accumulate(ends[::-1])[::-1]
    return np.where(ways > 0, ends, -1).astype(np.int32)


def _still(graph: MotionGraph) -> npt.NDArray[np.bool_]:
    """See `SearchGraph.still`."""
    database = graph.database
    slow = np.hypot(*database.velocities[:, :2].T) < _STANDING_SPEED
    turning = np.abs(database.velocities[:, 5]) < _STANDING_TURN
    stands = slow & turning & (np.diff(graph.offsets) > 0)
    still = stands.copy()
    for ahead in range(1, round(_STANDING_S * database.fps) + 1):
        still[:-ahead] &= stands[ahead:] & (database.clip_of[ahead:] == database.clip_of[:-ahead])
        still[-ahead:] = False
    return still


# Standing: no faster than this [m/s, rad/s], for this long [s].
_STANDING_SPEED, _STANDING_TURN, _STANDING_S = 0.15, 0.5, 0.5
