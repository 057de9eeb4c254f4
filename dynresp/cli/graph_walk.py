"""`dynresp graph walk`: an avatar that walks by chance."""

from __future__ import annotations

from typing import Annotated

import typer

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, check_results, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Overwrite, Seed


def walk(
    graph: Graph,
    out: Out,
    seconds: Annotated[
        float, typer.Option("--seconds", min=1.0, max=3600.0, help="How long it walks.")
    ] = 20.0,
    seed: Seed = None,
    fps: Fps = USUAL_FPS,
    video: Video = True,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Walk by chance, in the world of the graph.

    Writes result.json, motion.npz, motion.bvh, recording.html, filmstrip.png, plan.png and, where
    the machine can render, video.mp4. Walks by choice and walks with balls are functions of the
    Python interface (docs/locomotion.md).
    """
    import dataclasses

    from dynresp.avatar_runs.chance_run import chance_run
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.motion.character import default_character

    loaded = load_graph(graph)
    check_results(out, video, overwrite)
    run = chance_run(loaded, default_character(), seconds, seed or 0, fps)
    name = graph.name.encode(errors="replace").decode()
    finish(
        out,
        dataclasses.replace(run, title=f"{run.title} through {name}"),
        video,
        overwrite,
        as_json,
    )
