"""`dynresp graph sketch`: an avatar that walks along a drawn path, or to a place."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Seed
from dynresp.cli.progress_bar import progress
from dynresp.cli.run import check_folder

if TYPE_CHECKING:
    from dynresp.motion.rotations import FloatArray


def sketch(
    graph: Graph,
    out: Out,
    points: Annotated[
        str | None,
        typer.Option(
            "--points", metavar="'X,Y X,Y ...'", help="Corners of the path on the ground [m]."
        ),
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option("--path", metavar="FILE.csv", help="The same, a corner a line: x, y."),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option("--goal", metavar="X,Y", help="A place to reach; the path is then planned."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--start", metavar="X,Y", help="Where it begins; by default where the path does."
        ),
    ] = None,
    world: Annotated[
        Path | None,
        typer.Option("--world", metavar="WORLD.toml", help="Obstacles: boxes on the ground."),
    ] = None,
    maze: Annotated[
        bool, typer.Option("--maze", help="Obstacles: a random maze, drawn from the seed.")
    ] = False,
    seed: Seed = None,
    fps: Fps = USUAL_FPS,
    video: Video = True,
    as_json: Json = False,
) -> None:
    """Walk along a sketched path around obstacles, or to a goal.

    In a maze without a path it goes from corner to corner; so it does over rough terrain, which is
    drawn from the seed and reaches from 0 to 12.2 m along x and y. Writes result.json, motion.npz,
    motion.bvh, recording.html, filmstrip.png, plan.png and, where the machine can render,
    video.mp4.
    """
    from dynresp.avatar_runs.asked import Asked
    from dynresp.avatar_runs.sketch_run import sketch_outing
    from dynresp.avatar_runs.world_spec import read_world
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.motion.character import default_character

    asked = Asked(
        path=read_points(points, path),
        goal=None if goal is None else one_point(goal, "--goal"),
        start=None if start is None else one_point(start, "--start"),
        maze=maze,
        seed=seed or 0,
    )
    loaded = load_graph(graph)
    boxes = None if world is None else read_world(world)
    check_folder(out)
    with progress() as tell:
        outing = sketch_outing(loaded, default_character(), asked, boxes, fps, tell)
    # Over terrain there is no such figure; nor is there one of a goal.
    off = outing.about.get("sketch", {}).get("off_sketch_worst_m")
    if off is not None and off > _MISSED_M:
        why = "; obstacles stand there" if boxes is not None or maze else ""
        typer.echo(
            f"dynresp: to a corner of the path sketched it comes no nearer than {off:.1f} m{why}",
            err=True,
        )
    finish(out, loaded, outing, video, as_json)


def read_points(text: str | None, file: Path | None) -> FloatArray | None:
    """The corners of a path, given as text or in a file; None for none.

    Raises:
        UsageError: Both are given, or one is not what it should be.
    """
    from dynresp.support.errors import UsageError

    if text is not None and file is not None:
        raise UsageError("give the path by --points or by --path, not by both")
    if text is not None:
        return _corners(text.split(), "--points")
    if file is None:
        return None
    rows = [line for line in _lines(file) if line.strip() and not line.lstrip().startswith("#")]
    return _corners(rows, f"--path: {file}")


# Farther from the walk than this a corner is told to be missed [m].
_MISSED_M = 1.0
# Largest file of corners that is read [bytes]; and how far corners may be away [m].
_MOST_BYTES = 1 << 20
_FARTHEST = 10_000.0
# Most corners of a path.
_MOST_CORNERS = 10_000


def _lines(file: Path) -> list[str]:
    """The lines of a small file of text."""
    from dynresp.support.errors import UsageError

    try:
        with file.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise UsageError(
            f"--path: {file} cannot be read ({error.strerror}); expected lines of x, y [m]"
        ) from None
    # Before it is decoded: what is read of a larger file may end inside a character.
    if len(data) > _MOST_BYTES:
        raise UsageError(f"--path: {file} is larger than {_MOST_BYTES // 1024} KiB; no path is")
    try:
        return data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise UsageError(f"--path: {file} is no text; expected lines of x, y [m]") from None


def _corners(words: list[str], where: str) -> FloatArray:
    """The corners (k, 2) of a path of which each word is one."""
    import numpy as np

    from dynresp.locomotion.worlds.paths import check_length
    from dynresp.support.errors import UsageError

    if len(words) > _MOST_CORNERS:
        raise UsageError(
            f"{where}: a path of {len(words)} corners; at most {_MOST_CORNERS} are allowed, so "
            "leave out corners that lie near to each other"
        )
    points = np.array([one_point(word, where) for word in words]).reshape(-1, 2)
    check_length(points, f"{where}: the path")
    return points


def one_point(text: str, where: str) -> tuple[float, float]:
    """A point on the ground, from "x,y".

    Raises:
        UsageError: It is none.
    """
    from dynresp.support.errors import UsageError

    words = text.split(",")
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise UsageError(f"{where}: expected x,y in metres, got {text.strip()[:60]!r}") from None
    if not (abs(x) <= _FARTHEST and abs(y) <= _FARTHEST):
        raise UsageError(
            f"{where}: points must be within {_FARTHEST:g} m, got {text.strip()[:60]!r}"
        )
    return x, y
