"""Options and ending of the commands by which an avatar goes somewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynresp.cli.progress_bar import progress
from dynresp.cli.run import exit_if_failed, report_unwritten

if TYPE_CHECKING:
    from dynresp.avatar_runs.avatar_run import Outing
    from dynresp.locomotion.graph.motion_graph import MotionGraph

Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
Fps = Annotated[
    float, typer.Option("--fps", min=1.0, max=240.0, help="Frame rate of the motion written.")
]
Video = Annotated[bool, typer.Option("--video/--no-video", help="Whether to draw a video.")]
USUAL_FPS = 30.0


def finish(
    out: Path,
    graph: MotionGraph,
    outing: Outing,
    video: bool,
    as_json: bool,
    more: dict[str, Any] | None = None,
    lines: Sequence[str] = (),
) -> None:
    """Write an outing and say what came of it.

    Args:
        out: Folder for the results.
        graph: What it went through.
        outing: What the avatar did.
        video: Whether a video is drawn.
        as_json: Whether one JSON object is printed.
        more: Printed in that object as well, but not written: what differs from run to run.
        lines: Printed as well where it is text.

    Raises:
        typer.Exit: With code 1, where it did not arrive, or a file could not be written.
    """
    from dynresp.avatar_runs.avatar_run import write_outing
    from dynresp.motion.character import default_character
    from dynresp.results.result_json import to_json

    with progress() as tell:
        content = write_outing(out, graph, outing, default_character(), tell, video)
    report_unwritten(content["files"])
    typer.echo(
        to_json({**content, **(more or {})}) if as_json else tell_outing(content, out, lines)
    )
    if not outing.arrived:
        typer.echo("dynresp: it did not arrive; result.json says how far it came", err=True)
        raise typer.Exit(1)
    exit_if_failed(content["files"])


def tell_outing(content: dict[str, Any], out: Path, more: Sequence[str] = ()) -> str:
    """What came of an outing, for people.

    Args:
        content: Of `result.json`.
        out: Where it lies.
        more: Further lines.
    """
    happened = content["happened"]
    skate, blended = happened["foot_skate_m"], happened.get("foot_skate_as_blended_m")
    before = f"; as blended {1000 * blended['median']:.0f} mm" if blended else ""
    jumps = "" if happened["jumps"] is None else f", {happened['jumps']} jumps"
    lines = [
        content["title"],
        f"  {happened['way_m']:.1f} m in {happened['seconds']:.1f} s{jumps}",
        "  too few frames a second to tell how far feet slide"
        if skate is None
        else f"  feet slide {1000 * skate['median']:.0f} mm a stance (median), "
        f"{1000 * skate['percentile_95']:.0f} mm at the 95th percentile, "
        f"{1000 * skate['worst']:.0f} mm at most{before}",
        *(f"  {line}" for line in more),
    ]
    if content["graph"]["built_in_clips"] == content["graph"]["clips"]:
        lines.append("  made of built-in motion, no motion capture")
    lines += [f"  {line}" for line in content["graph"]["credits"]]
    lines.append(f"  written to {out}")
    return "\n".join(lines)
