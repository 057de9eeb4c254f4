"""`dynresp motions show`: facts about a motion, and pictures of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynresp.cli import motion_options
from dynresp.cli.options import Json, Motions, OverwriteFiles
from dynresp.cli.run import check_folder, check_new

if TYPE_CHECKING:
    from dynresp.motion.motion import Motion


PICTURES = ("recording.html", "filmstrip.png")


def show(
    motion: motion_options.Name,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for recording.html and filmstrip.png."),
    ] = None,
    unit: motion_options.Unit = None,
    up: motion_options.Up = None,
    fps: motion_options.Fps = None,
    asf: motion_options.Asf = None,
    trim_t_pose: motion_options.TrimTPose = False,
    uneven_floor: motion_options.UnevenFloor = False,
    motions: Motions = None,
    overwrite: OverwriteFiles = False,
    as_json: Json = False,
) -> None:
    """Show facts about a motion, as retargeted to the character.

    Frames, duration, the file's skeleton and units, distance walked, foot contacts, T-poses, and
    heights over the floor. With --out also a 3D recording and a filmstrip.
    """
    from dynresp.cli.motion_facts import motion_facts

    options = motion_options.options(unit, up, fps, asf, trim_t_pose, uneven_floor)
    loaded, file = motion_options.load(motion, motions, options)
    if out is not None:
        check_folder(out)
        check_new([out / name for name in PICTURES], overwrite)
    found = motion_facts(loaded, file, options)
    if out is not None:
        _draw(loaded, out)
    if as_json:
        typer.echo(json.dumps({"motion": motion, **found}, indent=2))
    else:
        typer.echo("\n".join([motion, *_lines(found)]))


def _draw(motion: Motion, out: Path) -> None:
    from dynresp.view.filmstrip import write_filmstrip
    from dynresp.view.recording import write_recording
    from dynresp.view.story import Story, StoryPhase

    # Most files have 120 frames a second, more than a screen shows.
    shown = motion.resampled(30.0) if motion.fps > 30.0 else motion
    story = Story(
        shown,
        phases=[StoryPhase("base motion", 0.0, shown.duration)],
        title=motion.name,
        subtitle=f"{motion.duration:.1f} s",
    )
    recording, filmstrip = PICTURES
    typer.echo(f"writing {recording} and {filmstrip} ...", err=True)
    write_recording(story, out / recording)
    write_filmstrip(story, out / filmstrip)


def _lines(found: dict[str, Any]) -> list[str]:
    ranges = ", ".join(f"{start:.2f} to {stop:.2f} s" for start, stop in found["t_poses_s"])
    frames = f"{found['frames']} frames at {found['fps']:g} fps"
    lines = [f"  duration   {found['duration_s']:.2f} s, {frames}"]
    if found["file"] is not None:
        file = found["file"]
        lines.append(
            f"  file       {file['joints']} joints, unit {file['unit_m']:.6g} m, {file['up']} up, "
            f"legs {file['leg_m']:.2f} m long"
        )
    low, high = found["pelvis_height_m"]
    left, right = found["standing"]
    return [
        *lines,
        f"  distance   {found['distance_m']:.2f} m over the ground, "
        f"pelvis {low:.2f} to {high:.2f} m high",
        f"  contacts   left foot stands {left:.0%} of the time, right {right:.0%}",
        f"  T-poses    {ranges or 'none'}",
        f"  floor      lowest point of the feet at {100 * found['lowest_foot_m']:.1f} cm, "
        f"of other bodies {100 * found['lowest_body_m']:.1f} cm",
    ]
