"""Where figures and their labels go so that they do not cover each other, along one line."""

from __future__ import annotations

import numpy as np

from dynresp.motion.rotations import FloatArray


def spread(extents: FloatArray, overlap: float, gap: float = np.inf) -> FloatArray:
    """How far to move figures to the right so that each stands clear of the one before.

    Args:
        extents: (n, 2) left and right edges, in the order of time.
        overlap: Share of the narrower figure of two that may be covered.
        gap: Figures farther from the one before than this are moved up to it.

    Returns:
        (n,) shifts, from 0; none smaller than the one before where there is no bound on gaps.
    """
    widths = extents[:, 1] - extents[:, 0]
    shifts = np.zeros(len(extents))
    for k in range(1, len(extents)):
        covered = overlap * min(widths[k - 1], widths[k])
        touching = extents[k - 1, 1] + shifts[k - 1] - extents[k, 0]
        shifts[k] = min(max(shifts[k - 1], touching - covered), touching + gap)
    return shifts


def settle(anchors: FloatArray, widths: FloatArray) -> FloatArray:
    """Centres of labels that do not overlap, as near to their anchors as can be (least squares).

    Args:
        anchors: (n,) where each label would be.
        widths: (n,) of the labels, in the same unit; together at most 1.

    Returns:
        (n,) centres, within 0 to 1.
    """
    from scipy.optimize import isotonic_regression

    order = np.argsort(anchors, kind="stable")
    ordered = widths[order]
    # Less the room of the labels before it, a label need only not be left of its neighbour.
    room = np.cumsum(ordered) - 0.5 * ordered
    free = isotonic_regression(anchors[order] - room).x
    centers = np.empty_like(anchors)
    centers[order] = np.clip(free, 0.0, max(1.0 - float(widths.sum()), 0.0)) + room
    return centers
