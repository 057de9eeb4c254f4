import numpy as np
import pytest

from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.sketch import path_search
from dynresp.locomotion.sketch.path_search import FoundPath, SearchGraph
from dynresp.locomotion.worlds.collisions import CollisionGrid
from dynresp.locomotion.worlds.obstacles import Obstacle, World
from dynresp.locomotion.worlds.paths import resampled
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError
from tests.locomotion.graph.graph_samples import made_database
from tests.locomotion.samples import walking_graph
from tests.oracles import search as oracle

SPACING = 0.1
CONFIG = GraphConfig(contact_change=False, sigma=3.0, slip_m=100.0)


def made_graph(seed: int) -> MotionGraph:
    """Wandering roots: steps of 5 cm to all sides, a jump every few frames."""
    return MotionGraph.from_database(
        made_database(np.random.default_rng(seed), (40, 30, 25)), CONFIG
    )


def search(
    tables: SearchGraph,
    start: AvatarState,
    path: FloatArray,
    target: float,
    budget: int = 400,
    crowded: int = 12,
    world: World | None = None,
) -> FoundPath:
    grid = None if world is None else CollisionGrid.of(world, tables.reach_m + 0.5)
    facing = np.full(len(path), 0.2)
    return tables.search(start, path, facing, SPACING, 0.0, target, budget, crowded, grid)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("boxes", [False, True])
