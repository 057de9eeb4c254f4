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
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.footprints import body_shape, footprints
from dynresp.locomotion.worlds.paths import window_m
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray, frozen

if TYPE_CHECKING:
    from dynresp.locomotion.sketch.path_search_kernel import SearchResult

FACING = 0.2
"""c of eq. 8, at least 0 and below 1: from 1 on it would pay to be far from the goal."""
AHEAD_M = 0.6
"""Distance along the path to the point that the avatar should face [m]."""
PACE = 0.5
"""Cost of a second [m]. Well below the speed of walking the search is greedy; at that speed and
above it looks at everything."""
STRAY = 15.0
"""At a distance d from the path a second costs 1 + STRAY d^2 times as much [1/m^2]."""
JUMP = 4.0
"""Cost of a jump per unit of its distance (eq. 2) [m]."""
MAX_OFF_PATH_M = 1.2
"""Edges that lead farther from the path than this are dropped [m]."""
MARGIN_M = 0.03
"""Footprints are widened by this [m]. They are those of the poses as played; the margin must cover
what happens between two frames, and the foot fitting."""
# Standing: no faster than this [m/s, rad/s], for this long [s].
_STANDING_SPEED, _STANDING_TURN, _STANDING_S = 0.15, 0.5, 0.5


@dataclass(frozen=True, eq=False)
class FoundPath:
    """A path through the graph that a search has found.

    Attributes:
        frames: (k,) played after the state it began from.
        placements: (k, 4) of their clips.
        joints: (j,) ascending indices into frames, the last frame after each of its edges.
        progress: (j,) progress along the drawn path there [points].
        displacements: (j, 91) what is left of blends there; see `AvatarState`. Zeros where there
            are no boxes.
        arrived: Whether its last frame is at the end of the search; otherwise it comes as near as
            any that was looked at.
        looked: Edges that were taken from the heap.
        collided: Those among them that were dropped for a collision.
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
    """A motion graph prepared for searches. One object serves any number of them.

    Attributes:
        graph: The graph.
        character: Whose it is.
        footprints: (n, 4) float32, of each frame; see `dynresp.locomotion.worlds.footprints`.
        half_width_m: Half of the median width of the footprints [m].
        reach_m: Farthest that any footprint reaches from its root [m].
        ends: (n,) the first frame from each on, itself included, from which other edges lead than
            the recorded one; -1 outside of the graph's component.
        still: (n,) where the avatar stands, and goes on standing for half a second.
    """

    def __init__(self, graph: MotionGraph, character: Character | None = None) -> None:
        """Prepare a graph.

        Args:
            graph: The graph.
            character: Whose motions it holds, by default the product's own.
        """
        database = graph.database
        self.graph = graph
        self.character = character or default_character()
        feet = footprints(self.character, database.poses)
        self.footprints = frozen(feet.astype(np.float32))
        corners = np.hypot(np.abs(feet[:, :2]).max(axis=1), np.abs(feet[:, 2:]).max(axis=1))
        self.half_width_m = 0.5 * float(np.median(feet[:, 3] - feet[:, 2]))
        self.reach_m = float(corners.max())
        self.ends = frozen(_ends(graph))
        self.still = frozen(_still(graph))
        self._planar = frozen(np.ascontiguousarray(database.planar[:, [0, 1, 3]]))
        self._body = body_shape(self.character)
        self._anywhere = frozen(np.ones(len(database), dtype=bool))

    def search(
        self,
        start: AvatarState,
        path: FloatArray,
        facing: FloatArray,
        spacing: float,
        progress: float,
        target: float,
        budget: int,
        crowded: int,
        grid: CollisionGrid | None = None,
        arrival_m: float | None = None,
        stop: bool = False,
        greed: float = 1.0,
    ) -> FoundPath:
        """Find the best path through the graph along a drawn path.

        Args:
            start: Where it starts.
            path: (p, 2) points `spacing` apart, at least two [m].
            facing: (p,) c of eq. 8 along it, at least 0 and below 1.
            spacing: Their distance along the path [m].
            progress: Progress along the drawn path at the start [points].
            target: Progress at which the search may end [points].
            budget: Most edges to take from the heap.
            crowded: Most states to look at in one neighbourhood: 0.25 m, 30 degrees.
            grid: The world's boxes.
            arrival_m: How near to the path's last point it must end [m]; None where it may pass
                the target at any distance.
            stop: Whether it must end standing.
            greed: Divides the cost of time; its square divides that of jumps.

        Raises:
            UsageError: The start is not in the graph's component.
        """
        # Numba takes a third of a second to import, the kernel longer when first compiled.
        from dynresp.locomotion.sketch import path_search_kernel as kernel

        check_in_component(self.graph, start.frame)
        fps, config, database = self.graph.database.fps, self.graph.config, self.graph.database
        settings = kernel.SearchSettings(
            pace=PACE / greed,
            stray=STRAY,
            jump=JUMP / greed**2,
            ahead_m=AHEAD_M,
            max_off_path_m=MAX_OFF_PATH_M,
            margin_m=MARGIN_M,
            spacing_m=float(spacing),
            frame_s=1.0 / fps,
            blend_s=float(config.blend_s),
            blend_rate_s=float(config.blend_rate_s),
            target=float(target),
            arrival=float(target - (arrival_m or 0.0) / spacing - 1e-9),
            arrival_m=np.inf if arrival_m is None else float(arrival_m),
            window=float(np.ceil(window_m(fps) / spacing)),
            budget=int(budget),
            crowded=int(crowded),
        )
        graph = kernel.SearchArrays(
            self.graph.offsets, self.graph.targets, self.graph.distances, self.graph.placements,
            self._planar, self.ends, self.still if stop else self._anywhere, self.footprints,
            database.poses, database.velocities,
        )  # fmt: skip
        begin = np.array([*start.placement[[0, 1, 3]], progress, 0.0])
        playing = np.zeros(kernel.PLAYED)
        playing[: kernel.OFFSET] = start.placement
        playing[kernel.AGE] = config.blend_s
        if start.displacement is not None:
            playing[kernel.OFFSET :] = start.displacement
        found = kernel.search_kernel(
            start.frame, begin, playing, settings, graph, path, facing, self._body,
            (grid or _NOTHING).arrays,
        )  # fmt: skip
        return self._played(start.placement, found, found.played[:, kernel.OFFSET :])

    def _played(self, at: FloatArray, result: SearchResult, displacements: FloatArray) -> FoundPath:
        """Play the edges of a search from a placement (4,)."""
        frames, placements, lengths = [], [], []
        for index, edge in enumerate(result.edges):
            at = placement.compose(at, self.graph.placements[edge])
            entry = self.graph.targets[edge]
            last = self.ends[entry]
            if index == len(result.edges) - 1 and result.arrival >= 0:
                last = result.arrival
            played = np.arange(entry, last + 1, dtype=np.int32)
            frames.append(played)
            placements.append(np.broadcast_to(at, (len(played), 4)))
            lengths.append(len(played))
        return FoundPath(
            np.concatenate([np.zeros(0, dtype=np.int32), *frames]),
            np.concatenate([np.zeros((0, 4)), *placements]),
            np.cumsum(lengths, dtype=np.intp) - 1,
            result.progress,
            displacements,
            bool(result.arrival >= 0),
            int(result.looked),
            int(result.collided),
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
