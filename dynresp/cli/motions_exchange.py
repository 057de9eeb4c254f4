"""`dynresp motions import` and `export`: other people's files in, files for other programs out."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli import motion_options as told
from dynresp.cli.options import Json, Motions

Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]


class Format(StrEnum):
    """A format that is written."""

    bvh = "bvh"
    npz = "npz"


def import_motions(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="BVH, AMC, DeepMimic or .npz files.")
    ],
    out: Out,
    unit: told.Unit = None,
    up: told.Up = None,
    fps: told.Fps = None,
    asf: told.Asf = None,
    trim_t_pose: told.TrimTPose = False,
    uneven_floor: told.UnevenFloor = False,
    as_json: Json = False,
) -> None:
    """Lay motion files onto the character, and write each as DIR/NAME.npz."""
    from dynresp.motion.character import default_character
    from dynresp.motion.export import write_npz
    from dynresp.motion.load import load_motion

    options = told.options(unit, up, fps, asf, trim_t_pose, uneven_floor)
    targets = _targets(files, out)
    rows = []
    for file, target in zip(files, targets, strict=True):
        typer.echo(f"importing {file} ...", err=True)
        motion = load_motion(file, options=options)
        write_npz(motion, target, default_character())
        rows.append({"file": str(file), "written": str(target), "frames": len(motion)})
    if as_json:
        typer.echo(json.dumps({"imported": rows}, indent=2))
    else:
        typer.echo("\n".join(str(row["written"]) for row in rows))


def export(
    motion: told.Name,
    out: Out,
    file_format: Annotated[
        Format, typer.Option("--format", help="bvh opens in Blender, npz in NumPy.")
    ] = Format.bvh,
    unit: told.Unit = None,
    up: told.Up = None,
    fps: told.Fps = None,
    asf: told.Asf = None,
    trim_t_pose: told.TrimTPose = False,
    uneven_floor: told.UnevenFloor = False,
    motions: Motions = None,
    as_json: Json = False,
) -> None:
    """Write a motion, as it is laid onto the character, for other programs."""
    from dynresp.motion.character import default_character
    from dynresp.motion.export import write_bvh, write_npz

    options = told.options(unit, up, fps, asf, trim_t_pose, uneven_floor)
    loaded, file = told.load(motion, motions, options)
    stem = motion.partition(":")[2] if file is None else file.stem
    target = out / f"{stem}.{file_format.value}"
    write = write_bvh if file_format is Format.bvh else write_npz
    write(loaded, target, default_character())
    if as_json:
        row = {"motion": motion, "written": str(target), "frames": len(loaded), "fps": loaded.fps}
        typer.echo(json.dumps(row, indent=2))
    else:
        typer.echo(str(target))


def _targets(files: list[Path], out: Path) -> list[Path]:
    """Where each file goes.

    Raises:
        UsageError: Two would go to the same place.
    """
    from dynresp.support.errors import UsageError

    targets = [out / f"{file.stem}.npz" for file in files]
    twice = [target for target in targets if targets.count(target) > 1]
    if twice:
        raise UsageError(
            f"more than one file would be written as {twice[0]}; import them to different folders"
        )
    return targets
