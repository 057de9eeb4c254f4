"""`dynresp motions import` and `export`: convert motion files."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dynresp.cli import motion_options
from dynresp.cli.options import Json, Motions, OverwriteFiles
from dynresp.cli.run import check_folder, check_new

Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]


class Format(StrEnum):
    """A format to write."""

    bvh = "bvh"
    npz = "npz"


def import_motions(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="BVH, AMC, DeepMimic or .npz files.")
    ],
    out: Out,
    unit: motion_options.Unit = None,
    up: motion_options.Up = None,
    fps: motion_options.Fps = None,
    asf: motion_options.Asf = None,
    trim_t_pose: motion_options.TrimTPose = False,
    uneven_floor: motion_options.UnevenFloor = False,
    overwrite: OverwriteFiles = False,
    as_json: Json = False,
) -> None:
    """Retarget motion files to the character, and write each as DIR/NAME.npz."""
    from dynresp.motion.character import default_character
    from dynresp.motion.export import write_npz
    from dynresp.motion.load import load_motion
    from dynresp.support.inputs import note_input

    options = motion_options.options(unit, up, fps, asf, trim_t_pose, uneven_floor)
    targets = _targets(files, out)
    check_folder(out)
    for file in files:
        # Each is an input already, although the later ones are read later.
        note_input(file)
    check_new(targets, overwrite)
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
    motion: motion_options.Name,
    out: Out,
    file_format: Annotated[
        Format, typer.Option("--format", help="bvh opens in Blender, npz in NumPy.")
    ] = Format.bvh,
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
    """Write a motion, as retargeted to the character, for other programs."""
    from dynresp.motion.character import default_character
    from dynresp.motion.export import write_bvh, write_npz

    options = motion_options.options(unit, up, fps, asf, trim_t_pose, uneven_floor)
    loaded, file = motion_options.load(motion, motions, options)
    stem = motion.partition(":")[2] if file is None else file.stem
    target = out / f"{stem}.{file_format.value}"
    check_folder(out)
    check_new([target], overwrite)
    write = write_bvh if file_format is Format.bvh else write_npz
    write(loaded, target, default_character())
    if as_json:
        row = {"motion": motion, "written": str(target), "frames": len(loaded), "fps": loaded.fps}
        typer.echo(json.dumps(row, indent=2))
    else:
        typer.echo(str(target))


def _targets(files: list[Path], out: Path) -> list[Path]:
    """The file to write for each file.

    Raises:
        UsageError: Two would be written as the same file.
    """
    from dynresp.support.errors import UsageError

    targets = [out / f"{file.stem}.npz" for file in files]
    twice = [target for target in targets if targets.count(target) > 1]
    if twice:
        raise UsageError(
            f"more than one file would be written as {twice[0]}; import them to different folders"
        )
    return targets
