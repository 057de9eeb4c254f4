"""`dynresp graph sketch`: an avatar that walks along a drawn path, or to a goal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, check_results, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Overwrite, Seed
from dynresp.cli.progress_bar import progress

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
        typer.Option("--path", metavar="FILE.csv", help="The same, one corner per line: x, y."),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            "--goal", metavar="X,Y", help="Where to go instead; the path is then planned."
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--start", metavar="X,Y", help="Where to begin; by default where the path does."
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
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Walk along a path or to a goal, around obstacles.

    In a maze without path and goal the avatar goes from corner to corner. So it does over rough
    terrain, which is drawn from the seed, from 0 to 12.2 m along x and y. Writes result.json,
    motion.npz, motion.bvh, recording.html, filmstrip.png, plan.png and, where the machine can
    render, video.mp4.
    """
    from dynresp.avatar_runs.sketch_run import sketch_run
    from dynresp.avatar_runs.world_spec import read_world
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.motion.character import default_character

    corners = read_points(points, path)
    goal_m = None if goal is None else read_point(goal, "--goal")
    start_m = None if start is None else read_point(start, "--start")
    loaded = load_graph(graph)
    boxes = None if world is None else read_world(world)
    check_results(out, video, overwrite)
    with progress() as report:
        run = sketch_run(
            loaded, default_character(), path=corners, goal=goal_m, start=start_m, world=boxes,
            maze=maze, seed=seed or 0, fps=fps, progress=report,
        )  # fmt: skip
    # This is known of a path only, and not over terrain.
    off = run.about.get("sketch", {}).get("off_sketch_worst_m")
    if off is not None and off > _MAX_OFF_M:
        why = "; obstacles are in the way" if boxes is not None or maze else ""
        typer.echo(f"dynresp: the walk misses a corner of the path by {off:.1f} m{why}", err=True)
    finish(out, run, video, overwrite, as_json)


def read_points(text: str | None, file: Path | None) -> FloatArray | None:
    """The corners (k, 2) of a path [m], given as text or in a file; None if neither is given.

    Raises:
        UsageError: Both are given, or it is not a path.
    """
    from dynresp.support.errors import UsageError

    if text is not None and file is not None:
        raise UsageError("give the path either by --points or by --path, got both")
    if text is not None:
        return _corners(text.split(), "--points")
    if file is None:
        return None
    rows = [line for line in _lines(file) if line.strip() and not line.lstrip().startswith("#")]
    return _corners(rows, f"--path: {file}")


# A corner farther than this from the walk is reported [m].
_MAX_OFF_M = 1.0
# Largest file of corners [bytes], largest coordinate [m], most corners.
_MAX_BYTES = 1 << 20
_MAX_COORDINATE_M = 10_000.0
_MAX_CORNERS = 10_000


def _lines(file: Path) -> list[str]:
    """The lines of a small file of text."""
    from dynresp.support.errors import UsageError
    from dynresp.support.inputs import open_input

    try:
        with open_input(file) as stream:
            data = stream.read(_MAX_BYTES + 1)
    except OSError as error:
        raise UsageError(
            f"--path: {file} cannot be read ({error.strerror}); expected lines of x, y [m]"
        ) from None
    # Checked before decoding: what is read of a larger file may end inside a character.
    if len(data) > _MAX_BYTES:
        raise UsageError(
            f"--path: {file} is larger than {_MAX_BYTES // 1024} KiB, the largest that is read"
        )
    try:
        return data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise UsageError(f"--path: {file} is not text; expected lines of x, y [m]") from None


def _corners(words: list[str], where: str) -> FloatArray:
    """The corners (k, 2) of a path [m], one from each word."""
    import numpy as np

    from dynresp.locomotion.worlds.paths import check_length
    from dynresp.support.errors import UsageError

    if len(words) > _MAX_CORNERS:
        raise UsageError(
            f"{where}: a path of {len(words)} corners; at most {_MAX_CORNERS} are allowed, so "
            "leave out corners that are close together"
        )
    points = np.array([read_point(word, where) for word in words]).reshape(-1, 2)
    check_length(points, f"{where}: the path")
    return points


def read_point(text: str, where: str) -> tuple[float, float]:
    """A point on the ground [m], from "x,y".

    Raises:
        UsageError: The text is not a point.
    """
    from dynresp.support.errors import UsageError

    words = text.split(",")
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise UsageError(f"{where}: expected x,y in metres, got {text.strip()[:60]!r}") from None
    if not (abs(x) <= _MAX_COORDINATE_M and abs(y) <= _MAX_COORDINATE_M):
        raise UsageError(
            f"{where}: points must be within {_MAX_COORDINATE_M:g} m, got {text.strip()[:60]!r}"
        )
    return x, y
