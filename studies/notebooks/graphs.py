"""What the notebooks on motion graphs share: the graphs of the plans that come with dynresp, and pictures of them.

Where there is no motion capture, the graph of built-in motion takes the place of the recorded one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import study
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import LogNorm
from matplotlib.patches import Ellipse, Polygon
from matplotlib.typing import ColorType

from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import find_graph_spec, graph_specs_folder, read_graph_spec
from dynresp.locomotion.choice.actions import offer_actions
from dynresp.locomotion.clusters.cluster_forest import ClusterForest, ClusterTree
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.frame_database import IntArray
from dynresp.locomotion.graph.frame_distance import frame_distances, frame_features
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.pruning import step_groups
from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray, from_yaw
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.support.errors import MissingMotionDataError
from dynresp.view import body_shapes as shapes
from dynresp.view import raster
from dynresp.view.story import Block, MovingCapsule
from studies.graphs.gait_measures import Gait

LEFT, RIGHT = study.BLUE, study.ORANGE
"""Colours of the feet."""

_PIXEL = 0.008  # [m]


@cache
def built(name: str, leave_out: tuple[str, ...] = ()) -> MotionGraph | None:
    """The graph of a plan that comes with dynresp, or None where its motions are not on this machine.

    Args:
        name: The plan.
        leave_out: Motions to leave out besides those that the plan leaves out.
    """
    plan = read_graph_spec(find_graph_spec(name))
    plan = plan.model_copy(update={"leave_out": [*plan.leave_out, *leave_out]})
    character, told = default_character(), lambda *_: None
    try:
        return build_graph(plan, motion_folders(None), graph_specs_folder(), character, told)
    except MissingMotionDataError:
        return None


def walking() -> tuple[str, MotionGraph]:
    """The graph of walking on level ground, recorded or else built in, and the name of its plan."""
    for name in ("walking", "builtin"):
        graph = built(name)
        if graph is not None:
            return name, graph
    raise AssertionError("built-in motion is always there")


def scene(
    axes: Axes,
    poses: FloatArray,
    boxes: Sequence[Block] = (),
    bars: Sequence[MovingCapsule] = (),
    look: float = 90.0,
    down: float = 15.0,
) -> None:
    """Draw a person in some poses (k, 59), and what stands about, as seen by a camera far away.

    Args:
        axes: Where; its units become metres.
        poses: The poses.
        boxes: Boxes on the ground.
        bars: Bars, where they are first.
        look: Direction in which the camera looks [deg], counter-clockwise from +X.
        down: How far it looks down [deg].
    """
    character = default_character()
    solids = shapes.character_solids(character)
    states = character.kinematics(poses)
    colors = shapes.phase_colors(solids, None, 0.0)
    meshes = [m for k in range(len(poses)) for m in shapes.place(solids, states, k, colors)]
    for box in boxes:
        mesh = shapes.box(box.half_sizes, shapes.BLOCK_COLOR)
        meshes.append(mesh.placed(np.array(box.center), from_yaw(box.yaw)))
    for bar in bars:
        mesh = shapes.capsule(bar.radius, bar.half_length, shapes.CAPSULE_COLOR)
        meshes.append(mesh.placed(bar.positions[0], bar.quaternions[0]))
    yaw, elevation = np.radians(look), np.radians(down)
    body = raster.draw(meshes, raster.Projection.looking(yaw, elevation), _PIXEL)
    layers = [raster.floor_shadow(meshes, yaw, elevation, _PIXEL), body]
    left, top = min(layer.left for layer in layers), max(layer.top for layer in layers)
    right = max(layer.left + layer.rgba.shape[1] for layer in layers)
    bottom = min(layer.top - layer.rgba.shape[0] for layer in layers)
    canvas = raster.Canvas(left, top, right - left, top - bottom)
    for layer, alpha in zip(layers, (0.3, 1.0), strict=True):
        canvas.paste(layer, alpha=alpha)
    extent = np.array([left, right, bottom, top]) * _PIXEL
    axes.imshow(canvas.picture(), extent=tuple(extent), interpolation="antialiased")
    axes.set_axis_off()


def pose_cell(axes: Axes, pose: FloatArray, title: str, color: ColorType) -> None:
    """Draw one pose (59,) in a cell of its own, seen from ahead and a little aside, its title on a colour."""
    put = placement.inverse(placement.of_poses(pose[None]))
    put[:, 2] = 0.0
    down = 12.0
    scene(axes, placement.place_poses(pose[None], put), look=150.0, down=down)
    pelvis = float(pose[2] * np.cos(np.radians(down)))
    axes.set(xlim=(-0.85, 0.85), ylim=(pelvis - 1.1, pelvis + 1.3))
    axes.set_title(
        title, fontsize=8, pad=4, bbox={"facecolor": color, "lw": 0, "pad": 2, "alpha": 0.6}
    )


def ground(axes: Axes, boxes: Sequence[Block] = ()) -> None:
    """Make axes a piece of ground seen from above, with boxes on it."""
    axes.set_aspect("equal")
    axes.grid(color="#e6e8eb", lw=0.6)
    axes.set_axisbelow(True)
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    patches = []
    for box in boxes:
        cosine, sine = np.cos(box.yaw), np.sin(box.yaw)
        turn = np.array([[cosine, sine], [-sine, cosine]])
        patches.append(Polygon(corners * box.half_sizes[:2] @ turn + box.center[:2]))
    axes.add_collection(PatchCollection(patches, facecolors="#b9a27c", edgecolors="white", lw=0.4))


def soles(axes: Axes, gait: Gait) -> None:
    """Draw where the feet of a walk stand: each an ellipse along the foot."""
    for foot, color in enumerate((LEFT, RIGHT)):
        here = gait.feet == foot
        patches = [
            Ellipse(tuple(place), 0.26, 0.10, angle=float(np.degrees(yaw)))
            for place, yaw in zip(gait.places[here], gait.yaws[here], strict=True)
        ]
        axes.add_collection(PatchCollection(patches, facecolors=color, alpha=0.55, lw=0))


def pieces(graph: MotionGraph, wanted: Sequence[str] = (), most: int = 75) -> list[IntArray]:
    """Frames of four clips, at most so many of each, where jumps lead from.

    Args:
        graph: The graph.
        wanted: Parts of the clips' names; without such clips, those with the most jumps.
        most: How many of each.
    """
    database = graph.database
    left = graph.sources[database.successors[graph.sources] != graph.targets]
    counts = np.bincount(database.clip_of[left], minlength=len(database.clips))
    chosen = [k for part in wanted for k, clip in enumerate(database.clips) if part in clip.name]
    if len(chosen) < 4:
        chosen = sorted(np.argsort(-counts, kind="stable")[:4].tolist())
    found = []
    for k in chosen[:4]:
        clip, own = database.clips[k], left[database.clip_of[left] == k]
        # The piece with the most jumps.
        ahead = np.searchsorted(own, own + most) - np.arange(len(own))
        start = own[np.argmax(ahead)] if len(own) else clip.start
        start = max(clip.start, min(int(start), clip.stop - most))
        found.append(np.arange(start, min(start + most, clip.stop), dtype=np.int32))
    return found


def matrix_block(row: Sequence[Axes], graph: MotionGraph, parts: Sequence[IntArray]) -> None:
    """Draw a block of a graph's matrix in four axes: distance, rule 1, rule 2, and the graph.

    Args:
        row: The axes.
        graph: The graph.
        parts: Frames, piece by piece.
    """
    database, config = graph.database, graph.config
    frames = np.concatenate(parts)
    features = frame_features(database.poses[frames], database.velocities[frames], config)
    at = np.arange(len(frames))
    unlike = frame_distances(features, at[:, None], at[None])
    groups = step_groups(database.contact_states, database.successors, config.contact_change)[
        frames
    ]
    alike = (groups[:, None] == groups[None]) & (groups >= 0)
    likely = np.exp(-unlike / config.sigma)
    place = np.full(len(database), -1)
    place[frames] = at
    left, matched = place[graph.sources], place[np.maximum(graph.targets - 1, 0)]
    both = (left >= 0) & (matched >= 0)
    own = both & (database.successors[graph.sources] == graph.targets)
    jumps = both & ~own
    row[0].imshow(unlike, norm=LogNorm(0.03, 10.0), cmap="viridis_r")
    allowed = np.nonzero(alike & (likely > 1e-12))
    row[1].scatter(
        *allowed[::-1], c=likely[allowed], norm=LogNorm(1e-12, 1.0), cmap="magma_r", s=2, lw=0
    )
    kept = np.nonzero(alike & (likely >= config.least_probability))
    row[2].scatter(*kept[::-1], color=study.INK, s=3, lw=0)
    row[3].scatter(matched[own], left[own], color=study.GREY, s=1, lw=0)
    row[3].scatter(matched[jumps], left[jumps], color=study.RED, s=5, lw=0)
    borders = np.cumsum([len(part) for part in parts])[:-1] - 0.5
    for axes in row:
        axes.set(
            xlim=(-0.5, len(frames) - 0.5), ylim=(len(frames) - 0.5, -0.5), xticks=[], yticks=[]
        )
        axes.set_aspect("equal")
        for border in borders:
            for line in (axes.axhline, axes.axvline):
                line(border, color="white" if axes is row[0] else study.GREY, lw=0.7)


def cluster_tree(
    axes: Axes, tree: ClusterTree, fps: float, colors: Sequence[ColorType]
) -> FloatArray:
    """Draw a cluster tree over time, nodes in the colours of their clusters.

    Args:
        axes: Where.
        tree: The tree.
        fps: Frame rate of its graph [1/s].
        colors: One a cluster.

    Returns:
        (k, 2) when each node is entered [s], and its height.
    """
    entered = tree.steps[tree.node_visits] / fps
    children = [np.flatnonzero(tree.node_parents == node) for node in range(len(entered))]
    heights = np.zeros(len(entered))

    def settle(node: int, free: float) -> float:
        """Give a node and what hangs on it their heights; the next free one."""
        if len(children[node]) == 0:
            heights[node] = free
            return free - 1.0
        for child in children[node]:
            free = settle(int(child), free)
        heights[node] = heights[children[node]].mean()
        return free

    settle(0, 0.0)
    for node, cluster in enumerate(tree.node_clusters):
        at = (entered[node], heights[node])
        if node:
            parent = tree.node_parents[node]
            corner = (entered[parent], heights[node])
            way = np.array([(entered[parent], heights[parent]), corner, at])
            axes.plot(*way.T, color=study.GREY, lw=1, zorder=1)
        axes.plot(*at, "o", ms=13, color=colors[cluster])
        axes.text(*at, str(cluster), ha="center", va="center", fontsize=8)
    axes.set_yticks([])
    return np.stack([entered, heights], axis=1)


def offered(forest: ClusterForest, seed: int) -> None:
    """Draw the choices at some frame: their ways over the ground, and the poses they stand for."""
    graph = forest.graph
    frame = int(np.random.default_rng(seed).choice(graph.frames))
    place = placement.IDENTITY
    if graph.config.coordinates is Coordinates.RELATIVE:
        # At the origin, facing along x.
        place = placement.inverse(graph.database.planar[frame])
    actions = offer_actions(forest, frame, place)
    fig = plt.figure(figsize=(13, 3.4))
    plan, *cells = fig.subplots(1, 1 + len(actions), width_ratios=(2.4, *(1.0 for _ in actions)))
    ground(plan)
    hues = (study.BLUE, study.ORANGE, study.GREEN, study.RED)
    for k, (action, color, axes) in enumerate(zip(actions, hues, cells, strict=False)):
        plan.plot(*action.path[:, :2].T, color=color, lw=2, label=str(k + 1))
        plan.plot(*action.path[-1, :2], "o", color=color)
        said = f"{k + 1}: {len(action.frames) / graph.config.fps:.1f} s"
        pose_cell(axes, action.pose, said, color)
    plan.plot(*actions[0].path[0, :2], "o", mfc="white", mec=study.INK, ms=8)
    plan.margins(0.15)
    plan.legend(loc="best", fontsize=8)
    plan.set(xlabel="x [m]", ylabel="y [m]", title=f"frame {frame}")
    plt.show()
