"""The product's own motion file: a NumPy `.npz` archive of plain arrays, format version 1.

An archive (`dynresp.support.archive`) of exactly these members, written by
`dynresp.motion.export.write_npz` and readable with `numpy.load(path, allow_pickle=False)`:

==================  =======  ============  =======================================================
member              dtype    shape         what it holds
==================  =======  ============  =======================================================
``format_version``  int64    ()            1; a reader refuses versions that it does not know
``character``       text     ()            `Character.identity` of the character that moves
``name``            text     ()            where the motion comes from, for people
``fps``             float64  ()            frames per second
``poses``           float64  (frames, 59)  rows of `qpos`: root position [m], root quaternion, 13
                                           joint quaternions, all w x y z and of unit length; Z up
``contacts``        bool     (frames, 2)   whether the left and the right foot stand
``label_names``     text     (labels,)     names of ranges of frames
``label_ranges``    int64    (labels, 2)   first frame, and one past the last
==================  =======  ============  =======================================================
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import POSE_SIZE, Character, default_character
from dynresp.motion.motion import Label, Motion
from dynresp.motion.readers.text import MAX_FILE_BYTES, file_error
from dynresp.support.archive import TEXT, ArchiveFormat
from dynresp.support.errors import MotionError, MotionFileError

FORMAT_VERSION = 1
"""Version of the format that is written, and the only one that is read."""
MAX_FRAMES = 250_000
"""Most frames of a motion (2.3 hours at 30 fps); reading it then stays below 1 GiB."""
MAX_LABELS = 10_000
"""Most labels of a motion."""

# A name in a shape stands for a length that the file chooses.
MEMBERS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "format_version": ("<i8", ()),
    "character": (TEXT, ()),
    "name": (TEXT, ()),
    "fps": ("<f8", ()),
    "poses": ("<f8", ("frames", POSE_SIZE)),
    "contacts": ("|b1", ("frames", 2)),
    "label_names": (TEXT, ("labels",)),
    "label_ranges": ("<i8", ("labels", 2)),
}
"""Members of the archive: type and shape."""

FORMAT = ArchiveFormat(
    what="motion",
    error=MotionFileError,
    version=FORMAT_VERSION,
    members=MEMBERS,
    most={"frames": MAX_FRAMES, "labels": MAX_LABELS},
    max_text=1_000,
    max_bytes=2 * MAX_FILE_BYTES,
)
"""What a motion file holds."""

_UNIT_LENGTH_TOLERANCE = 1e-6


def read_npz(path: str | Path, character: Character | None = None) -> Motion:
    """Read a motion of this character.

    Whatever the file says, little more memory is taken than a motion of `MAX_FRAMES` needs: sizes
    are checked before anything is unpacked, and no object is unpickled.

    Args:
        path: The file.
        character: The character that is to play the motion; the product's own by default.

    Returns:
        The motion, bit for bit as it was written.

    Raises:
        MotionFileError: The file cannot be opened, is damaged or out of bounds, is not a motion of
            dynresp, or belongs to another format version or another character.
    """
    path = Path(path)
    return _motion(path, FORMAT.read(path), character or default_character())


def _motion(path: Path, arrays: dict[str, npt.NDArray[Any]], character: Character) -> Motion:
    """The motion that the arrays hold, if it makes sense."""
    identity = arrays["character"].item()
    if identity != character.identity:
        raise file_error(
            path,
            f"is a motion of character {identity[:40]!r}, and this one is {character.identity!r}; "
            "import the motion again from the file that it was made from",
        )
    names, ranges = arrays["label_names"], arrays["label_ranges"]
    if len(names) != len(ranges):
        raise file_error(path, f"has {len(names)} label names but {len(ranges)} label ranges")
    labels = [Label(n, a, b) for n, (a, b) in zip(names.tolist(), ranges.tolist(), strict=True)]
    try:
        motion = Motion(
            arrays["poses"],
            float(arrays["fps"]),
            arrays["name"].item(),
            arrays["contacts"],
            tuple(labels),
        )
    except MotionError as error:
        raise file_error(path, str(error)) from error
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(arrays["poses"][:, 3:].reshape(-1, 4), axis=1)
    wrong = ~(np.abs(lengths - 1.0) <= _UNIT_LENGTH_TOLERANCE)
    if wrong.any():
        frame, quaternion = divmod(int(np.argmax(wrong)), (POSE_SIZE - 3) // 4)
        raise file_error(
            path,
            f"quaternions must be of unit length; number {quaternion} of frame {frame} has "
            f"the length {lengths[frame * ((POSE_SIZE - 3) // 4) + quaternion]:g}",
        )
    return motion
