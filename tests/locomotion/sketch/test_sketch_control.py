from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs.sketch_run import standing_at
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.sketch.path_search import SearchGraph
from dynresp.locomotion.sketch.path_walk import SketchedWalk
from dynresp.locomotion.sketch.sketch_chooser import SketchChooser
from dynresp.locomotion.sketch.sketch_control import follow_sketch, reach
from dynresp.locomotion.worlds.maze import random_maze
from dynresp.locomotion.worlds.obstacles import Obstacle, World, body_clearances
from dynresp.locomotion.worlds.paths import distances_to, resampled
from dynresp.motion.builtin import FLAT, load_builtin
from dynresp.motion.character import default_character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import DynrespError, UsageError
from studies.graphs import maze_walks, sketched_paths
from tests.locomotion.samples import walking_graph


@pytest.fixture(scope="module")
def straight() -> SearchGraph:
    """The built-in walk: it can only go straight on."""
    return SearchGraph(walking_graph(default_character(), sigma=0.3))


@pytest.fixture(scope="module")
def made() -> SearchGraph:
    """All that the product makes itself on level ground: bends, about turns, side steps."""
    motions = [load_builtin(name, default_character()) for name in FLAT]
    return SearchGraph(MotionGraph.build(motions, GraphConfig(mirrored=True)))


@pytest.fixture(scope="module")
def walker(motions_folder: Path) -> SearchGraph:
    """19 minutes of walking, forward, backward and sideways, of three people."""
    folder = motions_folder
    files = sorted((folder / "snumrl_DataDrivenBipedController").glob("*.bvh"))
    files += sorted((folder / "snumrl_ys2010/Physics2").glob("wd2_Walk*.bvh"))
    files += sorted((folder / "snumrl_ys2010/VideoMotion").glob("*walk*.bvh"))
    files += sorted((folder / "snumrl_ys2010/Walking").glob("*.bvh"))
    names = ("3/walk", "3/walk_side", "3/walk_stop_walk", "3/spin", "1/walk_straight")
    files += [folder / f"snumrl_TillingPatch/{name}.amc" for name in names]
    motions = [load_motion(file, options=LoadOptions(trim_t_poses=True)) for file in files]
    return SearchGraph(MotionGraph.build(motions, GraphConfig()))


