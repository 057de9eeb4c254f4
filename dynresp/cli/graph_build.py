"""`dynresp graph build`: make a motion graph of motions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli.options import Json, Motions, OverwriteFile
from dynresp.cli.progress_bar import progress

# The usual spec, and the one to use if its motions are not on this machine.
_USUAL, _INSTEAD = "walking", "builtin"


def build(
    out: Annotated[Path, typer.Option("--out", metavar="GRAPH.npz", help="The graph's file.")],
    spec: Annotated[
        str | None,
        typer.Argument(
            metavar="[SPEC]",
            help="A graph spec that comes with dynresp (walking, builtin, ...) or a file (.toml); "
            "by default walking, or builtin if its motions are not on this machine.",
        ),
    ] = None,
    motions: Motions = None,
    overwrite: OverwriteFile = False,
    as_json: Json = False,
) -> None:
    """Build a motion graph, and say how many jumps each pruning rule leaves."""
    from dynresp.avatar_runs.graph_building import build_graph
    from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
    from dynresp.cli.graph_info import graph_text
    from dynresp.cli.run import check_file
    from dynresp.locomotion.graph.graph_file import save_graph
    from dynresp.motion.character import default_character
    from dynresp.motion.sources.motion_folders import motion_folders
    from dynresp.support.errors import MissingMotionDataError

    check_file(out, overwrite, _is_graph)
    folders = motion_folders(motions)
    character = default_character()
    with progress() as report:
        path = find_graph_spec(spec or _USUAL)
        try:
            graph = build_graph(read_graph_spec(path), folders, path.parent, character, report)
        except MissingMotionDataError:
            if spec is not None:
                raise
            typer.echo(
                f"dynresp: the motions of {_USUAL!r} are not on this machine; building the graph "
                "of built-in motion. Fetch them with `dynresp motions fetch graphs`.",
                err=True,
            )
            path = find_graph_spec(_INSTEAD)
            graph = build_graph(read_graph_spec(path), folders, path.parent, character, report)
        # Once more: its motions are known only now.
        check_file(out, overwrite, _is_graph)
        report(f"writing {out}", 0, 1)
        save_graph(graph, out)
    typer.echo(graph_text(graph, out, as_json))


def _is_graph(file: Path) -> bool:
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.support.errors import DynrespError

    try:
        load_graph(file)
    except DynrespError:
        return False
    return True
