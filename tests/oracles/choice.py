"""The actions that are offered, slow and readable: from trees and most probable motions on.

Those have a twin of their own, see `forest`.
"""

import math

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.choice.action_window import ActionWindow
from dynresp.locomotion.clusters.cluster_forest import ClusterForest, ClusterTree
from dynresp.locomotion.graph import placement
from dynresp.motion.rotations import FloatArray

ALIKE_M = 0.25
TURNED_M = 1.0
ENOUGH = 3
NEAR_S = 4.0


def along(forest: ClusterForest, frames: list[int], place: npt.ArrayLike) -> list[FloatArray]:
    """Planar states of the root along frames; the clip of the first is put at a place."""
    graph, clip, states = forest.graph, np.asarray(place, dtype=np.float64), []
    for k, frame in enumerate(frames):
        if k > 0:
            move = graph.placements_between([frames[k - 1]], [frame])[0]
            clip = placement.compose(clip, move)
        states.append(placement.compose(clip, graph.database.planar[frame]))
    return states


def stay(forest: ClusterForest, entering: list[int], most: int) -> list[int]:
    """Frames, and the most probable frames after it while the cluster is the same."""
    graph, labels = forest.graph, forest.clusters.labels
    frames = list(entering)
    while len(frames) <= most:
        row = range(int(graph.offsets[frames[-1]]), int(graph.offsets[frames[-1] + 1]))
        following = int(graph.targets[max(row, key=lambda k: float(graph.probabilities[k]))])
        if labels[following] != labels[entering[-1]]:
            break
        frames.append(following)
    return frames


def distance(forest: ClusterForest, a: FloatArray, b: FloatArray, of_a: int, of_b: int) -> float:
    """How different ends at planar states are, of clusters [m]."""
    means = forest.clusters.mixture.means
    turned = [0.5 * TURNED_M * (f(a[3]) - f(b[3])) for f in (math.cos, math.sin)]
    return math.dist([*a[:2], *turned, *means[of_a]], [*b[:2], 0.0, 0.0, *means[of_b]])


def candidates(
    forest: ClusterForest,
    tree: ClusterTree,
    lead: list[int],
    place: npt.ArrayLike,
    window: ActionWindow,
) -> dict[int, FloatArray]:
    """The leaves of the part of a tree that a window selects, and where they are entered."""
    waited, fps = len(lead) - 1, forest.graph.database.fps
    inside = {}
    for node in range(1, len(tree.node_clusters)):
        entering = [*lead[:-1], *tree.frames_to(node).tolist()]
        state = along(forest, entering, place)[-1]
        late = tree.steps[tree.node_visits[node]] + waited >= window.earliest_s * fps - 1e-6
        if late and (window.area is None or window.area.contains(state[None, :2])[0]):
            inside[node] = state
    parents = {int(tree.node_parents[node]) for node in inside}
    return {node: state for node, state in inside.items() if node not in parents}


def frames_and_states(
    forest: ClusterForest,
    tree: ClusterTree,
    node: int,
    lead: list[int],
    place: npt.ArrayLike,
    window: ActionWindow,
    most: int,
) -> tuple[list[int], list[FloatArray]]:
    """Frames of a leaf's action from the avatar's own, and their planar states."""
    left = most - (len(lead) - 1)
    least = window.earliest_s * forest.graph.database.fps - 1e-6
    probable = forest.likeliest_motion(tree, node, left / forest.graph.database.fps).frames
    for entering in (probable.tolist(), tree.frames_to(node).tolist()):
        frames = [*lead[:-1], *stay(forest, entering, left)]
        states = along(forest, frames, place)
        entered = len(lead) - 1 + len(entering) - 1
        ends = [
            k
            for k in range(len(frames))
            if window.area is None or window.area.contains(states[k][None, :2])[0]
        ]
        if entered >= least and ends and ends[-1] >= entered:
            break
    return frames[: ends[-1] + 1], states[: ends[-1] + 1]


def within(
    forest: ClusterForest,
    lead: list[int],
    place: npt.ArrayLike,
    window: ActionWindow,
    most: int,
    last: bool,
) -> list[tuple[list[int], FloatArray]]:
    """Actions of at most so many frames."""
    tree = forest.tree(lead[-1], (most - (len(lead) - 1)) / forest.graph.database.fps)
    left = candidates(forest, tree, lead, place, window)
    if not left or (len(left) < ENOUGH and not last):
        return []
    clusters = tree.node_clusters
    best = max(left, key=lambda node: float(tree.log_probabilities[tree.node_visits[node]]))
    offered: list[tuple[list[int], FloatArray]] = []
    ends: list[tuple[FloatArray, int]] = []
    for _ in range(3 * window.count):
        frames, states = frames_and_states(forest, tree, best, lead, place, window, most)
        own = int(clusters[best])
        del left[best]
        if all(distance(forest, states[-1], end, own, c) >= ALIKE_M for end, c in ends):
            offered.append((frames, np.array(states)))
            ends.append((states[-1], own))
        distances = {
            node: min(distance(forest, state, end, int(clusters[node]), c) for end, c in ends)
            for node, state in left.items()
        }
        best = max(distances, key=lambda node: distances[node], default=-1)
        if len(offered) == window.count or best < 0 or distances[best] < ALIKE_M:
            break
    return offered


def offer_actions(
    forest: ClusterForest, frame: int, place: npt.ArrayLike, window: ActionWindow
) -> list[tuple[list[int], FloatArray]]:
    """Frames of each action from the avatar's own, and their planar states (s, 4)."""
    lead, fps = forest.frames_to_branch(frame).tolist(), forest.graph.database.fps
    bounds = [] if window.latest_s is None else [window.latest_s]
    if window.latest_s is None:
        longest, bound = forest.time_bound_s + (len(lead) - 1) / fps, NEAR_S
        while bound < longest:
            bounds.append(bound)
            bound *= 1.5
        bounds.append(longest)
    offered: list[tuple[list[int], FloatArray]] = []
    for bound in bounds:
        most = int(bound * fps + 1e-6)
        if most >= len(lead):
            last = bound == bounds[-1]
            found = within(forest, lead, place, window, most, last)
            offered = found or offered
        if len(offered) >= min(window.count, ENOUGH):
            break
    return offered