def standing(tables: SearchGraph, x: float, y: float, yaw: float) -> AvatarState:
    frames = np.flatnonzero(tables.still) if tables.still.any() else tables.graph.frames
    return AvatarState.at(tables.graph, int(frames[len(frames) // 3]), x, y, yaw)


def clearance(tables: SearchGraph, walk: SketchedWalk, world: World) -> float:
    """How near the body comes to a box, at four times the frame rate."""
    playback = Playback(tables.graph, int(walk.frames[0]), walk.placements[0])
    poses = playback.play(walk.frames[1:]).poses
    between = 0.75 * poses[:-1] + 0.25 * poses[1:]
    return float(body_clearances(world, tables.character, np.concatenate([poses, between])).min())


def check_walk(tables: SearchGraph, walk: SketchedWalk) -> None:
    """A walk goes by ways of the graph and is placed as it is played."""
    graph = tables.graph
    for left, entered in zip(walk.frames[:-1], walk.frames[1:], strict=True):
        assert entered in graph.targets[graph.offsets[left] : graph.offsets[left + 1]]
    playback = Playback(graph, int(walk.frames[0]), walk.placements[0])
    played = playback.play(walk.frames[1:])
    np.testing.assert_allclose(walk.placements[1:], played.placements, atol=1e-9)
    np.testing.assert_allclose(walk.off_path, distances_to(walk.path, walk.roots[:, :2]))


def test_a_straight_walk_follows_a_straight_sketch(straight: SearchGraph) -> None:
    start = standing(straight, 1.0, 2.0, 0.5)
    way = np.array([np.cos(0.5), np.sin(0.5)])
    walk = follow_sketch(straight, start, [(1.0, 2.0), (1.0, 2.0) + 6.0 * way])
    check_walk(straight, walk)
    assert walk.arrived
    assert walk.frames[0] == start.frame
    np.testing.assert_allclose(walk.roots[0], start.root(straight.graph))
    assert np.hypot(*(walk.roots[-1, :2] - (1.0, 2.0) - 6.0 * way)) <= 0.25
    assert walk.off_path.mean() < 0.15


def test_it_is_the_same_each_time(straight: SearchGraph) -> None:
    world = World((-2.0, -2.0, 9.0, 2.0), (Obstacle((3.0, 0.8), (0.3, 0.3)),))
    walks = [reach(straight, standing(straight, 0, 0, 0), (6.0, 0.0), world) for _ in range(2)]
    np.testing.assert_array_equal(walks[0].frames, walks[1].frames)
    np.testing.assert_array_equal(walks[0].placements, walks[1].placements)


def test_a_sketch_that_begins_elsewhere_is_joined(straight: SearchGraph) -> None:
    walk = follow_sketch(straight, standing(straight, 0, 0, 0), [(2.0, 0.0), (5.0, 0.0)])
    assert walk.arrived
    np.testing.assert_allclose(walk.path[[0, -1]], [(0.0, 0.0), (5.0, 0.0)], atol=1e-12)


def test_where_no_way_is_the_walk_ends(straight: SearchGraph) -> None:
    """A walk that only goes straight on cannot follow a sharp bend, and says so."""
    start = standing(straight, 0, 0, 0)
    walk = follow_sketch(straight, start, [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)])
    check_walk(straight, walk)
    assert not walk.arrived
    assert walk.roots[-1, 0] > 1.0
    # Nor can it leave the line for a box on it; the plan can.
    world = World((-2.0, -3.0, 9.0, 3.0), (Obstacle((3.0, 0.0), (0.3, 0.3)),))
    walk = reach(straight, start, (6.0, 0.0), world)
    assert not walk.arrived
    assert clearance(straight, walk, world) > 0.0
    assert 0.1 < walk.roots[-1, 0] < 3.0
    closed = World((-2.0, -3.0, 9.0, 3.0), (Obstacle((3.0, 0.0), (0.3, 3.0)),))
    with pytest.raises(DynrespError, match="no path"):
        reach(straight, start, (6.0, 0.0), closed)


def circle(radius: float, rounds: float = 1.0) -> FloatArray:
    """Closed, beginning at the origin along x."""
    at = np.linspace(0.0, 2.0 * np.pi * rounds, round(60 * rounds))
    return radius * np.stack([np.sin(at), 1.0 - np.cos(at)], axis=1)


def eight(size: float) -> FloatArray:
    """A figure eight that begins at its crossing."""
    at = np.linspace(0.0, 2.0 * np.pi, 120)
    return size * np.stack([np.sin(at), np.sin(at) * np.cos(at)], axis=1)


PATHS = {
    "there and back": [(0, 0), (3, 0), (0, 0), (3, 0)],
    "to and fro": [(0, 0), (1, 0), (0, 0), (1, 0), (0, 0)],
    "a spike": [(0, 0), (2, 0), (2, 1), (2, 0), (4, 0)],
    "a zigzag": [(0, 0), (3, 0), (0, 0.5), (3, 1), (0, 1.5)],
    "a circle": circle(1.0),
    "three rounds": circle(1.5, 3.0),
    "an eight": eight(1.5),
    "twice around a square": [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0)] * 2,
    "through its own crossing": [(0, 0), (4, 0), (4, 2), (2, 2), (2, -2)],
    "corners twice": [(0, 0), (0, 0), (1, 0), (1, 0), (1, 0), (3, 1), (3, 1)],
    "0.2 m": [(0, 0), (0.2, 0)],
    "0.1 m": [(0, 0), (0.1, 0)],
    "no length": [(0, 0), (0, 0)],
    "one corner": [(0, 0)],
}


def check_follows(tables: SearchGraph, corners: object, away: float) -> None:
    """The whole of a path is walked, whatever way the avatar faces at first."""
    path = np.array(corners, dtype=float)
    ahead = path[np.hypot(*path.T) > 0.01][:1]
    heading = float(np.arctan2(*ahead[0][::-1])) if len(ahead) else 0.0
    start = standing_at(tables.graph, (0.0, 0.0), (np.cos(heading + away), np.sin(heading + away)))
    walk = follow_sketch(tables, start, path)
    check_walk(tables, walk)
    assert walk.arrived
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    assert np.hypot(*(walk.roots[-1, :2] - path[-1])) <= min(0.25, max(0.5 * length, 0.05))
    # Who faces away at first turns round beside the path.
    assert walk.off_path.mean() < (0.3 if away else 0.2)
    assert walk.off_path.max() < 1.0
    # Every place of the path is come by, and in its order: nothing of it is left out.
    points = resampled(path, 0.1)
    if len(points) > 5:
        at = [np.hypot(*(points - root).T) <= 0.7 for root in walk.roots[:, :2]]
        done = 0
        for near in at:
            while done < len(points) and near[done]:
                done += 1
        assert done == len(points)


@pytest.mark.parametrize("away", [0.0, np.pi])
@pytest.mark.parametrize("name", PATHS)
def test_paths_of_all_kinds_are_followed(made: SearchGraph, name: str, away: float) -> None:
    check_follows(made, PATHS[name], away)


@pytest.mark.slow
@pytest.mark.mocap
@pytest.mark.parametrize("away", [0.0, 0.5 * np.pi, np.pi])
@pytest.mark.parametrize("name", PATHS)
def test_paths_of_all_kinds_are_followed_by_people(
    walker: SearchGraph, name: str, away: float
) -> None:
    check_follows(walker, PATHS[name], away)


@pytest.mark.slow
def test_a_kilometre(made: SearchGraph) -> None:
    path = [(0.0, 0.0), *((10.0 * k, 2.0 * (-1) ** k) for k in range(1, 92))]
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    assert 950.0 < length < 1000.0
    walk = follow_sketch(made, standing_at(made.graph, (0.0, 0.0), path[1]), path)
    assert walk.arrived
    assert walk.off_path.mean() < 0.15
    assert (len(walk.frames) - 1) / 15.0 / walk.planning_s > 10.0


def test_progress_is_told(straight: SearchGraph) -> None:
    told: list[tuple[str, int, int]] = []

    def tell(stage: str, done: int, of: int) -> None:
        told.append((stage, done, of))

    start = standing(straight, 0, 0, 0)
    follow_sketch(straight, start, [(0.0, 0.0), (6.0, 0.0)], progress=tell)
    assert {stage for stage, _, _ in told} == {"looking for a path through the graph"}
    done = [done for _, done, _ in told]
    assert done == sorted(done)
    assert done[0] == 0
    assert {of for _, _, of in told} == {60}
    told.clear()
    world = World((-2.0, -3.0, 9.0, 3.0), (Obstacle((3.0, 0.0), (0.3, 0.3)),))
    reach(straight, start, (6.0, 0.0), world, progress=tell)
    stages = [stage for stage, _, _ in told]
    assert stages[0] == "looking for a path between the obstacles"
    assert "found none nearby, looking farther" in stages


def test_what_makes_no_sense(straight: SearchGraph) -> None:
    start = standing(straight, 0, 0, 0)
    with pytest.raises(UsageError, match=r"points \(k, 2\)"):
        follow_sketch(straight, start, [1.0, 2.0])
    with pytest.raises(UsageError, match=r"a sketch must be points \(k, 2\), got 'abc'"):
        follow_sketch(straight, start, "abc")
    with pytest.raises(UsageError, match="two finite numbers"):
        reach(straight, start, (1.0, np.nan))
    with pytest.raises(UsageError, match="is 1001 m long; at most 1000 m"):
        reach(straight, start, (1001.0, 0.0))
    with pytest.raises(UsageError, match="is 1020 m long; at most 1000 m"):
        follow_sketch(straight, start, [(510.0, 0.0), (0.0, 0.0)])


def test_what_is_of_another_kind(straight: SearchGraph) -> None:
    start, path = standing(straight, 0, 0, 0), [(0.0, 0.0), (1.0, 0.0)]
    with pytest.raises(UsageError, match=r"SearchGraph\(graph\), got MotionGraph"):
        follow_sketch(straight.graph, start, path)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="the start must be an AvatarState"):
        follow_sketch(straight, path, start)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="the world must be a World of boxes, or None, got list"):
        follow_sketch(straight, start, path, [])  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="stop must be True or False, got dict"):
        reach(straight, start, (1.0, 0.0), None, {})  # type: ignore[arg-type]
    for wrong in (np.nan, np.inf, "a", None):
        with pytest.raises(UsageError, match="finite x, y"):
            AvatarState.at(straight.graph, start.frame, 0.0, wrong, 0.0)  # type: ignore[arg-type]
    for frame in (-1, len(straight.graph.database)):
        with pytest.raises(UsageError, match="the graph has frames 0 to"):
            AvatarState.at(straight.graph, frame, 0.0, 0.0, 0.0)
    with pytest.raises(UsageError, match="a state needs a frame"):
        AvatarState.at(straight.graph, 1.5, 0.0, 0.0, 0.0)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.mocap
