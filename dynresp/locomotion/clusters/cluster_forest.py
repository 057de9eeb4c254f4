"""Cluster trees: which clusters can be reached from a frame (Lee et al. 2002, section 4.2.2).

The root of a tree is the cluster of a frame. A node has a child wherever the edges of the graph
lead from it into another cluster. The paper visits frames depth first up to a time bound. Read
literally, that follows every path through the graph, and the number of paths grows exponentially.
Here each frame is visited once in a tree, as the paper's word "spanning tree" suggests, and in the
order of time: every frame that can be reached within the bound is in the tree, by a shortest path,
and among the shortest ones by the most probable. Children of one node with the same cluster are
merged. So a tree has at most as many nodes as there are frames. A tree of 15 s takes a fraction of
a millisecond to grow, so none is kept.

A cluster path leads from the root to a node. Its most probable motion (eq. 7, section 4.2.3) may
use every edge that stays on the cluster path, not only those of the tree, and may visit a frame
twice.

Of the jumps from one frame into one cluster only the three most probable are followed. All of them
start at one pose and end at similar ones. Where hundreds of jumps leave a frame, the others would
take ten times as long and add nothing new.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray, frozen
from dynresp.support.errors import UsageError

TIME_BOUND_S = 15.0
"""How far cluster trees look ahead (section 4.2.2) [s]."""
# So many jumps from one frame into one cluster are followed.
_MAX_ALIKE_JUMPS = 3


@dataclass(frozen=True, eq=False)
class ClusterTree:
    """The clusters that can be reached from a frame. The arrays are read-only.

    Visits and nodes are numbered in the order of time. Visit 0 and node 0 are the root's.

    Attributes:
        frames: (v,) frame of each visit.
        parents: (v,) the visit before each; -1 of the root.
        edges: (v,) edge of the graph that leads to each; -1 of the root.
        steps: (v,) frames from the root.
        nodes: (v,) node of each visit.
        log_probabilities: (v,) of the path to each visit.
        node_clusters: (k,) cluster of each node.
        node_parents: (k,) -1 of the root.
        node_visits: (k,) the first visit of each node, where the avatar enters it.
    """

    frames: IntArray
    parents: IntArray
    edges: IntArray
    steps: IntArray
    nodes: IntArray
    log_probabilities: FloatArray
    node_clusters: IntArray
    node_parents: IntArray
    node_visits: IntArray

    @property
    def root(self) -> int:
        """The frame at which the tree starts."""
        return int(self.frames[0])

    @functools.cached_property
    def leaves(self) -> IntArray:
        """Nodes without children, ascending."""
        inner = np.zeros(len(self.node_parents), dtype=bool)
        inner[self.node_parents[1:]] = True
        return np.flatnonzero(~inner).astype(np.int32)

    def cluster_path(self, node: int) -> IntArray:
        """Clusters from the root to a node; neighbours differ."""
        from dynresp.locomotion.clusters.cluster_forest_kernel import values_from_root_kernel

        return values_from_root_kernel(self.node_clusters, self.node_parents, node)

    def frames_to(self, node: int) -> IntArray:
        """Frames from the root to the first of a node, along the tree."""
        from dynresp.locomotion.clusters.cluster_forest_kernel import values_from_root_kernel

        return values_from_root_kernel(self.frames, self.parents, self.node_visits[node])


@dataclass(frozen=True, eq=False)
class LikeliestMotion:
    """The most probable motion along a cluster path.

    Attributes:
        frames: (s,) from the root to the first in the path's last cluster.
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
            UsageError: The clusters are those of another database, or the time bound is not above
                0.
        """
        # The module compiles its loops when it is imported.
        from dynresp.locomotion.clusters import cluster_forest_kernel as tree_kernel
        from dynresp.locomotion.clusters import likeliest_motion_kernel as motion_kernel

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
        self._followed = _followed(graph, clusters)
        targets = graph.targets[self._followed]
        sources = graph.sources[self._followed]
        logs = np.log(graph.probabilities[self._followed])
        self._edges = tree_kernel.Edges(
            frozen(np.searchsorted(self._followed, graph.offsets)), frozen(targets), frozen(logs)
        )
        self._graph = tree_kernel.GraphArrays(
            graph.offsets, graph.targets, graph.placements, graph.database.successors,
            graph.database.planar,
        )  # fmt: skip
        # The same edges, in rows of those that lead to each frame.
        back, n = np.argsort(targets, kind="stable"), len(graph.database)
        self._incoming = motion_kernel.IncomingEdges(
            frozen(np.searchsorted(targets[back], np.arange(n + 1))), frozen(sources[back])
        )
        labels = clusters.labels
        memberships = clusters.log_probabilities[np.arange(n), labels].astype(np.float64)
        order = np.argsort(labels, kind="stable")
        sizes = np.bincount(labels, minlength=len(clusters)).astype(np.int32)
        begins = np.cumsum(sizes) - sizes
        ranks = np.empty(n, dtype=np.int32)
        ranks[order] = np.arange(n) - begins[labels[order]]
        entry_costs = np.full((len(clusters), len(clusters)), np.inf)
        np.minimum.at(entry_costs, (labels[sources], labels[targets]), -logs - memberships[targets])
        self._clusters = motion_kernel.ClusterArrays(
            labels, frozen(memberships), frozen(ranks), frozen(sizes),
            frozen(order.astype(np.int32)), frozen(entry_costs),
        )  # fmt: skip
        self._likeliest = _likeliest_next(graph)

    def frames_to_branch(self, frame: int) -> IntArray:
        """Frames from one to the first with several edges; all of them share its tree.

        Args:
            frame: A frame of the graph; the first of the result.

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
        """The cluster tree of a frame; with a single edge, that of the next branch.

        Args:
            frame: A frame of the graph.
            time_bound_s: How far to look ahead of the branch [s], by default the forest's bound.

        Raises:
            UsageError: The frame is not in the graph's component.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import TreeArrays, grow_kernel

        root = int(self.frames_to_branch(frame)[-1])
        n = len(self.graph.database)
        frames, parents, edges, steps, nodes = (np.empty(n, dtype=np.int32) for _ in range(5))
        of_nodes = [np.empty(n, dtype=np.int32) for _ in range(3)]
        logs = np.empty(n)
        arrays = TreeArrays(frames, parents, edges, steps, nodes, logs, *of_nodes)
        depth = self.steps_within(time_bound_s)
        visits, size = grow_kernel(self._edges, self.clusters.labels, root, depth, arrays)
        edges[1:visits] = self._followed[edges[1:visits]]
        for array in arrays:
            array.flags.writeable = False
        return ClusterTree(
            frames[:visits], parents[:visits], edges[:visits], steps[:visits], nodes[:visits],
            logs[:visits], *(array[:size] for array in of_nodes),
        )  # fmt: skip

    def root_states(
        self,
        tree: ClusterTree,
        nodes: npt.NDArray[np.integer],
        placement: npt.ArrayLike = IDENTITY,
    ) -> FloatArray:
        """Where the root enters nodes, along the tree.

        Args:
            tree: The tree.
            nodes: (k,) of it.
            placement: (4,) of the clip of the tree's root.

        Returns:
            (k, 4) planar states: x, y, z [m] and yaw [rad].
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import root_states_kernel

        return root_states_kernel(
            self._graph, tree.frames, tree.parents, tree.edges, frozen(tree.node_visits[nodes]),
            _row(placement),
        )  # fmt: skip

    def root_states_along(self, frames: IntArray, placement: npt.ArrayLike) -> FloatArray:
        """(s, 4) planar states of the root along frames (s,): x, y, z [m] and yaw [rad].

        Args:
            frames: Each follows the one before.
            placement: (4,) of the clip of the first.

        Raises:
            UsageError: No edge of the graph leads from one to the next.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import root_states_along_kernel

        states = np.empty((len(frames), 4))
        along = np.ascontiguousarray(frames, dtype=np.int32)
        placed = root_states_along_kernel(self._graph, along, _row(placement), states)
        if placed < len(frames):
            raise UsageError(
                f"frame {frames[placed]} does not follow frame {frames[placed - 1]} in the graph; "
                "give the frames of a walk through the graph"
            )
        return states

    def likeliest_motion(
        self, tree: ClusterTree, node: int, time_bound_s: float | None = None
    ) -> LikeliestMotion:
        """The most probable motion along the cluster path to a node (eq. 7).

        Args:
            tree: The tree.
            node: The end of the path.
            time_bound_s: Longest time that it may take [s], by default the forest's bound.

        Raises:
            UsageError: The tree itself enters the node later than that.
        """
        from dynresp.locomotion.clusters.likeliest_motion_kernel import likeliest_motion_kernel

        depth = self.steps_within(time_bound_s)
        entered = tree.node_visits[node]
        fewest = int(tree.steps[entered])
        if fewest > depth:
            fps = self.graph.database.fps
            raise UsageError(
                f"the tree enters node {node} after {fewest / fps:g} s, later than the time bound "
                f"of {depth / fps:g} s; give a bound of at least {fewest / fps:g} s"
            )
        frames, log_probability = likeliest_motion_kernel(
            self._edges, self._incoming, self._clusters, tree.cluster_path(node),
            tree.frames_to(node), tree.log_probabilities[entered], depth,
        )  # fmt: skip
        return LikeliestMotion(frames, log_probability)

    def stay(self, frames: IntArray, max_steps: int) -> IntArray:
        """Append the most probable next frames while the cluster is the last frame's.

        Args:
            frames: (s,) of the graph, at least one.
            max_steps: Most steps from the first frame to the last.

        Returns:
            The frames, and those that follow.
        """
        from dynresp.locomotion.clusters.cluster_forest_kernel import stay_kernel

        along = np.ascontiguousarray(frames, np.int32)
        return stay_kernel(self._likeliest, self.clusters.labels, along, max_steps)

    def steps_within(self, time_bound_s: float | None) -> int:
        """How many frames fit into a time bound [s], by default the forest's."""
        bound = self.time_bound_s if time_bound_s is None else time_bound_s
        # Rounding must not remove the last frame.
        return int(bound * self.graph.database.fps + 1e-6)


