from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from dynresp.errors import DynrespError, UsageError
from dynresp.locomotion.clusters.forest import ClusterForest
from dynresp.locomotion.clusters.grouping import Clusters
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.sketch.cluster_paths import SketchChooser
from dynresp.locomotion.sketch.following import (
    SketchConfig,
    SketchedWalk,
    distances_to,
    follow_sketch,
    reach,
)
from dynresp.locomotion.sketch.search import SearchGraph, State
from dynresp.locomotion.worlds.maze import Maze, MazeConfig, random_maze
from dynresp.locomotion.worlds.obstacles import Obstacle, World, body_clearances
from dynresp.locomotion.worlds.planning import resampled
from dynresp.motion.character import default_character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.rotations import FloatArray
from tests.locomotion.samples import walking_graph


@pytest.fixture(scope="module")
def straight() -> SearchGraph:
    """The built-in walk: it can only go straight on."""
    return SearchGraph(walking_graph(default_character(), sigma=0.3))


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


def standing(tables: SearchGraph, x: float, y: float, yaw: float) -> State:
    frames = np.flatnonzero(tables.still) if tables.still.any() else tables.graph.frames
    return State.at(tables.graph, int(frames[len(frames) // 3]), x, y, yaw)


def smooth_path(rng: np.random.Generator) -> FloatArray:
    """20 m with random bends of more than a metre's radius."""
    steps = 400
    bend = gaussian_filter1d(rng.normal(0.0, 1.0, steps + 200), 30)[100:-100]
    bend *= 0.8 * rng.random() / np.abs(bend).max()
    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(bend) * 20.0 / steps
    ways = np.stack([np.cos(heading), np.sin(heading)], axis=1) * 20.0 / steps
    return np.concatenate([[(0.0, 0.0)], np.cumsum(ways, axis=0)])


def rough_sketch(rng: np.random.Generator, maze: Maze, noise_m: float = 0.3) -> FloatArray:
    """A wavering line along the solution of a maze, which may cut its walls."""
    corners = resampled(maze.solution, 0.9)
    moved = corners + rng.normal(0.0, noise_m, corners.shape)
    moved[[0, -1]] = corners[[0, -1]]
    return CubicSpline(np.arange(len(moved)), moved)(np.linspace(0, len(moved) - 1, 200))


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
    with pytest.raises(DynrespError, match="no way"):
        reach(straight, start, (6.0, 0.0), closed)


def test_what_makes_no_sense(straight: SearchGraph) -> None:
    with pytest.raises(UsageError, match="horizon_m must be above 0"):
        SketchConfig(horizon_m=0.0)
    start = standing(straight, 0, 0, 0)
    with pytest.raises(UsageError, match=r"points \(k, 2\)"):
        follow_sketch(straight, start, [1.0, 2.0])
    with pytest.raises(UsageError, match="a goal must be two finite numbers"):
        reach(straight, start, (1.0, np.nan))


def test_distances_to_a_path() -> None:
    path = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])
    points = np.array([(-1.0, 0.0), (1.0, 0.5), (2.5, 1.0), (1.0, 3.0)])
    np.testing.assert_allclose(distances_to(path, points), [1.0, 0.5, 0.5, np.sqrt(2.0)])


@pytest.mark.slow
@pytest.mark.mocap
def test_smooth_paths_of_20_m_in_open_ground(walker: SearchGraph) -> None:
    off, ratios = [], []
    for seed in range(50):
        path = smooth_path(np.random.default_rng(seed))
        heading = np.arctan2(*(path[5] - path[0])[::-1])
        stop = seed % 2 == 1
        walk = follow_sketch(
            walker, standing(walker, 0, 0, heading), path, config=SketchConfig(stop=stop)
        )
        assert walk.arrived
        assert np.hypot(*(walk.roots[-1, :2] - path[-1])) <= 0.25
        assert not stop or walker.still[walk.frames[-1]]
        if seed < 5:
            check_walk(walker, walk)
        off.append(walk.off_path.mean())
        ratios.append(len(walk.frames) / 15.0 / walk.planning_s)
    assert np.max(off) < 0.25
    assert np.mean(off) < 0.12
    # A busy machine takes longer; usually it is some hundred times real time.
    assert np.median(ratios) > 20.0


@pytest.mark.slow
@pytest.mark.mocap
@pytest.mark.parametrize("sketched", [True, False])
def test_mazes(walker: SearchGraph, sketched: bool) -> None:
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        maze = random_maze(rng)
        sketch = rough_sketch(rng, maze)
        way = maze.solution[1] - maze.solution[0]
        start = standing(walker, *maze.solution[0], float(np.arctan2(way[1], way[0])))
        if sketched:
            walk = follow_sketch(walker, start, sketch, maze.world)
        else:
            walk = reach(walker, start, maze.solution[-1], maze.world)
        assert walk.arrived
        assert np.hypot(*(walk.roots[-1, :2] - maze.solution[-1])) <= 0.25
        assert clearance(walker, walk, maze.world) > 0.0
        ratios.append(len(walk.frames) / 15.0 / walk.planning_s)
    assert np.median(ratios) > 20.0


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
        maze = random_maze(np.random.default_rng(seed), MazeConfig(narrow=0.3))
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
        path = resampled(smooth_path(np.random.default_rng(seed)), 0.1)
        heading = np.arctan2(*(path[5] - path[0])[::-1])
        start = standing(walker, 0, 0, heading)
        playback, done = Playback(graph, start.frame, start.placement), 0
        roots = [start.root(graph)[None]]
        while done < len(path) - 5:
            action = chooser.choose(playback.frame, playback.place, path[done:])
            played = playback.play(action.frames[:15])
            roots.append(placement.compose(played.placements, graph.database.planar[played.frames]))
            done += int(np.argmin(np.hypot(*(path[done : done + 25] - roots[-1][-1, :2]).T)))
            assert len(roots) < 60
        off.append(distances_to(path, np.concatenate(roots)[:, :2]).mean())
    # It looks no farther than an action, and now and then strays.
    assert np.median(off) < 0.25
