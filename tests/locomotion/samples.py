"""Small motions and graphs for the tests of locomotion."""

import functools
from pathlib import Path

import numpy as np

from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion


def walking_motions(character: Character) -> list[Motion]:
    """The built-in walk, as it is, mirrored, and a little changed, as two more recordings would."""
    walk = load_builtin("walk", character)
    rng = np.random.default_rng(7)
    motions = [walk, walk.mirrored(character)]
    for name in ("second", "third"):
        poses = walk.poses + rng.normal(0.0, 0.004, 59)
        motions.append(Motion(poses, walk.fps, name, walk.contacts).placed(1.0, 2.0, 0.7))
    return motions


def walking_graph(character: Character, **changes: object) -> MotionGraph:
    """A graph of `walking_motions`."""
    return MotionGraph.build(walking_motions(character), GraphConfig(**changes), character)  # type: ignore[arg-type]


@functools.cache
def planned_graph(name: str, folder: Path, character: Character) -> MotionGraph:
    """The graph of a plan that comes with the product, of real motion capture; built once."""
    path = find_graph_spec(name)
    return build_graph(read_graph_spec(path), [folder], path.parent, character, lambda *_: None)
