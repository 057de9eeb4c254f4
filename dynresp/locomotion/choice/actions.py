"""Control by choice: a few well-dispersed actions at any moment (Lee et al. 2002, section 5.1).

Candidates are the leaves of that part of the cluster tree which a window in time and space selects
(figure 6). The action that is most probable without a user comes first, then again and again the
one farthest from all before it, in where it ends, how it faces there, and the pose it shows. Each
is told by the most probable motion of its cluster path (eq. 7), which then stays in the last
cluster by the most probable ways, as long as time and space allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.choice.action_window import ChoiceWindow
from dynresp.locomotion.clusters.cluster_forest import ClusterForest, ClusterTree
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray, frozen

# How far to look ahead without an upper bound in time [s]; if need be, half as far again.
_NEAR_S = 4.0
# To face the other way counts as being so far apart [m]; a half radian of a joint is a metre.
_TURNED_M = 1.0
# Actions closer than this [m] count as one.
_ALIKE_M = 0.25
# With so many there is no need to look further ahead for more.
_ENOUGH = 3


@dataclass(frozen=True, eq=False)
class OfferedAction:
    """An action that is offered.

    Attributes:
        start: The frame at which it was offered.
        frames: (s,) frames to play after that one.
        path: (s + 1, 4) planar states of the root in the world, from `start` on; its first two
            columns are the line on the ground to show.
        enters: Index into `frames` of the first in the action's own cluster.
        clusters: (p,) the cluster path; its last is the action's own.
        example: Frame whose pose stands for the cluster.
        pose: (59,) that pose where the action ends, in the world.
        log_probability: Of the motion up to where it enters the cluster (eq. 7), given the branch
            from which the tree grows.
    """

    start: int
    frames: IntArray
    path: FloatArray
    enters: int
    clusters: IntArray
    example: int
    pose: FloatArray
    log_probability: float

    @property
    def cluster(self) -> int:
        """The cluster to which it leads."""
        return int(self.clusters[-1])


def choices(
    forest: ClusterForest,
    frame: int,
    place: npt.ArrayLike = placement.IDENTITY,
    window: ChoiceWindow | None = None,
) -> tuple[OfferedAction, ...]:
    """Actions to choose from.

    Args:
        forest: The cluster trees.
        frame: The frame the avatar is at.
        place: (4,) where its clip is put in the world.
        window: How many, and where and when they may end.

    Returns:
        At most as many as wanted, all different; the one most probable without a choice first.
        Fewer where the window has no more, none where it is out of reach.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    window = window or ChoiceWindow()
    lead, at = forest.frames_to_branch(frame), np.asarray(place, dtype=np.float64)
    offered: list[OfferedAction] = []
    bounds = list(_bounds(forest, window, len(lead) - 1))
    for most_s in bounds:
        most = forest.steps_within(most_s)
        if most < len(lead):
            continue
        candidates = _Candidates.of(forest, lead, at, window, most)
        # Few candidates are not looked at where there will be more.
        if len(candidates.nodes) < _ENOUGH and most_s < bounds[-1]:
            continue
        offered = candidates.dispersed()
        if len(offered) >= min(window.wanted, _ENOUGH):
            break
    return tuple(offered)


def _bounds(forest: ClusterForest, window: ChoiceWindow, waited: int) -> Iterator[float]:
    """How far to look ahead [s], until there is enough; trees begin after `waited` frames."""
    if window.most_s is not None:
        yield window.most_s
        return
    bound, last = _NEAR_S, forest.time_bound_s + waited / forest.graph.database.fps
    while bound < last:
        yield bound
        bound *= 1.5
    yield last