def test_smooth_paths_of_20_m_in_open_ground(walker: SearchGraph) -> None:
    sketched_paths.warm_up(walker)
    followed = sketched_paths.follow_smooth_paths(walker, 50, 0)
    for one in followed:
        assert one.walk.arrived
        assert np.hypot(*(one.walk.roots[-1, :2] - one.path[-1])) <= 0.25
        assert not one.stop or walker.still[one.walk.frames[-1]]
        assert one.walk.off_path.mean() < 0.25
    for one in followed[:5]:
        check_walk(walker, one.walk)
    assert np.mean([one.walk.off_path.mean() for one in followed]) < 0.12
    assert sketched_paths.real_time_ratios([one.walk for one in followed], 15.0).min() >= 10.0


@pytest.mark.slow
@pytest.mark.mocap
@pytest.mark.parametrize("sketched", [True, False])
def test_mazes(walker: SearchGraph, sketched: bool) -> None:
    sketched_paths.warm_up(walker)
    walked = maze_walks.walk_mazes(walker, 20, 0, sketched)
    for one in walked:
        assert one.walk.arrived
        assert np.hypot(*(one.walk.roots[-1, :2] - one.maze.solution[-1])) <= 0.25
        assert maze_walks.clearance(walker.graph, walker.character, one) > 0.0
    assert sketched_paths.real_time_ratios([one.walk for one in walked], 15.0).min() >= 10.0


