"""The parts of the benchmark of motion graphs, on small graphs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import Motion
from dynresp.physics.impacts import Ball, Punch, Push
from dynresp.support.errors import MissingMotionDataError, UnknownNameError, UsageError
from studies.benchmarks import graph_database
from studies.graphs import (
    avatar_hits,
    cluster_fit,
    feet_and_jumps,
    million_frames,
    offered_choices,
    pruning_rules,
    speed_steps,
)
from studies.study import Options, Value
from tests.locomotion.samples import walking_graph


@pytest.fixture(scope="module")
def graph(character: Character) -> MotionGraph:
    return walking_graph(character)


def numbers(figures: dict[str, Value]) -> list[float]:
    return [value for value in figures.values() if not isinstance(value, str)]


def test_a_spec_of_the_user_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path))
    spec = tmp_path / "mine.toml"
    spec.write_text('[graph]\nname = "mine"\n[[motion]]\nmotion = "builtin:walk"\n')
    columns = pruning_rules.STUDY.measure(Options(motions=tmp_path, spec=str(spec)))
    assert list(columns) == ["mine"]
    assert float(columns["mine"]["pairs"]) > 10_000


class TestWalk:
    def test_a_walk_neither_ends_nor_leaves_the_graph(
        self, graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(million_frames, "_STRETCH", 150)
        figures = million_frames.measure(graph, character, 400, 1)
        for name in ("dead_ends", "frames_off_the_graph", "frames_not_finite", "fitted_not_finite"):
            assert figures[name] == 0
        assert figures["fitted_frames"] == 400
        for name in ("walked_per_s", "played_per_s", "fitted_per_s", "jumps"):
            assert figures[name] > 0  # type: ignore[operator]

    def test_feet_are_fitted_on_level_ground_alone(
        self, graph: MotionGraph, character: Character
    ) -> None:
        high = replace(graph, database=replace(graph.database, world="playground"))
        assert "fitted_per_s" not in million_frames.measure(high, character, 400, 1)

    def test_steps_that_are_no_ways_are_counted(self, graph: MotionGraph) -> None:
        path = random_walk(graph, 50, np.random.default_rng(2))
        assert million_frames.off_the_graph(graph, path) == 0
        path[20] = len(graph.database) - 1 - path[20]
        assert million_frames.off_the_graph(graph, path) in (1, 2)


class TestSteps:
    def test_a_sudden_start_is_a_step_of_its_speed(self, character: Character) -> None:
        poses = np.tile(character.rest_pose, (9, 1))
        # From frame 4 on it goes at 2 m/s, turns at 1 rad/s, and bends a joint at 3 rad/s.
        moved = np.maximum(np.arange(9) - 4, 0) / 10.0
        poses[:, 0] += 2.0 * moved
        turns = rotations.from_rotation_vector(np.outer(moved, [0.0, 0.0, 1.0]))
        poses[:, 3:7] = rotations.multiply(turns, poses[:, 3:7])
        bends = rotations.from_rotation_vector(np.outer(moved, [0.0, 3.0, 0.0]))
        poses[:, 11:15] = rotations.multiply(bends, poses[:, 11:15])
        steps = speed_steps.speed_steps(Motion(poses, 10.0, "start"))
        expected = np.zeros((7, 3))
        expected[3] = [3.0, 2.0, 1.0]
        np.testing.assert_allclose(steps, expected, atol=1e-9)
        found = speed_steps.at_jumps(Motion(poses, 10.0, "start"), np.array([1, 5]))
        np.testing.assert_allclose(found.max(axis=0), [3.0, 2.0, 1.0])

    def test_at_a_higher_rate_all_frames_of_a_jump_count(self, character: Character) -> None:
        poses = np.tile(character.rest_pose, (30, 1))
        poses[15, 0] += 0.1
        motion = Motion(poses, 10.0, "jerk")
        # Frame 7 of the walk is entered at frame 14 of the motion, frame 8 at frame 16.
        assert speed_steps.at_jumps(motion, np.array([7]), 2.0)[:, 1].max() == pytest.approx(1.0)
        assert speed_steps.at_jumps(motion, np.array([8]), 2.0)[:, 1].max() == pytest.approx(2.0)
        assert speed_steps.at_jumps(motion, np.array([10]), 2.0)[:, 1].max() == 0.0

    def test_limits_are_those_of_what_was_recorded(self, graph: MotionGraph) -> None:
        limits = speed_steps.source_limits(graph)
        assert limits.shape == (3,)
        assert (limits > 0).all()
        # Between the graph's frames speeds change less at once.
        finer = speed_steps.source_limits_at(graph, default_character(), 30.0)
        assert (finer < 1.2 * limits).all()


def test_feet_stand_after_fitting(
    graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feet_and_jumps, "_STRETCH", 250)
    figures = feet_and_jumps.measure(graph, character, 400, 1)
    assert figures["slide_fitted_under_1_cm"] == 1.0
    assert figures["at_30_fps_slide_fitted_under_1_cm"] == 1.0
    assert 0 < figures["slide_fitted_largest_mm"] < figures["slide_blended_largest_mm"]  # type: ignore[operator]
    assert figures["joint_step_cut_below"] <= figures["joint_step_blended_below"]  # type: ignore[operator]
    assert figures["jumps"] > 0  # type: ignore[operator]
    assert np.isfinite(numbers(figures)).all()


def test_feet_of_a_walk_without_jumps(graph: MotionGraph, character: Character) -> None:
    with pytest.raises(UsageError, match="3 frames hold no stance or no jump; give a larger"):
        feet_and_jumps.measure(graph, character, 3, 3)


def test_feet_of_a_walk_without_stances(
    graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feet_and_jumps, "stance_slides", lambda *_: [])
    with pytest.raises(UsageError, match="100 frames hold no stance or no jump; give a larger"):
        feet_and_jumps.measure(graph, character, 100, 1)


def test_choices_are_counted_and_timed(graph: MotionGraph, character: Character) -> None:
    figures = offered_choices.measure(graph, character, 20, 1)
    assert figures["moments"] == 20
    assert 0 <= figures["options_fewest"] <= figures["options_mean"] <= 4  # type: ignore[operator]
    assert 0 < figures["time_median_ms"] <= figures["time_largest_ms"]  # type: ignore[operator]


def test_clusters_are_compared_with_random_starts(graph: MotionGraph, character: Character) -> None:
    figures = cluster_fit.measure(graph, character, 2, 1)
    assert figures["random_starts"] == 2
    gained = figures["log_likelihood"] - figures["random_best_log_likelihood"]  # type: ignore[operator]
    assert figures["log_likelihood_gained"] == pytest.approx(gained)
    assert np.isfinite(numbers(figures)).all()


def test_rules_are_those_of_the_graph(graph: MotionGraph, character: Character) -> None:
    figures = pruning_rules.measure(graph, character, 400, 1)
    assert figures["pairs"] == len(graph.database) ** 2
    assert figures["component"] == graph.counts.component
    assert figures["similarity"] == "-"


class TestHits:
    def test_impacts_are_of_all_kinds(self, rng: np.random.Generator) -> None:
        kinds = {type(avatar_hits.some_impact(rng)) for _ in range(40)}
        assert kinds == {Ball, Push, Punch}

    @pytest.mark.slow
    def test_avatars_that_were_hit_walk_on(
        self, graph: MotionGraph, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("DYNRESP_MOTIONS", raising=False)
        monkeypatch.setattr(avatar_hits, "_HITS_EACH", 3)
        figures = avatar_hits.measure(graph, character, 6, 1, [])
        assert figures["library"] == "builtin"
        assert (figures["avatars"], figures["hits_thrown"]) == (2, 6)
        assert figures["stuck"] == figures["frames_not_finite"] == 0
        became = [figures[name] for name in ("carried_on", "reacted", "stayed_down")]
        assert sum(became) == figures["answered"]  # type: ignore[arg-type]
        assert figures["answered"] != 0
        assert 0.0 <= figures["walked_on"] <= 1.0  # type: ignore[operator]


class TestGraphs:
    @pytest.fixture(autouse=True)
    def no_motions(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("DYNRESP_MOTIONS", raising=False)
        monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path))

    def test_specs_whose_motions_are_missing_are_left_out(
        self, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        built = []

        def build(spec: object, *_: object) -> str:
            if spec.graph.name != "built-in walking":  # type: ignore[attr-defined]
                raise MissingMotionDataError("none")
            built.append(spec)
            return "a graph"

        monkeypatch.setattr(graph_database, "build_graph", build)
        graph_database._built.cache_clear()
        found = list(graph_database.graphs_at_hand(["walking", "builtin"], [], character))
        graph_database._built.cache_clear()
        assert [name for name, _ in found] == ["builtin"]
        assert len(built) == 1

    def test_a_spec_that_is_named_must_be_there(self) -> None:
        with pytest.raises(MissingMotionDataError, match="motion files"):
            pruning_rules.STUDY.measure(Options(spec="playground"))
        with pytest.raises(UnknownNameError, match="nowhere"):
            pruning_rules.STUDY.measure(Options(spec="nowhere"))

    def test_a_quick_run_measures_little_of_the_built_in_graph(self) -> None:
        columns = million_frames.STUDY.measure(Options(quick=True))
        assert list(columns) == ["builtin"]
        assert columns["builtin"]["frames"] == 3_000
        assert not any(target.missed_by(columns) for target in million_frames.STUDY.targets[:4])
