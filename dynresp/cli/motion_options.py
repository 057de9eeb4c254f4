"""What a user can tell about a motion file, and how such a file is found and loaded."""

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
    typer.Option("--unit", min=1e-4, max=100.0, help="Metres per unit; found if not told."),
]
Up: TypeAlias = Annotated[
    Axis | None, typer.Option("--up", help="The axis that points up; found if not told.")
]
Fps: TypeAlias = Annotated[
    float | None,
    typer.Option("--fps", min=1.0, max=10_000.0, help="Frames a second, if the file lies."),
]
Asf: TypeAlias = Annotated[
    Path | None,
    typer.Option("--asf", metavar="FILE", help="Skeleton of an AMC file; found beside it."),
]
TrimTPose: TypeAlias = Annotated[
    bool, typer.Option("--trim-t-pose", help="Cut T-poses off both ends.")
]
UnevenFloor: TypeAlias = Annotated[
    bool,
    typer.Option("--uneven-floor", help="The person did not stand on level ground."),
]
Name: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="MOTION",
        help="A file, a path inside a motions folder, or builtin:walk and the like.",
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
    """What was told, for the loader."""
    from dynresp.motion.load import LoadOptions

    return LoadOptions(
        unit=unit,
        up=None if up is None else up.value,
        fps=fps,
        asf=asf,
        flat_floor=not uneven_floor,
        trim_t_poses=trim_t_pose,
    )


def load(name: str, motions: Path | None, told: LoadOptions) -> tuple[Motion, Path | None]:
    """Load a motion by its name.

    Args:
        name: A file, a path inside a motions folder, or a built-in motion.
        motions: Motions folder that the user named.
        told: What to tell the reader.

    Returns:
        The motion, and its file; None for a built-in motion.

    Raises:
        MissingMotionDataError: It is nowhere.
        DynrespError: It cannot be read.
    """
    from dynresp.motion.named_motion import load_named_motion

    return load_named_motion(name, motions, options=told)
