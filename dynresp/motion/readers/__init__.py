"""Readers of motion files: BVH, Acclaim ASF/AMC, DeepMimic JSON."""

from __future__ import annotations

from pathlib import Path

from dynresp.motion.readers.asf_amc import read_asf_amc
from dynresp.motion.readers.bvh import read_bvh
from dynresp.motion.readers.deepmimic import read_deepmimic
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.readers.text import file_error
from dynresp.support.errors import MotionFileError

__all__ = [
    "SUFFIXES",
    "SkeletonMotion",
    "read_asf_amc",
    "read_bvh",
    "read_deepmimic",
    "read_motion_file",
]

SUFFIXES = (".bvh", ".amc", ".json", ".txt")
"""Suffixes of the files that `read_motion_file` reads; .json and .txt are DeepMimic's."""


def read_motion_file(
    path: str | Path,
    *,
    asf_path: str | Path | None = None,
    unit: float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> SkeletonMotion:
    """Read a motion file of any known format; its suffix says which.

    Args:
        path: The file.
        asf_path: Skeleton of an AMC file; None looks for it beside the file.
        unit: Metres per unit of the file; None finds it.
        up: "x", "y" or "z", the axis that points up; None finds it.
        fps: Frames per second; None takes what the file states.

    Raises:
        MotionFileError: If the suffix is unknown, the file cannot be read, or something is given
            that the format already fixes.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".amc":
        return read_asf_amc(path, asf_path, unit=unit, up=up, fps=fps)
    if asf_path is not None:
        raise file_error(path, "only an AMC file takes an ASF skeleton")
    if suffix == ".bvh":
        return read_bvh(path, unit=unit, up=up, fps=fps)
    if suffix in (".json", ".txt"):
        if unit is not None or up is not None:
            raise file_error(path, "DeepMimic files are in metres with Y up; leave out unit and up")
        return read_deepmimic(path, fps=fps)
    if suffix == ".asf":
        raise file_error(path, "is a skeleton without motion; read an AMC file that goes with it")
    raise MotionFileError(
        f"{path}: no motion format has the suffix {suffix!r}; known are {', '.join(SUFFIXES)}"
    )
