"""The parts of `dynresp bench graph` beside the building of a graph."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dynresp.bench.graph_figures import GraphFigures, Measurement


class Part(StrEnum):
    """What is measured. The command line imports this: what is heavy is imported by functions."""

    build = "build"
    rules = "rules"
    walk = "walk"
    feet = "feet"
    clusters = "clusters"
    choice = "choice"
    sketch = "sketch"
    mazes = "mazes"
    terrain = "terrain"
    playground = "playground"
    hits = "hits"
    all = "all"


def measurement(part: Part, folders: Sequence[Path] | None = None) -> Measurement:
    """What a part measures, and of which graphs.

    Args:
        part: Any but `build`, which has a report of its own, and `all`.
        folders: Motions folders; None for those of `motion_folders`.
    """
    from dynresp.bench import (
        graph_choice,
        graph_clusters,
        graph_feet,
        graph_hits,
        graph_mazes,
        graph_rules,
        graph_sketch,
        graph_walk,
        graph_worlds,
    )

    return {
        Part.rules: graph_rules.MEASUREMENT,
        Part.walk: graph_walk.MEASUREMENT,
        Part.feet: graph_feet.MEASUREMENT,
        Part.clusters: graph_clusters.MEASUREMENT,
        Part.choice: graph_choice.MEASUREMENT,
        Part.sketch: graph_sketch.MEASUREMENT,
        Part.mazes: graph_mazes.MEASUREMENT,
        Part.terrain: graph_worlds.TERRAIN,
        Part.playground: graph_worlds.PLAYGROUND,
        Part.hits: graph_hits.measurement(folders),
    }[part]


def run_part(
    part: Part,
    seed: int = 0,
    motions: Path | None = None,
    *,
    plan: str | None = None,
    count: int = 0,
) -> GraphFigures:
    """Measure one part.

    Args:
        part: Any but `build` and `all`.
        seed: Seed of all that is random.
        motions: Motions folder.
        plan: The only plan whose graph is measured, by name or file; by default all that the part
            is for and whose motions are on this machine.
        count: How many frames, moments, paths or hits; 0 for as many as are asked for.

    Raises:
        DynrespError: There is no such plan, or motions cannot be read.
    """
    from dynresp.bench.graph_database import graphs_at_hand
    from dynresp.bench.graph_figures import GraphFigures
    from dynresp.bench.machine import describe_machine
    from dynresp.motion.character import default_character
    from dynresp.motion.sources.motion_folders import motion_folders

    character, folders = default_character(), motion_folders(motions)
    asked = measurement(part, folders)
    graphs = graphs_at_hand([plan] if plan else asked.plans, folders, character, bool(plan))
    return GraphFigures(
        part.value,
        {
            name: asked.measure(graph, character, count or asked.count, seed)
            for name, graph in graphs
        },
        describe_machine(("numpy", "numba", "scipy", "mujoco")),
        asked.asked,
        asked.notes,
    )
