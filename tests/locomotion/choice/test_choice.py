"""Choices: different, inside the window, playable, and there at any moment."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.choice.action_window import ActionWindow, Box, Disc
from dynresp.locomotion.choice.actions import OfferedAction, offer_actions
from dynresp.locomotion.choice.choice_control import ChoiceControl
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.blending import Playback
from dynresp.motion.character import Character, default_character
from dynresp.support.errors import UsageError
from tests.locomotion.clusters.forest_samples import random_forest
from tests.locomotion.samples import planned_graph, walking_graph
from tests.oracles import choice as slow

PLACE = np.array([3.0, -2.0, 0.0, 1.2])


@pytest.fixture(scope="module")
def walking() -> ClusterForest:
    graph = walking_graph(default_character(), sigma=0.3)
    return ClusterForest(graph, Clusters.of(graph))


@pytest.fixture(scope="module")
def made() -> ClusterForest:
    """Many clips and clusters, so that there is much to choose from."""
    return random_forest(np.random.default_rng(3), lengths=(40,) * 6, jumps=60, clusters=10)


def moments(forest: ClusterForest, count: int) -> list[int]:
    walk = random_walk(forest.graph, 7 * count, np.random.default_rng(5))
    return [int(frame) for frame in walk[::7]]


def end_of(choice: OfferedAction) -> tuple[float, ...]:
    x, y, _, yaw = choice.path[-1]
    return (x, y, np.cos(yaw), np.sin(yaw), 10.0 * choice.cluster)


def check(forest: ClusterForest, frame: int, offered: tuple[OfferedAction, ...]) -> None:
    """What every set of choices keeps to."""
    graph, clusters = forest.graph, forest.clusters
    edges = set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    for choice in offered:
        walk = [frame, *choice.frames.tolist()]
        assert choice.start == frame
        assert set(itertools.pairwise(walk)) <= edges
        assert choice.path.shape == (len(walk), 4)
        np.testing.assert_array_equal(
            clusters.labels[choice.frames[choice.entry :]], choice.cluster
        )
        assert choice.example == clusters.examples[choice.cluster]
        assert choice.log_probability <= 0.0
    assert len({end_of(choice) for choice in offered}) == len(offered)


def test_choices_are_different_and_can_be_walked(made: ClusterForest) -> None:
    counts = []
    for frame in moments(made, 100):
        offered = offer_actions(made, frame, PLACE)
        check(made, frame, offered)
        counts.append(len(offered))
    assert min(counts) >= 3
    assert max(counts) == 4


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["usual", "soon", "here"])
def test_choices_are_the_slow_ones(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    coordinates = list(Coordinates)[seed % 3]
    forest = random_forest(
        rng, lengths=(25,) * 3, jumps=int(rng.integers(2, 30)), clusters=6, coordinates=coordinates
    )
    for frame in rng.choice(forest.graph.frames, 4).tolist():
        planar = forest.graph.database.planar[frame]
        x, y = placement.compose(PLACE, planar)[:2]
        window = {
            "usual": ActionWindow(),
            "soon": ActionWindow(count=6, earliest_s=0.5, latest_s=2.5),
            "here": ActionWindow(area=Disc(x, y, 1.0)),
        }[kind]
        offered = offer_actions(forest, frame, PLACE, window)
        expected = slow.offer_actions(forest, frame, PLACE, window)
        assert [[frame, *c.frames.tolist()] for c in offered] == [frames for frames, _ in expected]
        for choice, (_, states) in zip(offered, expected, strict=True):
            np.testing.assert_allclose(choice.path[:, :3], states[:, :3], atol=1e-9)
            turned = placement.wrapped(choice.path[:, 3] - states[:, 3])
            np.testing.assert_allclose(turned, 0.0, atol=1e-9)


def test_as_many_as_the_window_says_are_offered(made: ClusterForest) -> None:
    frame = int(made.graph.frames[20])
    for count in (1, 2, 6):
        assert len(offer_actions(made, frame, PLACE, ActionWindow(count=count))) == count


def test_they_are_the_same_every_time(made: ClusterForest) -> None:
    frame = int(made.graph.frames[33])
    first, again = (offer_actions(made, frame, PLACE) for _ in range(2))
    assert [c.frames.tolist() for c in first] == [c.frames.tolist() for c in again]


def test_the_window_in_time_is_kept(made: ClusterForest) -> None:
    some = 0
    for frame in moments(made, 60):
        offered = offer_actions(made, frame, PLACE, ActionWindow(earliest_s=1.0, latest_s=2.0))
        check(made, frame, offered)
        for choice in offered:
            assert choice.entry + 1 >= 15
            assert len(choice.frames) <= 30
        some += len(offered)
    assert some > 0


@pytest.mark.parametrize("kind", ["disc", "box"])
def test_the_window_in_space_is_kept(kind: str, made: ClusterForest) -> None:
    some = 0
    for frame in moments(made, 60):
        x, y = placement.compose(PLACE, made.graph.database.planar[frame])[:2]
        area = Disc(x, y + 0.5, 0.5) if kind == "disc" else Box((x, y), (x + 1.0, y + 1.0))
        offered = offer_actions(made, frame, PLACE, ActionWindow(area=area))
        check(made, frame, offered)
        for choice in offered:
            assert area.contains(choice.path[-1:, :2]).all()
        some += len(offered)
    assert some > 0


def test_nothing_is_offered_out_of_reach(made: ClusterForest) -> None:
    window = ActionWindow(area=Disc(1000.0, 0.0, 1.0))
    assert offer_actions(made, int(made.graph.frames[0]), PLACE, window) == ()


def test_the_path_is_where_the_avatar_will_be(walking: ClusterForest) -> None:
    for frame in moments(walking, 20):
        for choice in offer_actions(walking, frame, PLACE):
            played = Playback(walking.graph, frame, PLACE).play(choice.frames)
            planar = walking.graph.database.planar[choice.frames]
            expected = placement.compose(played.placements, planar)
            np.testing.assert_allclose(choice.path[1:, :3], expected[:, :3], atol=1e-9)


def test_the_pose_stands_where_the_action_ends(walking: ClusterForest) -> None:
    frame = int(walking.graph.frames[4])
    for choice in offer_actions(walking, frame, PLACE):
        shown = placement.of_poses(choice.pose[None])[0]
        example = walking.graph.database.planar[choice.example]
        np.testing.assert_allclose(shown[:2], choice.path[-1, :2], atol=1e-9)
        assert shown[2] == pytest.approx(example[2])
        assert abs(placement.wrapped(shown[3] - choice.path[-1, 3])) < 1e-9


def test_in_fixed_coordinates_the_pose_stands_where_it_was_recorded() -> None:
    forest = random_forest(
        np.random.default_rng(3),
        lengths=(40,) * 6,
        jumps=60,
        clusters=10,
        coordinates=Coordinates.FIXED,
    )
    offered = offer_actions(forest, int(forest.graph.frames[7]))
    assert offered
    for choice in offered:
        np.testing.assert_array_equal(choice.pose, forest.graph.database.poses[choice.example])


def test_a_frame_outside_the_graph_is_refused(made: ClusterForest) -> None:
    with pytest.raises(UsageError, match="not in the graph"):
        offer_actions(made, 10**6)


@pytest.mark.parametrize(
    ("name", "value"), [("count", 0), ("earliest_s", -1.0), ("latest_s", 0.1), ("latest_s", np.nan)]
)
def test_windows_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(UsageError, match=name):
        ActionWindow(**{name: value})  # type: ignore[arg-type]


def test_the_avatar_does_what_was_chosen_and_then_walks_on(made: ClusterForest) -> None:
    frame = int(made.graph.frames[10])
    control = ChoiceControl(made.graph, frame, np.random.default_rng(0))
    choice = offer_actions(made, frame)[1]
    control.take(choice)
    assert control.is_acting
    played = [control.advance(2) for _ in range(len(choice.frames))]
    walk = np.concatenate([[frame], *played])
    np.testing.assert_array_equal(walk[1 : len(choice.frames) + 1], choice.frames)
    assert not control.is_acting
    assert control.frame == walk[-1]
    graph = made.graph
    edges = set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    assert set(itertools.pairwise(walk.tolist())) <= edges


def test_a_choice_can_be_taken_a_little_late(made: ClusterForest) -> None:
    frame = int(made.graph.frames[10])
    choice = offer_actions(made, frame)[0]
    control = ChoiceControl(made.graph, int(choice.frames[1]), np.random.default_rng(0))
    control.take(choice)
    np.testing.assert_array_equal(control.advance(1), choice.frames[2:3])


def test_a_choice_offered_elsewhere_is_refused(made: ClusterForest) -> None:
    choice = offer_actions(made, int(made.graph.frames[10]))[0]
    elsewhere = next(
        int(f) for f in made.graph.frames if f not in choice.frames and f != choice.start
    )
    control = ChoiceControl(made.graph, elsewhere, np.random.default_rng(0))
    with pytest.raises(UsageError, match="call offer_actions"):
        control.take(choice)
    with pytest.raises(UsageError, match="at least 1 frame"):
        control.advance(0)


@pytest.mark.mocap
@pytest.mark.slow
@pytest.mark.parametrize("plan", ["walking", "playground"])
def test_three_at_ten_thousand_moments(
    plan: str, motions_folder: Path, character: Character
) -> None:
    graph = planned_graph(plan, motions_folder, character)
    forest = ClusterForest(graph, Clusters.of(graph))
    walk = random_walk(graph, 10_000, np.random.default_rng(1))
    offered = (offer_actions(forest, frame) for frame in walk.tolist())
    assert min(len({end_of(choice) for choice in some}) for some in offered) >= 3
