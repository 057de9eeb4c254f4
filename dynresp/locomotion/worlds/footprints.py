"""The ground that a body covers in a pose: a box in its root's facing frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character, as_poses
from dynresp.motion.rotations import FloatArray


def footprints(character: Character, poses: npt.ArrayLike) -> FloatArray:
    """The ground that the body covers in each pose.

    Args:
        character: The character.
        poses: (frames, 59).

    Returns:
        (frames, 4) how far its geoms reach back, forward, right and left of the root [m]:
        smallest x, largest x, smallest y and largest y in the frame that has its origin under the
        root and its x axis where the root faces.
    """
    # Numba takes a third of a second to import, the kernel longer when first compiled.
    from dynresp.locomotion.worlds.footprint_kernel import footprints_kernel

    at = np.ascontiguousarray(as_poses(poses))
    out = np.empty((len(at), 4))
    footprints_kernel(at, body_arrays(character), out)
    return out


def body_arrays(character: Character) -> tuple[npt.NDArray[Any], ...]:
    """What the kernels need of a character.

    Returns:
        Parents (bodies,) and offsets (bodies, 3) of its bodies, as of `Character`; then for each
        of its geoms the body it belongs to, its kind, size (3), centre (3) and orientation (4) in
        that body's frame.
    """
    model = character.model
    return (
        character.parents.astype(np.int64),
        np.ascontiguousarray(character.offsets),
        model.geom_bodyid.astype(np.int64) - 1,
        model.geom_type.astype(np.int64),
        np.array(model.geom_size),
        np.array(model.geom_pos),
        np.array(model.geom_quat),
    )
