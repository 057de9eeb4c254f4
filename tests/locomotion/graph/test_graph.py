from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.locomotion.graph import placement, pruning
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.frame_distance import JOINT_WEIGHTS
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph, feet_stay_planted
from dynresp.locomotion.graph.pruning import Jumps, find_jumps
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionError, UsageError
from tests.locomotion.graph.graph_samples import made_database
from tests.locomotion.samples import walking_graph, walking_motions
from tests.oracles import motion_graph as oracle

# Made frames are no people: their feet are anywhere.
SLIPPING: dict[str, float] = {"slip_m": 100.0}
ARRAYS = ("offsets", "targets", "distances")


def is_jump(graph: MotionGraph) -> np.ndarray:
    """(m,) which ways are not recorded ones."""
    return graph.database.successors[graph.sources] != graph.targets


def check_rows(graph: MotionGraph) -> None:
    """What every graph must be."""
    n, offsets = len(graph.database), graph.offsets
    assert (offsets[0], offsets[-1], len(offsets)) == (0, len(graph.targets), n + 1)
    assert (np.diff(offsets) >= 0).all()
    assert len(graph.distances) == len(graph.probabilities) == len(graph.targets)
    inside = np.diff(offsets) > 0
    np.testing.assert_array_equal(graph.frames, np.flatnonzero(inside))
    # No dead end: every target has a transition.
    assert inside[graph.targets].all()
    jumps = is_jump(graph)
    own = graph.database.successors
    for frame in graph.frames:
        row = slice(offsets[frame], offsets[frame + 1])
        others = graph.targets[row][jumps[row]]
        recorded = own[frame] >= 0 and inside[own[frame]]
        expected = [own[frame], *sorted(others)] if recorded else sorted(others)
        np.testing.assert_array_equal(graph.targets[row], expected)
        assert len(set(others.tolist())) == len(others)
        assert graph.probabilities[row].sum() == pytest.approx(1.0, abs=1e-12)
        assert (np.diff(graph.cumulative[row]) >= 0).all()
        assert graph.cumulative[row][-1] == 1.0
    assert (graph.distances[~jumps] == 0).all()
    assert (graph.distances[jumps] <= np.float32(graph.config.max_distance)).all()
    assert graph.counts.component == np.count_nonzero(jumps)
    assert graph.counts.component_frames == len(graph.frames)
    assert (graph.counts.frames, graph.counts.pairs) == (n, n * n)
    for name in (*ARRAYS, "sources", "probabilities", "cumulative", "frames", "placements"):
        assert not getattr(graph, name).flags.writeable


def rows_of(graph: MotionGraph) -> dict[int, dict[int, float]]:
    """Probabilities as the slow twin has them."""
    rows: dict[int, dict[int, float]] = {int(frame): {} for frame in graph.frames}
    ways = zip(graph.sources.tolist(), graph.targets.tolist(), graph.probabilities, strict=True)
    for source, target, probability in ways:
        rows[source][target] = probability
    return rows


def check_twin(graph: MotionGraph, jumps: list[tuple[int, int, float]]) -> None:
    expected, found = oracle.graph(graph.database, jumps, graph.config), rows_of(graph)
    assert found.keys() == expected.keys()
    for frame, row in expected.items():
        assert found[frame] == pytest.approx(row, rel=1e-9)