class _Motion(NamedTuple):
    """What an action plays.

    Attributes:
        frames: (s,) from the avatar's own.
        path: (s, 4) planar states of the root.
        enters: Index of the first frame in the action's cluster.
        node: Of the tree.
        cluster: Its cluster.
        log_probability: See `OfferedAction`.
    """

    frames: IntArray
    path: FloatArray
    enters: int
    node: int
    cluster: int
    log_probability: float


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Leaves of the subtree that a window selects.

    Attributes:
        forest: Whose trees.
        tree: The tree.
        lead: (l,) frames from the avatar's to the root of the tree.
        place: (4,) where the clip of the first of them is put.
        window: The window.
        least: Fewest frames after the avatar's until an action's own cluster is entered.
        most: Most frames after the avatar's.
        nodes: (k,) the leaves.
        places: (k, 4) where they are entered along the tree's own ways.
    """

    forest: ClusterForest
    tree: ClusterTree
    lead: IntArray
    place: FloatArray
    window: ChoiceWindow
    least: int
    most: int
    nodes: npt.NDArray[np.intp]
    places: FloatArray

    @classmethod
    def of(
        cls,
        forest: ClusterForest,
        lead: IntArray,
        place: FloatArray,
        window: ChoiceWindow,
        most: int,
    ) -> _Candidates:
        database, waited = forest.graph.database, len(lead) - 1
        tree = forest.tree(int(lead[-1]), (most - waited) / database.fps)
        least = math.ceil(window.least_s * database.fps - 1e-6)
        late = tree.steps[tree.node_visits] + waited >= least
        late[0] = False
        nodes = np.flatnonzero(late)
        if window.area is None:
            # Where each lies need not be known first, and most of them are no leaves.
            nodes = _outermost(tree, nodes)
        root = forest.root_states_along(lead, place)[-1]
        clip = placement.compose(root, placement.inverse(database.planar[tree.root]))
        places = forest.root_states(tree, nodes, clip)
        if window.area is not None:
            nodes_inside = _outermost(tree, nodes[window.area.contains(places[:, :2])])
            kept = np.searchsorted(nodes, nodes_inside)
            nodes, places = nodes[kept], places[kept]
        return cls(forest, tree, lead, place, window, least, most, nodes, places)

    def dispersed(self) -> list[OfferedAction]:
        """The actions that are farthest from each other, at most as many as wanted."""
        if len(self.nodes) == 0:
            return []
        from dynresp.locomotion.choice.dispersal_kernel import farthest_kernel

        clusters, apart = (
            self.tree.node_clusters[self.nodes],
            self.forest.clusters.squared_distances,
        )
        probability = self.tree.log_probabilities[self.tree.node_visits[self.nodes]]
        best = int(np.argmax(probability))
        nearest = np.full(len(self.nodes), np.inf)
        offered: list[_Motion] = []
        # A candidate whose motion turns out to be like one before costs a look, so they are few.
        for _ in range(3 * self.window.wanted):
            motion = self._motion(int(self.nodes[best]))
            nearest[best] = -1.0
            if all(_distance(motion, other, apart) >= _ALIKE_M for other in offered):
                offered.append(motion)
                best = farthest_kernel(
                    self.places, frozen(clusters), apart, motion.path[-1], motion.cluster,
                    _TURNED_M, nearest,
                )  # fmt: skip
            else:
                best = int(np.argmax(nearest))
            if len(offered) == self.window.wanted or nearest[best] < _ALIKE_M:
                break
        examples = self.forest.clusters.examples[[motion.cluster for motion in offered]]
        poses = _shown(self.forest, examples, np.array([motion.path[-1] for motion in offered]))
        return [
            OfferedAction(
                int(self.lead[0]), motion.frames[1:], motion.path, motion.enters - 1,
                self.tree.cluster_path(motion.node), int(example), pose, motion.log_probability,
            )
            for motion, example, pose in zip(offered, examples, poses, strict=True)
        ]  # fmt: skip

    def _motion(self, node: int) -> _Motion:
        """What the action of a node plays: its most probable motion, and its stay."""
        forest, tree = self.forest, self.tree
        waited = len(self.lead) - 1
        left = self.most - waited
        probable = forest.likeliest_motion(tree, node, left / forest.graph.database.fps)
        enters = waited + len(probable.frames) - 1
        frames, path, inside = self._staying(probable.frames, left)
        if enters < self.least or not inside[enters:].any():
            # The most probable way does not come into the window; the tree's own one does.
            way = tree.frames_to(node)
            enters = waited + len(way) - 1
            frames, path, inside = self._staying(way, left)
        stop = int(np.flatnonzero(inside)[-1]) + 1
        cluster = int(tree.node_clusters[node])
        return _Motion(frames[:stop], path[:stop], enters, node, cluster, probable.log_probability)

    def _staying(self, way: IntArray, left: int) -> tuple[IntArray, FloatArray, BoolArray]:
        """Frames, their places, and whether each is in the window, along a way and its stay."""
        frames = np.concatenate([self.lead[:-1], self.forest.stay(way, left)])
        path = self.forest.root_states_along(frames, self.place)
        area = self.window.area
        inside = np.ones(len(path), bool) if area is None else area.contains(path[:, :2])
        return frames, path, inside


def _outermost(tree: ClusterTree, nodes: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Those of some nodes, ascending, that have no child among them."""
    inner = np.zeros(len(tree.node_parents), dtype=bool)
    inner[tree.node_parents[nodes]] = True
    return nodes[~inner[nodes]]


def _shown(forest: ClusterForest, examples: IntArray, ends: FloatArray) -> FloatArray:
    """(k, 59) poses of frames (k,) where actions end (k, 4).

    In fixed coordinates they are as they were recorded.
    """
    database, coordinates = forest.graph.database, forest.graph.config.coordinates
    poses = database.poses[examples]
    if coordinates is Coordinates.FIXED:
        return poses
    at, planar = ends.copy(), database.planar[examples]
    if coordinates is Coordinates.RELATIVE:
        at[:, 2] = planar[:, 2]
    return placement.place_poses(poses, placement.compose(at, placement.inverse(planar)))


def _distance(a: _Motion, b: _Motion, apart: FloatArray) -> float:
    """How different two actions are [m], as the compiled step has it."""
    x, y, _, yaw = a.path[-1] - b.path[-1]
    chord = _TURNED_M * math.sin(0.5 * yaw)
    return math.sqrt(x * x + y * y + chord * chord + apart[a.cluster, b.cluster])
