"""Options that the commands of avatars share, and the writing of their results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynresp.cli.progress_bar import progress
from dynresp.cli.run import check_folder, exit_if_failed, report_unwritten

if TYPE_CHECKING:
    from dynresp.avatar_runs.avatar_run import AvatarRun

Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
Fps = Annotated[
    float, typer.Option("--fps", min=1.0, max=240.0, help="Frame rate of the motion written.")
]
Video = Annotated[bool, typer.Option("--video/--no-video", help="Whether to draw a video.")]
USUAL_FPS = 30.0


def check_results(out: Path, video: bool, overwrite: bool, more: Sequence[str] = ()) -> None:
    """Check, before any work, that the results of an avatar can be written to a folder.

    Args:
        out: The folder.
        video: Whether a video is drawn.
        overwrite: Whether files that no earlier result names as its own may be replaced.
        more: Further files.

    Raises:
        UsageError: They cannot.
    """
    from dynresp.avatar_runs.avatar_run import FILES, VIDEO
    from dynresp.results.result_folder import RESULT, check_claim

    check_folder(out)
    names = [name for name in FILES if video or name != VIDEO]
    check_claim(out, [RESULT, *names, *more], overwrite=overwrite)


def finish(
    out: Path,
    run: AvatarRun,
    video: bool,
    overwrite: bool,
    as_json: bool,
    more: dict[str, Any] | None = None,
    lines: Sequence[str] = (),
) -> None:
    """Write the result folder of a run, and print the result.

    Args:
        out: Folder for the results.
        run: What the avatar did.
        video: Whether a video is drawn.
        overwrite: Whether files that no earlier result names as its own may be replaced.
        as_json: Whether one JSON object is printed instead of text.
        more: Also printed in that object, but not written: what differs from run to run.
        lines: Also printed in the text.

    Raises:
        typer.Exit: With code 1, if the avatar did not arrive, or a file could not be written.
    """
    from dynresp.results.result_json import to_json

    with progress() as report:
        content = run.save(out, report, video, overwrite=overwrite)
    report_unwritten(content["files"])
    typer.echo(to_json({**content, **(more or {})}) if as_json else run_text(content, out, lines))
    if not run.arrived:
        typer.echo("dynresp: the avatar did not arrive; result.json says how far it came", err=True)
        raise typer.Exit(1)
    exit_if_failed(content["files"])


def run_text(content: dict[str, Any], out: Path, more: Sequence[str] = ()) -> str:
    """The result of a run as text.

    Args:
        content: Content of `result.json`.
        out: The result folder.
        more: Further lines.
    """
    happened = content["happened"]
    slide, blended = happened["foot_skate_m"], happened.get("foot_skate_as_blended_m")
    before = f"; {1000 * blended['median']:.0f} mm before feet were fitted" if blended else ""
    jumps = "" if happened["jumps"] is None else f", {happened['jumps']} jumps"
    lines = [
        content["title"],
        f"  {happened['way_m']:.1f} m in {happened['seconds']:.1f} s{jumps}",
        "  foot slide is not measured below 10 frames a second"
        if slide is None
        else f"  feet slide {1000 * slide['median']:.0f} mm a stance (median), "
        f"{1000 * slide['percentile_95']:.0f} mm at the 95th percentile, "
        f"{1000 * slide['worst']:.0f} mm at most{before}",
        *(f"  {line}" for line in more),
    ]
    if content["graph"]["built_in_clips"] == content["graph"]["clips"]:
        lines.append("  made of built-in motion, not of motion capture")
    lines += [f"  {line}" for line in content["graph"]["credits"]]
    lines.append(f"  written to {out}")
    return "\n".join(lines)