@pytest.mark.parametrize("coordinates", list(Coordinates))
@pytest.mark.parametrize("contact_change", [True, False])
@settings(max_examples=6)
@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_its_slow_twin(coordinates: Coordinates, contact_change: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    database = made_database(rng, (25, 4, 20), alike=0.1)
    config = GraphConfig(
        coordinates=coordinates, contact_change=contact_change, sigma=0.4, **SLIPPING
    )
    found = find_jumps(database, config)
    jumps = list(
        zip(*(x.tolist() for x in (found.sources, found.targets, found.distances)), strict=True)
    )
    try:
        graph = MotionGraph.from_database(database, config)
    except MotionError:
        assert not oracle.graph(database, jumps, config)
        return
    check_rows(graph)
    check_twin(graph, jumps)
    left = (graph.counts.contact, graph.counts.likelihood, graph.counts.similarity)
    assert left == (found.contact, found.likelihood, found.similarity)


@pytest.mark.parametrize("coordinates", list(Coordinates))
def test_feet_that_would_slip_through_a_blend(
    coordinates: Coordinates, character: Character
) -> None:
    database = made_database(np.random.default_rng(21), (60, 50), alike=0.1)
    # Feet that stand for long, and clips that end meanwhile.
    contacts = np.arange(110)[:, None] % [23, 31] < [17, 22]
    database = replace(database, contacts=contacts)
    config = GraphConfig(
        coordinates=coordinates, contact_change=False, local_maxima=False, sigma=1.0, slip_m=0.1,
        blend_s=0.5,
    )  # fmt: skip
    found = find_jumps(database, config)
    kept = feet_stay_planted(database, config, character, found.sources, found.targets)
    expected = [
        oracle.feet_stay_planted(database, int(i), int(j), config, character)
        for i, j in zip(found.sources, found.targets, strict=True)
    ]
    np.testing.assert_array_equal(kept, expected)
    assert 10 < np.count_nonzero(kept) < len(kept) - 10


def test_the_component_of_any_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ways at random, few enough that components of all shapes come about, some of one size."""
    rng = np.random.default_rng(6)
    database = made_database(rng, (7, 1, 9, 2, 6))
    firsts = {clip.start for clip in database.clips}
    enterable = [frame for frame in range(len(database)) if frame not in firsts]
    sizes = set()
    for _ in range(60):
        pairs = {
            (int(i), int(j))
            for i, j in zip(
                rng.integers(len(database), size=5), rng.choice(enterable, 5), strict=True
            )
            if i != j and database.successors[i] != j
        }
        ways = np.array(sorted(pairs), dtype=np.int32).reshape(-1, 2)
        distances = rng.uniform(0.0, 0.1, len(ways)).astype(np.float32)
        given_ways = Jumps(
            ways[:, 0].copy(), ways[:, 1].copy(), distances, len(ways), len(ways), None
        )
        monkeypatch.setattr(pruning, "find_jumps", lambda *_, found=given_ways: found)
        jumps = [(int(i), int(j), float(d)) for (i, j), d in zip(ways, distances, strict=True)]
        try:
            graph = MotionGraph.from_database(database, GraphConfig(**SLIPPING))
        except MotionError:
            assert not oracle.graph(database, jumps, GraphConfig())
            continue
        check_rows(graph)
        check_twin(graph, jumps)
        sizes.add(len(graph.frames))
    assert len(sizes) > 6


def test_a_graph_of_motions(character: Character) -> None:
    motions = walking_motions(character)
    graph = MotionGraph.build(motions, credit_lines=("to me",))
    check_rows(graph)
    database = graph.database
    assert [clip.name for clip in database.clips] == [motion.name for motion in motions]
    for number, motion in enumerate(motions):
        np.testing.assert_array_equal(database.motion(number).poses, motion.resampled(15.0).poses)
    assert database.credits == ("to me",)
    assert database.character == character.identity


def test_the_order_of_motions_changes_nothing_else(character: Character) -> None:
    motions = walking_motions(character)[:3]
    one, other = MotionGraph.build(motions), MotionGraph.build(motions[::-1])
    place = {clip.name: clip.start for clip in other.database.clips}
    moved = np.concatenate(
        [place[clip.name] + np.arange(clip.stop - clip.start) for clip in one.database.clips]
    )
    np.testing.assert_array_equal(other.database.poses[moved], one.database.poses)

    def ways(graph: MotionGraph, names: np.ndarray) -> dict[tuple[int, int], float]:
        pairs = zip(names[graph.sources].tolist(), names[graph.targets].tolist(), strict=True)
        return dict(zip(pairs, graph.probabilities.tolist(), strict=True))

    assert ways(other, np.arange(len(moved))) == pytest.approx(ways(one, moved), rel=1e-3)


def test_threads_change_no_bit() -> None:
    database = made_database(np.random.default_rng(9), (300, 2, 250), alike=0.1)
    config = GraphConfig(contact_change=False, sigma=0.4, **SLIPPING)
    graphs = [MotionGraph.from_database(database, config, threads=n) for n in (1, 2, 5, 0)]
    assert graphs[0].counts.component > 100
    for graph in graphs[1:]:
        assert graph.counts == graphs[0].counts
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(graph, name), getattr(graphs[0], name))


class TestPlacements:
    @pytest.mark.parametrize("coordinates", list(Coordinates))
    def test_what_is_left_between_frames_laid_over_each_other_is_their_distance(
        self, coordinates: Coordinates
    ) -> None:
        """Placements and distances are of one mind on how a frame is laid over another."""
        database = made_database(np.random.default_rng(11), (120, 120, 120), alike=0.1)
        config = GraphConfig(coordinates=coordinates, sigma=0.4, **SLIPPING)
        graph = MotionGraph.from_database(database, config)
        fixed = replace(config, coordinates=Coordinates.FIXED)
        jumps = np.flatnonzero(is_jump(graph))
        assert len(jumps) > 10
        for jump in jumps[:: max(1, len(jumps) // 60)]:
            left, entered = graph.sources[jump], graph.targets[jump]
            x, y, z, yaw = graph.placements[jump]
            laid = oracle.moved(
                database.poses[entered - 1], database.velocities[entered - 1], yaw, [x, y, z]
            )
            other = database.poses[left], database.velocities[left]
            between = oracle.distance(other, laid, tuple(JOINT_WEIGHTS), fixed)
            assert between == pytest.approx(graph.distances[jump], rel=1e-4, abs=1e-5)

    def test_the_frame_before_is_laid_exactly_over_the_frame_left(
        self, character: Character
    ) -> None:
        graph = walking_graph(character, sigma=0.3)
        jumps = is_jump(graph)
        planar, placements = graph.database.planar, graph.placements[jumps]
        laid = placement.compose(placements, planar[graph.targets[jumps] - 1])
        left = planar[graph.sources[jumps]]
        np.testing.assert_allclose(laid[:, :2], left[:, :2], atol=1e-12)
        np.testing.assert_allclose(placement.wrapped(laid[:, 3] - left[:, 3]), 0.0, atol=1e-12)
        # Nobody is lifted.
        assert (placements[:, 2] == 0).all()
        assert np.abs(placements[:, [0, 1, 3]]).max() > 0.5

    @pytest.mark.parametrize("coordinates", list(Coordinates))
    def test_recorded_ways_move_no_clip(self, coordinates: Coordinates) -> None:
        database = made_database(np.random.default_rng(11), (120, 120, 120), alike=0.1)
        graph = MotionGraph.from_database(
            database, GraphConfig(coordinates=coordinates, sigma=0.4, **SLIPPING)
        )
        assert (graph.placements[~is_jump(graph)] == 0).all()

    def test_fixed_clips_stay(self) -> None:
        database = made_database(np.random.default_rng(11), (120, 120, 120), alike=0.1)
        graph = MotionGraph.from_database(
            database, GraphConfig(coordinates=Coordinates.FIXED, sigma=0.4, **SLIPPING)
        )
        assert is_jump(graph).any()
        assert (graph.placements == 0).all()

    def test_on_blocks_they_move_by_whole_blocks_and_quarter_turns(self) -> None:
        database = made_database(np.random.default_rng(3), (60, 60, 60), alike=0.1)
        # The same once more, a quarter turn and some blocks away, and a little beside.
        config = GraphConfig(coordinates=Coordinates.BLOCKS, sigma=0.4, **SLIPPING)
        away = np.array([3 * config.block_m, -config.block_m, config.block_height_m, np.pi / 2])
        beside = away + np.array([0.02, -0.01, 0.01, 0.03])
        poses = np.concatenate([database.poses, placement.place_poses(database.poses, beside)])
        n = len(database)
        clips = [replace(clip, start=clip.start + n, stop=clip.stop + n) for clip in database.clips]
        contacts = np.tile(database.contacts, (2, 1))
        graph = MotionGraph.from_database(
            MotionDatabase(poses, contacts, 15.0, (*database.clips, *clips), ""), config
        )
        over = is_jump(graph) & (graph.sources < n) & (graph.targets == graph.sources + n + 1)
        assert over.any()
        back = np.broadcast_to(placement.inverse(away), (over.sum(), 4))
        np.testing.assert_allclose(graph.placements[over], back, atol=1e-9)
        cell = [config.block_m, config.block_m, config.block_height_m, np.pi / 2]
        blocks = graph.placements / cell
        np.testing.assert_allclose(blocks, np.round(blocks), atol=1e-9)

    def test_between_any_frames(self, character: Character) -> None:
        graph = walking_graph(character, sigma=0.3)
        own = graph.placements_between(graph.sources, graph.targets)
        np.testing.assert_array_equal(own, graph.placements)
        assert graph.placements_between(graph.sources[:0], graph.targets[:0]).shape == (0, 4)


def marching(character: Character, seed: int) -> Motion:
    """Six seconds on the spot, foot after foot, never quite the same."""
    rng = np.random.default_rng(seed)
    frame = np.arange(96)
    poses = np.tile(character.rest_pose, (96, 1))
    wave = np.sin(2.0 * np.pi * frame / 16.0)
    turns = rng.normal(0.0, 0.01, (96, 13, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turns[:, character.joint_names.index(f"{side}_hip"), 1] -= np.maximum(sign * wave, 0.0)
    quaternions = rotations.multiply(
        poses[:, 7:].reshape(96, 13, 4), rotations.from_rotation_vector(turns)
    )
    poses[:, 7:] = quaternions.reshape(96, -1)
    return Motion(poses, 15.0, "marching", np.stack([wave <= 0.1, wave >= -0.1], axis=1))


def test_copies_elsewhere_are_joined_in_relative_coordinates_alone(character: Character) -> None:
    motion, there = marching(character, 1), marching(character, 2).placed(4.0, -3.0, 1.2)
    relative = MotionGraph.build([motion, there], GraphConfig(), character)
    fixed = MotionGraph.build(
        [motion, there], GraphConfig(coordinates=Coordinates.FIXED), character
    )
    clips = relative.database.clip_of
    for graph, joined in ((relative, True), (fixed, False)):
        check_rows(graph)
        assert (clips[graph.sources] != clips[graph.targets]).any() == joined
        assert is_jump(graph).any()
    # All that fixed coordinates allow is allowed in relative ones.
    pairs = [
        set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
        for graph in (fixed, relative)
    ]
    assert pairs[0] < pairs[1]


def test_a_mirrored_graph_is_its_own_mirror_image(character: Character) -> None:
    motion = marching(character, 3)
    graph = MotionGraph.build([motion], GraphConfig(mirrored=True), character)
    check_rows(graph)
    n = len(motion)
    assert len(graph.database) == 2 * n
    np.testing.assert_allclose(graph.database.poses[n:], character.mirror(motion.poses))
    ways = dict(
        zip(
            zip(graph.sources.tolist(), graph.targets.tolist(), strict=True),
            graph.probabilities.tolist(), strict=True,
        )
    )  # fmt: skip
    mirrored = {((i + n) % (2 * n), (j + n) % (2 * n)): p for (i, j), p in ways.items()}
    assert mirrored == pytest.approx(ways, rel=1e-3)
    clips = graph.database.clip_of
    assert (clips[graph.sources] != clips[graph.targets]).any()


class TestErrors:
    def test_frame_rates_must_agree(self) -> None:
        database = made_database(np.random.default_rng(1), (30, 30))
        with pytest.raises(MotionError, match=r"15 fps and the configuration 30; gather"):
            MotionGraph.from_database(database, GraphConfig(fps=30.0))

    def test_a_way_must_be_left(self, character: Character) -> None:
        database = made_database(np.random.default_rng(1), (30, 30))
        with pytest.raises(MotionError, match="no frame resembles another enough"):
            MotionGraph.from_database(database, GraphConfig(sigma=1e-9))
        with pytest.raises(MotionError, match="Give more motion"):
            MotionGraph.build([marching(character, 1).slice(0, 5)], GraphConfig(), character)

    def test_motions_must_be_long_enough(self, character: Character) -> None:
        with pytest.raises(MotionError, match="at least three frames at 15 fps; 1 motions"):
            MotionGraph.build([marching(character, 1).slice(0, 2)])
        with pytest.raises(MotionError, match="0 motions were given"):
            MotionGraph.build([])

    def test_contacts_must_fit(self, character: Character) -> None:
        motion = marching(character, 1)
        with pytest.raises(MotionError, match="for every frame of every motion"):
            MotionGraph.build([motion], contacts=[motion.contacts[:-1]])

    def test_numbers_must_be_finite(self) -> None:
        database = made_database(np.random.default_rng(1), (30, 30))
        poses = np.array(database.poses)
        poses[3, 9] = np.nan
        with pytest.raises(MotionError, match="not finite"):
            MotionGraph.from_database(replace(database, poses=poses), GraphConfig())

    def test_mirrors_have_no_fixed_place(self) -> None:
        with pytest.raises(UsageError, match="mirrored world"):
            GraphConfig(mirrored=True, coordinates=Coordinates.FIXED)


def test_a_higher_rate_makes_a_finer_graph(character: Character) -> None:
    motions = walking_motions(character)
    coarse, fine = (MotionGraph.build(motions, GraphConfig(fps=fps)) for fps in (15.0, 30.0))
    check_rows(fine)
    assert len(fine.database) == pytest.approx(2 * len(coarse.database), abs=8)
    assert fine.database.fps == 30.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"fps": "15"}, "fps must be a number, got '15'"),
        ({"sigma": None}, "sigma must be a number, got None"),
        ({"blend_s": True}, "blend_s must be a number, got True"),
        ({"mirrored": "no"}, "mirrored must be True or False, got 'no'"),
        ({"local_maxima": 1}, "local_maxima must be True, False or None, got 1"),
        ({"coordinates": "fixed"}, "coordinates must be one of Coordinates.RELATIVE, .*'fixed'"),
    ],
)
def test_settings_of_another_type_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        GraphConfig(**wrong)


def test_settings_may_be_numbers_of_numpy() -> None:
    assert GraphConfig(fps=np.float32(30.0), sigma=np.int64(1)).fps == 30.0  # type: ignore[arg-type]
