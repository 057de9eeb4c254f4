"""Table 1 of Lee et al. 2002 for our graphs: how many jumps each pruning rule leaves."""

from __future__ import annotations

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from studies.graphs.graph_study import WORLDS, of_graphs
from studies.study import Study, Value


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Counts from the building of the graph.

    Args:
        graph: The graph.
        character: Not used.
        count: Not used.
        seed: Not used.
    """
    counts = graph.counts
    return {
        "frames": counts.frames,
        "pairs": counts.pairs,
        "contact": counts.contact,
        "likelihood": counts.likelihood,
        "similarity": "-" if counts.similarity is None else counts.similarity,
        "footing": counts.footing,
        "component": counts.component,
        "component_frames": counts.component_frames,
        "jumps_a_frame": counts.component / max(counts.component_frames, 1),
    }


STUDY = Study(
    "pruning-rules",
    "jumps left by each pruning rule, as in table 1 of Lee et al. 2002",
    "20 s",
    of_graphs(measure, WORLDS),
    notes=("Jumps left by each rule after those before it; - where a rule is not in force.",),
)