@pytest.mark.slow
@pytest.mark.mocap
def test_a_passage_too_narrow_to_be_walked_through_is_taken_sideways(walker: SearchGraph) -> None:
    gap = 0.58
    # Narrower than anybody is who walks facing on.
    speed = np.hypot(*walker.graph.database.velocities[:, :2].T)
    width = (walker.footprints[:, 3] - walker.footprints[:, 2])[speed > 0.6]
    assert np.percentile(width, 10) > gap
    half = 0.25 * (3.0 - gap)
    sides = [Obstacle((2.5, side * (0.5 * gap + half)), (0.06, half)) for side in (-1, 1)]
    world = World((-0.5, -1.5, 5.5, 1.5), tuple(sides))
    walk = reach(walker, standing(walker, 0.3, 0.0, 0.0), (4.7, 0.0), world)
    assert walk.arrived
    assert clearance(walker, walk, world) > 0.0
    inside = np.abs(walk.roots[:, 0] - 2.5) < 0.15
    assert inside.any()
    assert np.abs(np.sin(walk.roots[inside, 3])).min() > 0.8


@pytest.mark.slow
@pytest.mark.mocap
def test_mazes_with_narrow_passages(walker: SearchGraph) -> None:
    for seed in range(10):
        maze = random_maze(np.random.default_rng(seed), narrow=0.3)
        way = maze.solution[1] - maze.solution[0]
        start = standing(walker, *maze.solution[0], float(np.arctan2(way[1], way[0])))
        walk = reach(walker, start, maze.solution[-1], maze.world)
        assert walk.arrived
        assert clearance(walker, walk, maze.world) > 0.0


@pytest.mark.slow
@pytest.mark.mocap
def test_actions_chosen_by_warping_follow_a_sketch_too(walker: SearchGraph) -> None:
    graph = walker.graph
    chooser = SketchChooser(ClusterForest(graph, Clusters.of(graph)))
    off = []
    for seed in range(5):
        path = resampled(sketched_paths.smooth_path(np.random.default_rng(seed)), 0.1)
        heading = np.arctan2(*(path[5] - path[0])[::-1])
        start = standing(walker, 0, 0, heading)
        playback, done = Playback(graph, start.frame, start.placement), 0
        roots = [start.root(graph)[None]]
        while done < len(path) - 5:
            action = chooser.choose(playback.frame, playback.placement, path[done:])
            played = playback.play(action.frames[:15])
            roots.append(placement.compose(played.placements, graph.database.planar[played.frames]))
            done += int(np.argmin(np.hypot(*(path[done : done + 25] - roots[-1][-1, :2]).T)))
            assert len(roots) < 60
        off.append(distances_to(path, np.concatenate(roots)[:, :2]).mean())
    # It looks no farther than an action, and now and then strays.
    assert np.median(off) < 0.25
