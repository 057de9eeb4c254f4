"""Offer a few different actions at any moment: control by choice (Lee et al. 2002, section 5.1).

An action is a path through clusters. The candidates are the leaves of the part of the cluster tree
that a window in time and space selects (figure 6). The most probable action comes first. Each next
one is the candidate whose distance to all actions before it is greatest; the distance compares
where an action ends, the facing there, and the pose of its cluster. An action plays the most
probable motion of its cluster path (eq. 7), and then stays in the last cluster by the most probable
frames as long as the window allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.choice.action_window import ActionWindow
from dynresp.locomotion.clusters.cluster_forest import ClusterForest, ClusterTree
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.placement import IDENTITY, compose, inverse, place_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray, frozen

# How far to look ahead at first where the window has no latest time [s].
_NEAR_S = 4.0
# Distance that facing the opposite way counts as [m]; half a radian of a joint counts as a metre.
_TURN_M = 1.0
# Actions nearer than this count as the same [m].
_ALIKE_M = 0.25
# With so many actions there is no need to look further ahead for more.
_ENOUGH = 3


@dataclass(frozen=True, eq=False)
class OfferedAction:
    """An action that is offered to the user.

    Attributes:
        start: The frame at which it was offered.
        frames: (s,) frames to play after that one.
        path: (s + 1, 4) planar states of the root in the world, from `start` on; the first two
            columns are the line on the ground to show.
        entry: Index into `frames` of the first frame in the action's own cluster.
        clusters: (p,) the cluster path; the last is the action's own.
        example: Frame whose pose represents the cluster.
        pose: (59,) that pose where the action ends, in the world.
        log_probability: Of the motion up to the entry of the cluster (eq. 7), given the branch at
            which the tree starts.
    """

    start: int
    frames: IntArray
    path: FloatArray
    entry: int
    clusters: IntArray
    example: int
    pose: FloatArray
    log_probability: float

    @property
    def cluster(self) -> int:
        """The cluster to which it leads."""
        return int(self.clusters[-1])


def offer_actions(
    forest: ClusterForest,
    frame: int,
    placement: npt.ArrayLike = IDENTITY,
    window: ActionWindow | None = None,
) -> tuple[OfferedAction, ...]:
    """Find actions for a user to choose from.

    Args:
        forest: The cluster trees.
        frame: The avatar's frame.
        placement: (4,) of its clip in the world.
        window: How many, and where and when they may end.

    Returns:
        At most as many as the window asks for, all different; the most probable one first. Fewer
        where the window holds no more, none where nothing in it can be reached.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    window = window or ActionWindow()
    lead, placed = forest.frames_to_branch(frame), np.asarray(placement, dtype=np.float64)
    offered: list[OfferedAction] = []
    bounds = list(_bounds(forest, window, len(lead) - 1))
    for bound_s in bounds:
        max_steps = forest.steps_within(bound_s)
        if max_steps < len(lead):
            continue
        candidates = _Candidates.of(forest, lead, placed, window, max_steps)
        # Few candidates are skipped where a later bound will find more.
        if len(candidates.nodes) < _ENOUGH and bound_s < bounds[-1]:
            continue
        offered = candidates.dispersed()
        if len(offered) >= min(window.count, _ENOUGH):
            break
    return tuple(offered)