def _row(placement: npt.ArrayLike) -> FloatArray:
    return np.ascontiguousarray(placement, dtype=np.float64)


def _likeliest_next(graph: MotionGraph) -> IntArray:
    """(n,) the most probable next frame of each; of frames outside the graph any."""
    likeliest = np.zeros(len(graph.database), dtype=np.int32)
    # The last one written wins: among equals the first of the row, which is the recorded one.
    order = np.argsort(-graph.probabilities, kind="stable")[::-1]
    likeliest[graph.sources[order]] = graph.targets[order]
    return frozen(likeliest)


def _followed(graph: MotionGraph, clusters: Clusters) -> IntArray:
    """Edges that trees follow, ascending: the recorded ones, and the best of alike jumps."""
    into = clusters.labels[graph.targets]
    order = np.lexsort((-graph.probabilities, into, graph.sources))
    same = np.diff(into[order], prepend=-1) == 0
    same[1:] &= np.diff(graph.sources[order]) == 0
    positions = np.arange(len(order))
    # How many more probable ones of the same frame and cluster there are.
    rank = positions - np.maximum.accumulate(np.where(same, 0, positions))
    recorded = graph.database.successors[graph.sources] == graph.targets
    followed = recorded.copy()
    followed[order] |= rank < _MAX_ALIKE_JUMPS
    return frozen(np.flatnonzero(followed).astype(np.int32))