def test_it_equals_its_slow_twin(
    seed: int, boxes: bool, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng([seed, 5])
    graph = made_graph(seed)
    tables = SearchGraph(graph, character)
    start = AvatarState.at(graph, int(rng.choice(graph.frames)), 0.0, 0.0, 0.3)
    path = resampled([(0, 0), (0.6, 0.2), rng.uniform(0.5, 2.5, 2)], SPACING)
    target = rng.uniform(3.0, len(path) - 1.0)
    world = None
    if boxes:
        turns = rng.uniform(-3.0, 3.0, 6)
        blocks = [
            Obstacle((1.8 * np.cos(a), 1.8 * np.sin(a)), (0.2, 0.3), b)
            for a, b in zip(turns, turns[::-1], strict=True)
        ]
        world = World((-3.0, -3.0, 3.0, 3.0), tuple(blocks))
    monkeypatch.setattr(path_search, "STRAY", 3.0)
    monkeypatch.setattr(path_search, "JUMP", 0.3)
    found = search(tables, start, path, target, 150, 3, world)
    twin = oracle.Search(graph, character, path, np.full(len(path), 0.2), SPACING, target, world, 3)
    frames, arrived, looked = twin.run(start, 0.0, 150)
    assert (found.arrived, found.looked) == (arrived, looked)
    assert found.frames.tolist() == frames


@pytest.mark.parametrize("seed", range(4))
def test_it_equals_its_slow_twin_on_paths_that_turn_back(
    seed: int, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng([seed, 9])
    graph = made_graph(seed)
    tables = SearchGraph(graph, character)
    start = AvatarState.at(graph, int(rng.choice(graph.frames)), 0.0, 0.0, 0.3)
    path = resampled([(0, 0), (0.7, 0.1), (0.7, 0.1), (0, 0), rng.uniform(-0.5, 0.5, 2)], SPACING)
    monkeypatch.setattr(path_search, "STRAY", 3.0)
    monkeypatch.setattr(path_search, "JUMP", 0.3)
    target = len(path) - 1.5
    found = search(tables, start, path, target, 150, 3)
    facing = np.full(len(path), 0.2)
    twin = oracle.Search(graph, character, path, facing, SPACING, target, None, 3)
    frames, arrived, looked = twin.run(start, 0.0, 150)
    assert (found.arrived, found.looked) == (arrived, looked)
    assert found.frames.tolist() == frames
    assert (np.diff(found.progress) >= 0.0).all()


@pytest.mark.parametrize("aside", [0.32, 0.36, 0.4])
def test_a_walk_between_boxes_equals_its_slow_twin(aside: float, character: Character) -> None:
    graph = walking_graph(character, sigma=0.3)
    tables = SearchGraph(graph, character)
    start = AvatarState.at(graph, int(graph.frames[0]), 0.0, 0.0, 0.0)
    path = resampled([(0.0, 0.0), (3.0, 0.1)], SPACING)
    boxes = [Obstacle((1.5, side * (aside + 0.5)), (0.2, 0.5)) for side in (-1, 1)]
    world = World((-2.0, -2.0, 6.0, 2.0), tuple(boxes))
    found = search(tables, start, path, 25.0, 80, 3, world)
    facing = np.full(len(path), 0.2)
    twin = oracle.Search(graph, character, path, facing, SPACING, 25.0, world, 3)
    frames, arrived, looked = twin.run(start, 0.0, 80)
    assert (found.arrived, found.looked) == (arrived, looked)
    assert found.frames.tolist() == frames


def test_what_is_found_can_be_walked_and_is_placed_as_it_is_played(character: Character) -> None:
    graph = made_graph(1)
    start = AvatarState.at(graph, int(graph.frames[3]), 0.5, -0.2, 1.0)
    assert start.root(graph)[[0, 1, 3]] == pytest.approx([0.5, -0.2, 1.0])
    path = resampled([(0.5, -0.2), (1.5, 0.6)], SPACING)
    found = search(SearchGraph(graph, character), start, path, 8.0)
    before = np.concatenate([[start.frame], found.frames[:-1]])
    ways = set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    assert set(zip(before.tolist(), found.frames.tolist(), strict=True)) <= ways
    played = Playback(graph, start.frame, start.placement).play(found.frames)
    np.testing.assert_allclose(found.placements, played.placements, atol=1e-9)
    assert (np.diff(found.joints) > 0).all()
    assert found.joints[-1] == len(found.frames) - 1


@pytest.mark.parametrize("ahead_m", [1e18, 1e300])
def test_the_point_to_face_may_be_any_distance_away(
    ahead_m: float, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond the end of the path it is the end that is faced; integers do not reach so far."""
    graph = made_graph(1)
    tables = SearchGraph(graph, character)
    start = AvatarState.at(graph, int(graph.frames[3]), 0.0, 0.0, 0.3)
    path = resampled([(0.0, 0.0), (1.0, 0.6)], SPACING)
    monkeypatch.setattr(path_search, "AHEAD_M", 100.0)
    expected = search(tables, start, path, 8.0)
    monkeypatch.setattr(path_search, "AHEAD_M", ahead_m)
    found = search(tables, start, path, 8.0)
    assert len(found.frames) > 0
    assert found.frames.tolist() == expected.frames.tolist()


def test_it_goes_on_where_blends_were_left(character: Character) -> None:
    """What is left of blends at a joint is what a playback has there."""
    graph = made_graph(2)
    tables = SearchGraph(graph, character)
    world = World((-4.0, -4.0, 4.0, 4.0))
    start = AvatarState.at(graph, int(graph.frames[0]), 0.0, 0.0, 0.0)
    path = resampled([(0.0, 0.0), (2.0, 0.0)], SPACING)
    found = search(tables, start, path, 10.0, world=world)
    middle = len(found.joints) // 2
    at = int(found.joints[middle])
    state = AvatarState(int(found.frames[at]), found.placements[at], found.displacements[middle])
    whole = Playback(graph, start.frame, start.placement)
    whole.play(found.frames[: at + 1])
    rest = search(tables, state, path, 10.0, world=world, budget=1)
    again = search(
        tables, AvatarState(whole.frame, whole.placement, found.displacements[middle]), path, 10.0,
        world=world, budget=1,
    )  # fmt: skip
    np.testing.assert_array_equal(rest.frames, again.frames)
    np.testing.assert_allclose(rest.placements, again.placements, atol=1e-9)


def test_a_built_in_walk_goes_straight_on(character: Character) -> None:
    graph = walking_graph(character, sigma=0.3)
    tables = SearchGraph(graph, character)
    start = AvatarState.at(graph, int(graph.frames[0]), 0.0, 0.0, 0.0)
    path = resampled([(0.0, 0.0), (3.0, 0.0)], SPACING)
    found = search(tables, start, path, 25.0)
    assert found.arrived
    assert found.progress[-1] >= 25.0
    # A wall across the way, and there is none.
    wall = World((-2.0, -2.0, 6.0, 2.0), (Obstacle((1.5, 0.0), (0.1, 2.0)),))
    stuck = search(tables, start, path, 25.0, world=wall)
    assert not stuck.arrived
    assert stuck.collided > 0


def test_frames_that_only_go_on_end_where_ways_part(character: Character) -> None:
    graph = made_graph(3)
    tables = SearchGraph(graph, character)
    inside = np.diff(graph.offsets) > 0
    assert (tables.ends[~inside] == -1).all()
    for frame in graph.frames:
        expected = oracle.Search.frames(_Only(graph), 0, int(frame))[-1]  # type: ignore[arg-type]
        assert tables.ends[frame] == expected


class _Only:
    def __init__(self, graph: MotionGraph) -> None:
        self.graph = graph


def test_a_start_outside_the_graph_is_refused(character: Character) -> None:
    graph = made_graph(0)
    tables = SearchGraph(graph, character)
    nowhere = AvatarState(len(graph.database), np.zeros(4))
    with pytest.raises(UsageError, match="component"):
        search(tables, nowhere, np.array([(0.0, 0.0), (0.1, 0.0)]), 1.0)
