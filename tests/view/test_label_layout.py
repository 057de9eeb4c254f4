from __future__ import annotations

import numpy as np
import pytest

from dynresp.view.label_layout import place_labels, spread_figures


def test_spread_moves_only_to_the_right_and_clears() -> None:
    extents = np.array([[0.0, 1.0], [0.2, 1.4], [-1.0, 0.0], [9.0, 9.5]])
    shifts = spread_figures(extents, 0.1)
    assert shifts[0] == 0
    assert (np.diff(shifts) >= 0).all()
    moved = extents + shifts[:, None]
    widths = np.diff(extents, axis=1)[:, 0]
    covered = moved[:-1, 1] - moved[1:, 0]
    assert (covered <= 0.1 * np.minimum(widths[1:], widths[:-1]) + 1e-12).all()
    np.testing.assert_array_equal(spread_figures(extents[[0, 3]], 0.1), 0.0)


def test_spread_closes_wide_gaps() -> None:
    extents = np.array([[0.0, 1.0], [0.2, 1.4], [9.0, 9.5], [-3.0, -2.0]])
    moved = extents + spread_figures(extents, 0.1, 0.6)[:, None]
    gaps = moved[1:, 0] - moved[:-1, 1]
    assert (gaps >= -0.1 - 1e-12).all()
    assert gaps.max() == pytest.approx(0.6)


def test_labels_settle_without_overlap() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        anchors, widths = rng.uniform(0, 1, 9), rng.uniform(0.02, 0.1, 9)
        centers = place_labels(anchors, widths)
        order = np.argsort(anchors)
        gaps = np.diff(centers[order]) - 0.5 * (widths[order][1:] + widths[order][:-1])
        assert (gaps >= -1e-12).all()
        assert (centers - widths / 2 >= -1e-12).all()
        assert (centers + widths / 2 <= 1 + 1e-12).all()
    roomy = np.array([0.2, 0.8, 0.5])
    np.testing.assert_allclose(place_labels(roomy, np.full(3, 0.1)), roomy)