def _bounds(forest: ClusterForest, window: ActionWindow, waited: int) -> Iterator[float]:
    """How far to look ahead [s], until there are enough; trees start after `waited` frames."""
    if window.latest_s is not None:
        yield window.latest_s
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
        entry: Index of the first frame in the action's cluster.
        node: Of the tree.
        cluster: Its cluster.
        log_probability: See `OfferedAction`.
    """

    frames: IntArray
    path: FloatArray
    entry: int
    node: int
    cluster: int
    log_probability: float


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Leaves of the subtree that a window selects.

    Attributes:
        forest: The forest of the tree.
        tree: The tree.
        lead: (l,) frames from the avatar's to the root of the tree.
        placement: (4,) of the clip of the first of them.
        window: The window.
        min_steps: Fewest frames from the avatar's to the entry of an action's own cluster.
        max_steps: Most frames from the avatar's to the end of an action.
        nodes: (k,) the leaves.
        states: (k, 4) planar states of the root where they are entered along the tree.
    """

    forest: ClusterForest
    tree: ClusterTree
    lead: IntArray
    placement: FloatArray
    window: ActionWindow
    min_steps: int
    max_steps: int
    nodes: npt.NDArray[np.intp]
    states: FloatArray

    @classmethod
    def of(
        cls,
        forest: ClusterForest,
        lead: IntArray,
        placement: FloatArray,
        window: ActionWindow,
        max_steps: int,
    ) -> _Candidates:
        database, waited = forest.graph.database, len(lead) - 1
        tree = forest.tree(int(lead[-1]), (max_steps - waited) / database.fps)
        min_steps = math.ceil(window.earliest_s * database.fps - 1e-6)
        late = tree.steps[tree.node_visits] + waited >= min_steps
        late[0] = False
        nodes = np.flatnonzero(late)
        if window.area is None:
            # No state is needed to find the leaves, and most nodes are no leaves.
            nodes = _outermost(tree, nodes)
        root = forest.root_states_along(lead, placement)[-1]
        clip = compose(root, inverse(database.planar[tree.root]))
        states = forest.root_states(tree, nodes, clip)
        if window.area is not None:
            nodes_inside = _outermost(tree, nodes[window.area.contains(states[:, :2])])
            kept = np.searchsorted(nodes, nodes_inside)
            nodes, states = nodes[kept], states[kept]
        return cls(forest, tree, lead, placement, window, min_steps, max_steps, nodes, states)

    def dispersed(self) -> list[OfferedAction]:
        """The actions that differ most from each other, at most as many as the window asks for."""
        if len(self.nodes) == 0:
            return []
        from dynresp.locomotion.choice.dispersal_kernel import Candidates, least_alike_kernel

        clusters = self.forest.clusters
        candidates = Candidates(
            frozen(self.states),
            frozen(self.tree.node_clusters[self.nodes]),
            clusters.squared_distances,
        )
        probability = self.tree.log_probabilities[self.tree.node_visits[self.nodes]]
        best = int(np.argmax(probability))
        nearest = np.full(len(self.nodes), np.inf)
        offered: list[_Motion] = []
        # A candidate whose motion is like one before costs time, so the number of tries is limited.
        for _ in range(3 * self.window.count):
            motion = self._motion(int(self.nodes[best]))
            nearest[best] = -1.0
            if all(self._distance(motion, other) >= _ALIKE_M for other in offered):
                offered.append(motion)
                best = least_alike_kernel(
                    candidates, motion.path[-1], motion.cluster, _TURN_M, nearest
                )
            else:
                best = int(np.argmax(nearest))
            if len(offered) == self.window.count or nearest[best] < _ALIKE_M:
                break
        examples = clusters.examples[[motion.cluster for motion in offered]]
        poses = _poses_at(self.forest, examples, np.array([motion.path[-1] for motion in offered]))
        return [
            OfferedAction(
                int(self.lead[0]), motion.frames[1:], motion.path, motion.entry - 1,
                self.tree.cluster_path(motion.node), int(example), pose, motion.log_probability,
            )
            for motion, example, pose in zip(offered, examples, poses, strict=True)
        ]  # fmt: skip

    def _motion(self, node: int) -> _Motion:
        """What the action of a node plays: its most probable motion, and its stay."""
        forest, tree = self.forest, self.tree
        waited = len(self.lead) - 1
        left = self.max_steps - waited
        likeliest = forest.likeliest_motion(tree, node, left / forest.graph.database.fps)
        entry = waited + len(likeliest.frames) - 1
        frames, path, inside = self._with_stay(likeliest.frames, left)
        if entry < self.min_steps or not inside[entry:].any():
            # The most probable motion does not come into the window; that along the tree does.
            along_tree = tree.frames_to(node)
            entry = waited + len(along_tree) - 1
            frames, path, inside = self._with_stay(along_tree, left)
        stop = int(np.flatnonzero(inside)[-1]) + 1
        cluster = int(tree.node_clusters[node])
        return _Motion(frames[:stop], path[:stop], entry, node, cluster, likeliest.log_probability)

    def _with_stay(self, entering: IntArray, left: int) -> tuple[IntArray, FloatArray, BoolArray]:
        """Frames and their stay, their planar states, and whether each is in the window's area."""
        frames = np.concatenate([self.lead[:-1], self.forest.stay(entering, left)])
        path = self.forest.root_states_along(frames, self.placement)
        area = self.window.area
        inside = np.ones(len(path), bool) if area is None else area.contains(path[:, :2])
        return frames, path, inside

    def _distance(self, a: _Motion, b: _Motion) -> float:
        """How different two actions are [m], with the same formula as the kernel."""
        x, y, _, yaw = a.path[-1] - b.path[-1]
        chord = _TURN_M * math.sin(0.5 * yaw)
        means = self.forest.clusters.squared_distances[a.cluster, b.cluster]
        return math.sqrt(x * x + y * y + chord * chord + means)


def _outermost(tree: ClusterTree, nodes: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Those of some nodes, ascending, that have no child among them."""
    inner = np.zeros(len(tree.node_parents), dtype=bool)
    inner[tree.node_parents[nodes]] = True
    return nodes[~inner[nodes]]


def _poses_at(forest: ClusterForest, examples: IntArray, ends: FloatArray) -> FloatArray:
    """(k, 59) poses of frames (k,), moved to where actions end (k, 4).

    In fixed coordinates they stay as they were recorded.
    """
    database, coordinates = forest.graph.database, forest.graph.config.coordinates
    poses = database.poses[examples]
    if coordinates is Coordinates.FIXED:
        return poses
    at, planar = ends.copy(), database.planar[examples]
    if coordinates is Coordinates.RELATIVE:
        at[:, 2] = planar[:, 2]
    return place_poses(poses, compose(at, inverse(planar)))
