"""Measure something of each motion graph whose motions are on this machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character, default_character
from dynresp.motion.sources.motion_folders import motion_folders
from studies.benchmarks.graph_database import graphs_at_hand
from studies.study import Columns, Options, Value

FLAT = ("walking", "builtin")
"""Specs whose graphs walk on level ground."""
WORLDS = (*FLAT, "terrain", "stool", "playground")
"""All specs that are measured."""

GraphMeasure = Callable[[MotionGraph, Character, int, int], Mapping[str, Value]]
"""Measures a graph, with a character, a count (frames, moments, paths or hits) and a seed."""


def of_graphs(
    measure: GraphMeasure, specs: Sequence[str], count: int = 0, quick_count: int = 0
) -> Callable[[Options], Columns]:
    """What a study measures, a column for each graph.

    Args:
        measure: Measures one graph.
        specs: Graph specs that come with dynresp; those without motions here are left out.
        count: Of how many frames, moments, paths or hits; 0 where there is nothing to count.
        quick_count: The same in a quick run.

    Raises:
        DynrespError: There is no such spec, or motions cannot be read.
    """

    def measured(options: Options) -> Columns:
        character, folders = default_character(), motion_folders(options.motions)
        number = options.count or (quick_count if options.quick else count)
        names = [options.spec] if options.spec else specs
        if options.quick and "builtin" in names:
            names = ["builtin"]
        columns = {}
        for name, graph in graphs_at_hand(names, folders, character, bool(options.spec)):
            options.say(f"measuring the graph {name}")
            columns[name] = measure(graph, character, number, options.seed)
        return columns

    return measured
