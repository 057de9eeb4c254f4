"""Figures and labels placed along a line so that they do not cover each other."""

from __future__ import annotations

import numpy as np

from dynresp.motion.rotations import FloatArray


def spread_figures(extents: FloatArray, overlap: float, gap: float = np.inf) -> FloatArray:
    """Move figures to the right until each stands clear of the one before.

    Args:
        extents: (n, 2) left and right edges, in the order of time.
        overlap: Share of the narrower of two figures that may be covered.
        gap: A figure farther from the one before than this is moved closer to it.

    Returns:
        (n,) shifts; the first is 0. Without a bound on gaps none is smaller than the one before.
    """
    widths = extents[:, 1] - extents[:, 0]
    shifts = np.zeros(len(extents))
    for k in range(1, len(extents)):
        covered = overlap * min(widths[k - 1], widths[k])
        touching = extents[k - 1, 1] + shifts[k - 1] - extents[k, 0]
        shifts[k] = min(max(shifts[k - 1], touching - covered), touching + gap)
    return shifts


def place_labels(anchors: FloatArray, widths: FloatArray) -> FloatArray:
    """Centres of labels that do not overlap, as near to their anchors as possible (least squares).

    Args:
        anchors: (n,) where each label would be.
        widths: (n,) of the labels, in the same unit; together at most 1.

    Returns:
        (n,) centres, within 0 to 1.
    """
    from scipy.optimize import isotonic_regression

    order = np.argsort(anchors, kind="stable")
    ordered = widths[order]
    # With the widths of the labels before it taken off, a label only has to follow its neighbour.
    room = np.cumsum(ordered) - 0.5 * ordered
    free = isotonic_regression(anchors[order] - room).x
    centers = np.empty_like(anchors)
    centers[order] = np.clip(free, 0.0, max(1.0 - float(widths.sum()), 0.0)) + room
    return centers
