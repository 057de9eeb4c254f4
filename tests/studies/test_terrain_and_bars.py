"""Feet on drawn terrains and hands on recorded bars, as the benchmark measures them."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.motion.character import Character
from studies.graphs import terrain_and_bars
from studies.graphs.terrain_and_bars import TERRAINS, cross, play

pytestmark = [pytest.mark.slow, pytest.mark.mocap]


def built(name: str, folder: Path, character: Character) -> MotionGraph:
    path = find_graph_spec(name)
    return build_graph(read_graph_spec(path), [folder], path.parent, character, lambda *_: None)


def test_every_drawn_terrain_is_crossed_and_every_stance_is_on_its_block(
    motions_folder: Path, character: Character
) -> None:
    ways = TerrainGraph(built("terrain", motions_folder, character), character)
    stances = slid = 0
    for seed in range(TERRAINS):
        crossing = cross(ways, seed)
        assert crossing.walk.arrived
        assert crossing.on_block == len(crossing.feet.slide)
        stances += crossing.on_block
        slid += int(np.count_nonzero(crossing.feet.slide > 0.01))
    assert stances > 600
    assert slid < 0.04 * stances


def test_wandering_keeps_to_the_blocks_as_well(motions_folder: Path, character: Character) -> None:
    ways = TerrainGraph(built("terrain", motions_folder, character), character)
    for seed in range(3):
        wandering = cross(ways, seed, wander_s=20.0)
        assert wandering.walk.arrived
        assert wandering.motion.duration >= 19.9
        assert wandering.on_block == len(wandering.feet.slide)
        assert np.percentile(wandering.feet.slide, 95) < 0.01
        assert wandering.feet.slide.max() < 0.03


def test_figures_of_the_worlds(motions_folder: Path, character: Character) -> None:
    graph = built("terrain", motions_folder, character)
    found = terrain_and_bars._terrain(graph, character, 1, 0)
    assert found["crossing_arrived"] == 1
    assert found["crossing_stances"] == found["crossing_stances_on_their_block"]
    graph = built("playground", motions_folder, character)
    found = terrain_and_bars._playground(graph, character, 1, 0)
    assert found["seconds"] == 120.0
    assert float(found["fitted_slip_worst_cm"]) < 1.0
    assert float(found["fitted_slip_worst_cm"]) < float(found["blended_slip_median_cm"])
    before, after, _ = play(graph, character, 0)
    assert len(before.slip) == len(after.slip) == found["holds"]
