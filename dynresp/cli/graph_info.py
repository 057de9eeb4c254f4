"""`dynresp graph info`: the motions of a graph, and how many jumps were pruned."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynresp.cli.options import Json

if TYPE_CHECKING:
    from dynresp.locomotion.graph.motion_graph import MotionGraph

Graph = Annotated[
    Path, typer.Argument(metavar="GRAPH.npz", help="A file that `dynresp graph build` has written.")
]


def info(graph: Graph, as_json: Json = False) -> None:
    """Show the motions of a graph, and how many jumps each pruning rule leaves."""
    from dynresp.locomotion.graph.graph_file import load_graph

    typer.echo(graph_text(load_graph(graph), graph, as_json))


def graph_facts(graph: MotionGraph) -> dict[str, Any]:
    """Facts about a graph, for `--json`."""
    import dataclasses

    from dynresp.avatar_runs.avatar_run import graph_summary

    config = dataclasses.asdict(graph.config)
    config["coordinates"] = graph.config.coordinates.value
    counts = graph.counts
    return {
        **graph_summary(graph),
        "seconds": len(graph.database) / graph.config.fps,
        "frames_in_component": counts.component_frames,
        "jumps_left": {
            "pairs": counts.pairs,
            "contact": counts.contact,
            "likelihood": counts.likelihood,
            "similarity": counts.similarity,
            "footing": counts.footing,
            "component": counts.component,
        },
        "jumps_a_frame": counts.component / max(counts.component_frames, 1),
        "config": config,
        "motions": [
            {"name": clip.name, "frames": clip.stop - clip.start, "identity": clip.identity}
            for clip in graph.database.clips
        ],
    }


def graph_text(graph: MotionGraph, path: Path, as_json: bool) -> str:
    """Facts about a graph as text, or as one JSON object."""
    facts = graph_facts(graph)
    if as_json:
        return json.dumps(facts, indent=2)
    left = facts["jumps_left"]
    similarity = "not used" if left["similarity"] is None else f"{left['similarity']:,}"
    lines = [
        f"{path}  {facts['identity']}",
        f"  {facts['frames']:,} frames at {facts['fps']:g} fps ({facts['seconds'] / 60:.1f} min), "
        f"{facts['clips']} clips, {facts['coordinates']} coordinates",
        f"  {facts['frames_in_component']:,} frames in the one component, "
        f"{facts['jumps_a_frame']:.1f} jumps a frame",
        "  jumps left by each pruning rule:",
        f"    pairs of frames  {left['pairs']:>15,}",
        f"    contact          {left['contact']:>15,}",
        f"    likelihood       {left['likelihood']:>15,}",
        f"    similarity       {similarity:>15}",
        f"    footing          {left['footing']:>15,}",
        f"    component        {left['component']:>15,}",
    ]
    if facts["built_in_clips"]:
        lines.append(f"  {facts['built_in_clips']} clips are built-in motion, not motion capture")
    lines += [f"  {credit}" for credit in facts["credits"]]
    return "\n".join(lines)
