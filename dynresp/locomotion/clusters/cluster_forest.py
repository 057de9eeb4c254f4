"""The cluster forest: what the avatar can do from each frame (Lee et al. 2002, section 4.2.2).

A cluster tree begins with the cluster of a frame, and has a child wherever the ways on from there
lead into another cluster. The paper visits frames depth first up to a time bound; taken by the
letter, that walks every way through the graph, and their number grows exponentially. Here, as its
word "spanning tree" suggests, each frame is visited once a tree. Frames are visited in the order
of time, so that whatever can be reached within the bound is in the tree, by the shortest way
there, and of ways equally short by the most probable one. Children of a node that are of the same
cluster are one. A tree so has at most as many nodes as there are frames; a tree of 15 s takes a
fraction of a millisecond to grow, so that none is kept.

A cluster path leads from the root to a node. Its most probable motion (eq. 7, section 4.2.3) may
take any way that stays on the path, not only the tree's, and may come through a frame twice.

Of the jumps from one frame into one cluster only the three most probable are followed. They leave
the same pose for alike ones; where hundreds of jumps leave a frame, the others would cost ten times
the time and tell nothing new.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray, frozen
from dynresp.support.errors import UsageError

TIME_BOUND_S = 15.0
"""How far cluster trees look ahead (section 4.2.2) [s]."""
# Jumps from one frame into one cluster that are followed.
_ALIKE = 3


@dataclass(frozen=True, eq=False)
class ClusterTree:
    """The clusters that can be reached from a frame.

    Frames were visited one after the other, and visit 0 is the root's; nodes were made one after
    the other, and node 0 is the root. Arrays are read-only.

    Attributes:
        frames: (v,) frame of each visit.
        parents: (v,) the visit from which each came; -1 of the root.
        ways: (v,) the way of the graph by which it came; -1 of the root.
        steps: (v,) frames from the root.
        nodes: (v,) node to which each visit belongs.
        log_probabilities: (v,) of the way to each visit.
        node_clusters: (k,) cluster of each node.
        node_parents: (k,) -1 of the root.
        node_visits: (k,) the first visit of each node, where the avatar enters it.
    """

    frames: IntArray
    parents: IntArray
    ways: IntArray
    steps: IntArray
    nodes: IntArray
    log_probabilities: FloatArray
    node_clusters: IntArray
    node_parents: IntArray
    node_visits: IntArray

    @property
    def root(self) -> int:
        """The frame to which the tree belongs."""
        return int(self.frames[0])

    @functools.cached_property
    def leaves(self) -> IntArray:
        """Nodes without children, ascending."""
        inner = np.zeros(len(self.node_parents), dtype=bool)
        inner[self.node_parents[1:]] = True
        return np.flatnonzero(~inner).astype(np.int32)

    def cluster_path(self, node: int) -> IntArray:
        """Clusters from the root to a node; neighbours differ."""
        from dynresp.locomotion.clusters.cluster_forest_kernel import back_kernel

        return back_kernel(self.node_clusters, self.node_parents, node)

    def way_to(self, node: int) -> IntArray:
        """Frames from the root to the first of a node, along the tree."""
        from dynresp.locomotion.clusters.cluster_forest_kernel import back_kernel

        return back_kernel(self.frames, self.parents, self.node_visits[node])


@dataclass(frozen=True, eq=False)
class ProbableMotion:
    """The most probable way along a cluster path.

    Attributes:
        frames: (s,) the first is the root, the last is the first in the path's last cluster.
        log_probability: Logarithm of eq. 7.
    """

    frames: IntArray
    log_probability: float


class ClusterForest:
    """The cluster trees of all frames of a graph.

    Attributes:
        graph: The graph.
        clusters: The cluster of every frame.
        time_bound_s: How far the trees look ahead [s].
    """

    def __init__(
        self, graph: MotionGraph, clusters: Clusters, time_bound_s: float = TIME_BOUND_S
    ) -> None:
        """Prepare to grow trees.

        Raises:
            UsageError: The clusters are another database's, or the time bound is not above 0.
        """
        if len(clusters.labels) != len(graph.database):
            raise UsageError(
                f"the clusters are of {len(clusters.labels)} frames, the graph has "
                f"{len(graph.database)}; cluster this graph"
            )
        if not 0.0 < time_bound_s < np.inf:
            raise UsageError(f"time_bound_s must be above 0, got {time_bound_s}")
        self.graph = graph
        self.clusters = clusters
        self.time_bound_s = time_bound_s
        self._ways = _followed(graph, clusters)
        self._offsets = frozen(np.searchsorted(self._ways, graph.offsets))
        self._targets = frozen(graph.targets[self._ways])
        self._logs = frozen(np.log(graph.probabilities[self._ways]))
        # Of each frame the most probable next one; of frames outside the graph any.
        likeliest = np.zeros(len(graph.database), dtype=np.int32)
        # Of equally probable ones the first of the row, which is the recorded one, is written last.
        order = np.argsort(-graph.probabilities, kind="stable")[::-1]
        likeliest[graph.sources[order]] = graph.targets[order]
        self._likeliest = frozen(likeliest)
        labels = clusters.labels
        own = clusters.log_probabilities[np.arange(len(labels)), labels]
        self._belongs = frozen(own.astype(np.float64))
        order = np.argsort(labels, kind="stable")
        self._sizes = frozen(np.bincount(labels, minlength=len(clusters)).astype(np.int32))
        begins = np.cumsum(self._sizes) - self._sizes
        ranks = np.empty(len(labels), dtype=np.int32)
        ranks[order] = np.arange(len(labels)) - begins[labels[order]]
        self._ranks = frozen(ranks)
        self._members = frozen(order.astype(np.int32))
        # What it costs at least to enter one cluster from another.
        leaps = np.full((len(clusters), len(clusters)), np.inf)
        into, sources = self._targets, graph.sources[self._ways]
        np.minimum.at(leaps, (labels[sources], labels[into]), -self._logs - self._belongs[into])
        self._leaps = frozen(leaps)
        # The same ways, in rows of those that lead to each frame.
        back = np.argsort(into, kind="stable")
        self._back_sources = frozen(sources[back])
        self._back_offsets = frozen(np.searchsorted(into[back], np.arange(len(labels) + 1)))

    def branch(self, frame: int) -> IntArray:
        """Frames from one to the first with several ways on, whose tree it shares.

        Args:
            frame: A frame of the graph; the first that is returned.

        Raises:
            UsageError: The frame is not in the graph's component.
        """
        check_in_component(self.graph, frame)
        offsets, targets = self.graph.offsets, self.graph.targets
        frames = [frame]
        # In a graph that is one circle without a branch, every frame has a tree of its own.
        while offsets[frame + 1] - offsets[frame] == 1 and len(frames) <= len(self.graph.frames):
            frame = int(targets[offsets[frame]])
            frames.append(frame)
        circle = len(frames) > len(self.graph.frames)
        return np.array(frames[:1] if circle else frames, dtype=np.int32)

    def tree(self, frame: int, time_bound_s: float | None = None) -> ClusterTree:
        """The cluster tree of a frame: that of the next branch, where it has only one way on.

        Args:
            frame: A frame of the graph.
            time_bound_s: How far to look ahead of the branch [s], by default the forest's bound.

        Raises:
            UsageError: The frame is not in the graph's component.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import grow_kernel

        root = int(self.branch(frame)[-1])
        n = len(self.graph.database)
        frames, parents, ways, steps, nodes = (np.empty(n, dtype=np.int32) for _ in range(5))
        made = [np.empty(n, dtype=np.int32) for _ in range(3)]
        values = np.empty(n)
        count, size = grow_kernel(
            self._offsets, self._targets, self._logs, self.clusters.labels, root,
            self.depth(time_bound_s), frames, parents, ways, steps, nodes, values, *made,
        )  # fmt: skip
        ways[1:count] = self._ways[ways[1:count]]
        values.flags.writeable = False
        for array in (frames, parents, ways, steps, nodes, *made):
            array.flags.writeable = False
        return ClusterTree(
            frames[:count], parents[:count], ways[:count], steps[:count], nodes[:count],
            values[:count], *(array[:size] for array in made),
        )  # fmt: skip

    def places(
        self,
        tree: ClusterTree,
        nodes: npt.NDArray[np.integer],
        place: npt.ArrayLike = placement.IDENTITY,
    ) -> FloatArray:
        """Where the root enters nodes along the tree's own ways.

        Args:
            tree: The tree.
            nodes: (k,) of it.
            place: (4,) where the clip of the tree's root is put.

        Returns:
            (k, 4) planar states.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import place_kernel

        database = self.graph.database
        return place_kernel(
            tree.frames, tree.parents, tree.ways, frozen(tree.node_visits[nodes]),
            database.successors, self.graph.placements, database.planar, _row(place),
        )  # fmt: skip

    def places_along(self, frames: IntArray, place: npt.ArrayLike) -> FloatArray:
        """(s, 4) planar states of the root along frames (s,).

        Args:
            frames: Each follows the one before.
            place: (4,) where the clip of the first is put.

        Raises:
            UsageError: No way of the graph leads from one to the next.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import along_kernel

        graph, along = self.graph, np.empty((len(frames), 4))
        placed = along_kernel(
            graph.offsets, graph.targets, graph.placements, graph.database.planar,
            np.ascontiguousarray(frames, dtype=np.int32), _row(place), along,
        )  # fmt: skip
        if placed < len(frames):
            raise UsageError(
                f"frame {frames[placed]} does not follow frame {frames[placed - 1]} in the graph; "
                "give frames of a walk through it"
            )
        return along

    def probable_motion(
        self, tree: ClusterTree, node: int, time_bound_s: float | None = None
    ) -> ProbableMotion:
        """The most probable motion along the cluster path to a node (eq. 7).

        Args:
            tree: The tree.
            node: Where the path leads.
            time_bound_s: Longest time that it may take [s], by default the forest's bound.

        Raises:
            UsageError: The tree itself enters the node later than that.
        """
        from dynresp.locomotion.clusters.likeliest_motion_kernel import probable_kernel

        depth = self.depth(time_bound_s)
        entered = tree.node_visits[node]
        fewest = int(tree.steps[entered])
        if fewest > depth:
            fps = self.graph.database.fps
            raise UsageError(
                f"the tree enters node {node} after {fewest / fps:g} s, later than the time bound "
                f"of {depth / fps:g} s; allow at least so long"
            )
        frames, log_probability = probable_kernel(
            self._offsets, self._targets, self._logs, self._back_offsets, self._back_sources,
            self._belongs, self.clusters.labels, self._ranks, self._sizes, self._members,
            self._leaps, tree.cluster_path(node), tree.way_to(node),
            tree.log_probabilities[entered], depth,
        )  # fmt: skip
        return ProbableMotion(frames, log_probability)

    def stay(self, frames: IntArray, most: int) -> IntArray:
        """Go on by the most probable ways while the cluster remains the last frame's.

        Args:
            frames: (s,) of the graph, at least one.
            most: Most steps from the first frame to the last.

        Returns:
            The frames, and those that follow.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import stay_kernel

        return stay_kernel(
            self._likeliest, self.clusters.labels, np.ascontiguousarray(frames, np.int32), most
        )

    def depth(self, time_bound_s: float | None) -> int:
        """Frames that fit into a time bound [s]."""
        bound = self.time_bound_s if time_bound_s is None else time_bound_s
        # A bound that is a number of frames but for rounding is that number.
        return int(bound * self.graph.database.fps + 1e-6)


def _row(place: npt.ArrayLike) -> FloatArray:
    return np.ascontiguousarray(place, dtype=np.float64)


def _followed(graph: MotionGraph, clusters: Clusters) -> IntArray:
    """Ways that trees follow, ascending: the recorded ones, and of alike jumps the best."""
    into = clusters.labels[graph.targets]
    order = np.lexsort((-graph.probabilities, into, graph.sources))
    same = np.diff(into[order], prepend=-1) == 0
    same[1:] &= np.diff(graph.sources[order]) == 0
    places = np.arange(len(order))
    # How many more probable ones of the same frame and cluster there are.
    rank = places - np.maximum.accumulate(np.where(same, 0, places))
    recorded = graph.database.successors[graph.sources] == graph.targets
    followed = recorded.copy()
    followed[order] |= rank < _ALIKE
    return frozen(np.flatnonzero(followed).astype(np.int32))
