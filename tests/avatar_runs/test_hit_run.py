from dataclasses import replace

import pytest

from dynresp.avatar_runs.avatar_run import foot_slide, run_metrics
from dynresp.avatar_runs.hit_run import hit_run
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import load_library
from tests.locomotion.samples import walking_graph


def test_foot_slide_by_what_moved_the_avatar(character: Character) -> None:
    graph = walking_graph(character)
    run = hit_run(graph, character, load_library("builtin"), seconds=9.0, seed=3)
    parts = run.about["foot_skate_by_part_m"]
    assert {"graph", "approach", "physics", "blend"} <= set(parts)
    # Nobody stands in this small graph: a foot is dragged once when an avatar walks off at once.
    assert parts["graph"]["median"] < 1e-3
    assert all(part["worst"] >= part["median"] >= 0.0 for part in parts.values())
    # Parts of stances are no longer than whole ones.
    whole = foot_slide(run.motion, character)
    assert whole is not None
    assert whole["worst"] >= max(part["worst"] for part in parts.values()) - 1e-9
    slow = replace(run, motion=run.motion.resampled(1.0))
    assert run_metrics(slow)["foot_skate_m"] is None


def test_what_is_shown(graph: MotionGraph, character: Character) -> None:
    run = hit_run(graph, character, load_library("builtin"), seconds=8.0, seed=1)
    assert run.motion.fps == 30.0
    assert run.motion.duration == pytest.approx(8.0, abs=0.1)
    hits = [event for event in run.events if event.name == "contact"]
    assert 1 <= len(hits) <= len(run.spheres)
    assert {"base motion", "physics"} <= {phase.name for phase in run.phases}
