"""The ground that a body covers in a pose: a box in its root's facing frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character, as_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import frozen

if TYPE_CHECKING:
    from dynresp.locomotion.worlds.footprint_kernel import BodyShape


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
    footprints_kernel(at, body_shape(character), out)
    return out


def body_shape(character: Character) -> BodyShape:
    """What the kernels need of a character."""
    from dynresp.locomotion.worlds.footprint_kernel import BodyShape

    model = character.model
    return BodyShape(
        *(
            # The kernels' signatures know read-only arrays.
            frozen(np.array(array, order="C"))
            for array in (
                character.parents.astype(np.int64),
                character.offsets,
                model.geom_bodyid.astype(np.int64) - 1,
                model.geom_type.astype(np.int64),
                model.geom_size,
                model.geom_pos,
                model.geom_quat,
            )
        )
    )
