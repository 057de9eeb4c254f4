"""Loading motions: a file of any format in, a motion of the character out."""

from __future__ import annotations

import functools
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import Motion
from dynresp.motion.readers import read_motion_file
from dynresp.motion.readers.npz import read_npz
from dynresp.motion.retargeting.retarget import retarget, trim_t_poses
from dynresp.support.errors import MotionError, MotionFileError

# Motions kept in memory; the whole development collection is about 150 MB.
_KEPT = 64

# Of each file: its path, when it was changed [ns], and its size [bytes].
_Stamps: TypeAlias = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class LoadOptions:
    """How to read a motion file, and what to do with its motion.

    Attributes:
        unit: Metres per unit of the file; None finds it.
        up: "x", "y" or "z", the file's axis that points up; None finds it.
        fps: Frames per second; None takes what the file states.
        asf: Skeleton file of an AMC file; None looks for it beside the file.
        flat_floor: Whether the source stood on level ground.
        trim_t_poses: Cut T-poses off both ends.
    """

    unit: float | None = None
    up: str | None = None
    fps: float | None = None
    asf: Path | None = None
    flat_floor: bool = True
    trim_t_poses: bool = False


def load_motion(
    path: Path | str, character: Character | None = None, options: LoadOptions | None = None
) -> Motion:
    """Read a motion file, carry it over to the character and set it on the floor.

    A file that has been loaded is kept in memory and read again only when it, or the skeleton
    of an AMC file, has changed.

    Args:
        path: A BVH, AMC, DeepMimic or .npz file.
        character: The character, by default the product's.
        options: How to read it, and what to do with the motion.

    Returns:
        The motion, at the file's frame rate.

    Raises:
        MotionFileError: The file cannot be read, or does not hold a person's motion.
    """
    character = character or default_character()
    options = options or LoadOptions()
    if options.asf is not None:
        options = replace(options, asf=options.asf.resolve())
    resolved = Path(path).resolve()
    try:
        stamps = _stamps(resolved, options.asf)
    except OSError as error:
        raise MotionFileError(f"{path}: cannot be read ({error.strerror})") from error
    return _load(resolved, stamps, character, options)


def _stamps(path: Path, asf: Path | None) -> _Stamps:
    """Paths, times and sizes of the motion file and of each skeleton that an AMC file may take.

    Args:
        path: The motion file, resolved.
        asf: The skeleton that was given, resolved.

    Raises:
        OSError: The motion file is not there.
    """
    files = [path]
    if asf is not None:
        files.append(asf)
    elif path.suffix.lower() == ".amc":
        for folder in (path.parent, path.parent.parent):
            with suppress(OSError):
                files += sorted(f for f in folder.iterdir() if f.suffix.lower() == ".asf")
    stamps = []
    for file in files:
        try:
            found = file.stat()
        except OSError:
            # The reader reports a skeleton that is missing.
            if file is path:
                raise
            continue
        stamps.append((str(file), found.st_mtime_ns, found.st_size))
    return tuple(stamps)


@functools.lru_cache(maxsize=_KEPT)
def _load(path: Path, stamps: _Stamps, character: Character, options: LoadOptions) -> Motion:
    # The stamps are only part of the cache's key.
    del stamps
    if path.suffix.lower() == ".npz":
        if (options.unit, options.up, options.fps, options.asf) != (None, None, None, None):
            raise MotionFileError(
                f"{path}: an .npz file states its unit, axes and frame rate; leave them out"
            )
        motion = read_npz(path, character)
    else:
        skeleton = read_motion_file(
            path, asf_path=options.asf, unit=options.unit, up=options.up, fps=options.fps
        )
        try:
            motion = retarget(skeleton, character, flat_floor=options.flat_floor)
        except MotionError as error:
            raise MotionFileError(f"{path}: {error}") from error
    return trim_t_poses(character, motion) if options.trim_t_poses else motion
