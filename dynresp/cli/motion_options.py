"""Options of commands that read a motion file, and loading it by them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

if TYPE_CHECKING:
    from dynresp.motion.load import LoadOptions
    from dynresp.motion.motion import Motion


class Axis(StrEnum):
    """An axis that can point up."""

    x = "x"
    y = "y"
    z = "z"


Unit: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--unit", min=1e-4, max=100.0, help="Metres per unit of the file; by default detected."
    ),
]
Up: TypeAlias = Annotated[
    Axis | None, typer.Option("--up", help="Axis of the file that points up; by default detected.")
]
Fps: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--fps", min=1.0, max=10_000.0, help="Frames a second, if the file states them wrong."
    ),
]
Asf: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--asf", metavar="FILE", help="Skeleton of an AMC file; by default the one in its folder."
    ),
]
TrimTPose: TypeAlias = Annotated[
    bool, typer.Option("--trim-t-pose", help="Cut off T-poses at the start and the end.")
]
UnevenFloor: TypeAlias = Annotated[
    bool,
    typer.Option("--uneven-floor", help="The person did not walk on level ground."),
]
Name: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="MOTION",
        help="A file, a path inside a motions folder, or a built-in motion such as builtin:walk.",
    ),
]


def options(
    unit: float | None,
    up: Axis | None,
    fps: float | None,
    asf: Path | None,
    trim_t_pose: bool,
    uneven_floor: bool,
) -> LoadOptions:
    """The options as the loader takes them."""
    from dynresp.motion.load import LoadOptions

    return LoadOptions(
        unit=unit,
        up=None if up is None else up.value,
        fps=fps,
        asf=asf,
        flat_floor=not uneven_floor,
        trim_t_poses=trim_t_pose,
    )


def load(name: str, motions: Path | None, options: LoadOptions) -> tuple[Motion, Path | None]:
    """Load a motion by its name.

    Args:
        name: A file, a path inside a motions folder, or a built-in motion.
        motions: Motions folder from the command line.
        options: How to read the file.

    Returns:
        The motion, and its file; None for a built-in motion.

    Raises:
        MissingMotionDataError: It is not on this machine.
        DynrespError: It cannot be read.
    """
    from dynresp.motion.named_motion import load_named_motion

    return load_named_motion(name, motions, options=options)
