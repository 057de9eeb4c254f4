"""`dynresp graph walk`: an avatar that walks on by chance, or by choice."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Motions, Seed
from dynresp.cli.progress_bar import progress
from dynresp.cli.run import check_folder

if TYPE_CHECKING:
    from dynresp.avatar_runs.choice_run import Pick


def walk(
    graph: Graph,
    out: Out,
    seconds: Annotated[
        float, typer.Option("--seconds", min=1.0, max=3600.0, help="How long it walks.")
    ] = 20.0,
    choose: Annotated[
        bool, typer.Option("--choose", help="Ask every few seconds what to do next.")
    ] = False,
    choices: Annotated[
        str | None,
        typer.Option(
            "--choices", metavar="N,N,...", help="The same with the answers given: 1,3,0 and so on."
        ),
    ] = None,
    balls: Annotated[
        bool, typer.Option("--balls", help="Throw balls at it; it takes them and walks on.")
    ] = False,
    motions: Motions = None,
    seed: Seed = None,
    fps: Fps = USUAL_FPS,
    video: Video = True,
    as_json: Json = False,
) -> None:
    """Walk by the graph's probabilities, by choice, or with balls thrown at it.

    Writes result.json, motion.npz, motion.bvh, recording.html, filmstrip.png, plan.png and, where
    the machine can render, video.mp4; by choice also options.png, the actions offered last.
    """
    import numpy as np

    from dynresp.avatar_runs.avatar_run import Outing
    from dynresp.avatar_runs.world_setup import play_in_world, refuse_blocks
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.locomotion.graph.random_walk import random_walk
    from dynresp.motion.character import default_character
    from dynresp.support.errors import UsageError

    answers = None if choices is None else read_answers(choices)
    if choose and answers is not None:
        raise UsageError("--choices has the answers that --choose asks for; leave out one of them")
    if balls and (choose or answers is not None):
        raise UsageError("--balls goes with a walk by chance; leave out --choose and --choices")
    if balls and fps != USUAL_FPS:
        raise UsageError(
            f"--balls: what is simulated is written at {USUAL_FPS:g} frames a second, not at "
            f"{fps:g}; leave out --fps"
        )
    loaded = load_graph(graph)
    if balls or choose or answers is not None:
        refuse_blocks(loaded)
    check_folder(out)
    if balls:
        from dynresp.avatar_runs.hit_run import hit_outing
        from dynresp.motion.sources.motion_folders import motion_folders

        folders = motion_folders(motions)
        with progress() as tell:
            hit = hit_outing(loaded, default_character(), folders, seconds, seed or 0, tell)
        finish(out, loaded, hit, video, as_json)
        return
    if choose or answers is not None:
        from dynresp.avatar_runs.choice_run import choice_outing

        typer.echo("looking for clusters ...", err=True)
        chosen = choice_outing(
            loaded, default_character(), seconds, seed or 0, picker(answers), fps
        )
        finish(out, loaded, chosen, video, as_json)
        return
    if loaded.database.world == "terrain":
        from dynresp.avatar_runs.asked import Asked
        from dynresp.avatar_runs.terrain_run import terrain_outing

        asked = Asked(seed=seed or 0)
        over = terrain_outing(loaded, default_character(), asked, seconds, fps)
        finish(out, loaded, over, video, as_json)
        return
    frames = max(2, round(seconds * loaded.config.fps) + 1)
    path = random_walk(loaded, frames, np.random.default_rng(seed or 0))
    composition = play_in_world(loaded, default_character(), path, fps)
    outing = Outing.of(
        composition,
        loaded,
        title=f"A walk by chance through {graph.name.encode(errors='replace').decode()}",
        subtitle=f"{composition.motion.duration:.0f} s, {len(composition.jumps)} jumps, "
        f"seed {seed or 0}",
        about={"seed": seed or 0},
    )
    finish(out, loaded, outing, video, as_json)


def read_answers(text: str) -> list[int]:
    """Numbers of actions, from "1,3,0".

    Raises:
        UsageError: It is no such list.
    """
    from dynresp.support.errors import UsageError

    try:
        answers = [int(word) for word in text.split(",")]
    except ValueError:
        answers = [-1]
    if min(answers) < 0:
        raise UsageError(
            f"--choices: expected whole numbers with commas between, such as 1,3,0 (0 leaves it "
            f"to chance), got {text[:60]!r}"
        )
    return answers


def picker(answers: list[int] | None) -> Pick:
    """Who chooses: the answers one after the other, else somebody at the terminal.

    Args:
        answers: 0 leaves it to chance; where they end, the walk does.
    """
    from dynresp.avatar_runs.choice_run import Enough
    from dynresp.support.errors import UsageError

    left = None if answers is None else list(answers)

    def pick(at_s: float, words: Sequence[str]) -> int | None:
        typer.echo(f"{at_s:.1f} s", err=True)
        for number, what in enumerate(words, 1):
            typer.echo(f"  {number}  {what}", err=True)
        if left is not None:
            if not left:
                raise Enough
            answer = left.pop(0)
            if answer > len(words):
                raise UsageError(
                    f"--choices: {answer} at {at_s:.1f} s, where {len(words)} actions are offered"
                )
            return answer - 1 if answer else None
        while True:
            typed = asked("which (0: chance, q: enough) [0]: ")
            if typed.lower() == "q":
                raise Enough
            known = next((n for n in range(len(words) + 1) if typed == str(n)), None)
            if known is not None:
                return known - 1 if known else None
            typer.echo(f"expected a number from 0 to {len(words)}, or q", err=True)

    return pick


def asked(question: str) -> str:
    """What somebody at the terminal types; 0 for nothing, and q where the typing ends.

    The question goes to standard error: standard output is for what came of it all.
    """
    typer.echo(question, nl=False, err=True)
    try:
        line = sys.stdin.readline()
    except KeyboardInterrupt:
        line = ""
    if not line:
        typer.echo(err=True)
        return "q"
    return line.strip() or "0"
