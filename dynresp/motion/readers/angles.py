"""Rotations from angles about coordinate axes, in any order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynresp.motion.rotations import FloatArray, identity, multiply


def rotations_about_axes(axes: Sequence[int], angles: FloatArray) -> FloatArray:
    """Product of rotations about coordinate axes: R(axes[0]) R(axes[1]) ...

    The last factor is applied first to a vector. Or, which is the same: each rotation is about the
    axis as the rotations before it have turned it.

    Args:
        axes: 0, 1 or 2 for x, y or z; any number of them, in any order.
        angles: Angles [rad], (frames, len(axes)).

    Returns:
        Quaternions w x y z, (frames, 4).
    """
    result = identity(len(angles))
    half = 0.5 * angles
    cosine, sine = np.cos(half), np.sin(half)
    for column, axis in enumerate(axes):
        turn = np.zeros((len(angles), 4))
        turn[:, 0] = cosine[:, column]
        turn[:, 1 + axis] = sine[:, column]
        result = multiply(result, turn) if column else turn
    return result
