import dataclasses

import numpy as np
import pytest

from dynresp.avatar_runs.world_setup import PLAYGROUND, TERRAIN, play_in_world, refuse_terrain
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.support.errors import UsageError


def test_each_world_is_played_in_its_own_way(character: Character) -> None:
    walk = load_builtin("walk")
    flat = MotionGraph.build([walk], GraphConfig(), character)
    path = random_walk(flat, 40, np.random.default_rng(0))
    played = play_in_world(flat, character, path, 30.0)
    assert (played.motion.poses == compose(flat, character, path, fps=30.0).motion.poses).all()
    refuse_terrain(flat)
    terrain = of_world(flat, TERRAIN)
    with pytest.raises(UsageError, match="need blocks to step on"):
        play_in_world(terrain, character, path, 30.0)
    with pytest.raises(UsageError, match="graph sketch"):
        refuse_terrain(terrain)
    hands = np.zeros((len(walk), 4), dtype=bool)
    hands[:, :2] = walk.contacts
    config = GraphConfig(coordinates=Coordinates.FIXED, sigma=10.0)
    bars = MotionGraph.build([walk], config, character, contacts=[hands])
    bars = of_world(bars, PLAYGROUND)
    path = bars.frames[:20]
    played = play_in_world(bars, character, path, 30.0)
    assert played.motion.name == "walk through a playground"


def of_world(graph: MotionGraph, world: str) -> MotionGraph:
    """The same graph, as one of another world."""
    return dataclasses.replace(graph, database=dataclasses.replace(graph.database, world=world))
