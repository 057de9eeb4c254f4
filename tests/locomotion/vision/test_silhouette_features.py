import cv2
import numpy as np
import pytest

from dynresp.locomotion.vision.silhouette_features import FeatureConfig, Shape, measure, speeds
from dynresp.support.errors import UsageError


def blob(size: int = 240, scale: float = 1.0, angle: float = 0.0, x: float = 0.0) -> np.ndarray:
    corners = scale * np.array([[-40, -60], [30, -50], [10, 0], [40, 70], [-20, 60]], dtype=float)
    cosine, sine = np.cos(angle), np.sin(angle)
    corners = corners @ np.array([[cosine, sine], [-sine, cosine]]) + [size / 2 + x, size / 2]
    picture = np.zeros((size, size), dtype=np.uint8)
    return cv2.fillPoly(picture, [corners.round().astype(np.int32)], 255)


def test_hu_moments_depend_on_neither_position_nor_size_nor_turning() -> None:
    plain = measure(blob(), Shape.HU)
    for other in (blob(x=30), blob(scale=0.6), blob(angle=0.7)):
        np.testing.assert_allclose(measure(other, Shape.HU).shape, plain.shape, atol=0.01)


def test_the_grid_depends_on_turning_only() -> None:
    plain = measure(blob(), Shape.GRID)
    assert plain.shape.shape == (96,)
    for other in (blob(x=30), blob(scale=0.6)):
        assert np.abs(measure(other, Shape.GRID).shape - plain.shape).mean() < 0.03
    assert np.abs(measure(blob(angle=0.7), Shape.GRID).shape - plain.shape).mean() > 0.08


def test_center_and_radius_of_a_disc() -> None:
    picture = cv2.circle(np.zeros((200, 300), dtype=np.uint8), (210, 80), 40, 1, -1)
    seen = measure(picture, Shape.GRID)
    assert (seen.right, seen.up) == pytest.approx((210, -80), abs=0.1)
    assert seen.radius == pytest.approx(40 / np.sqrt(2), rel=0.02)


@pytest.mark.parametrize("shape", list(Shape))
def test_silhouettes_beyond_the_picture_and_empty_ones(shape: Shape) -> None:
    corner = np.zeros((50, 40), dtype=np.uint8)
    assert measure(corner, shape) is None
    corner[:1, :1] = 1
    assert np.isfinite(measure(corner, shape).shape).all()
    corner[:30, :20] = 1
    assert np.isfinite(measure(corner, shape).shape).all()


def test_speeds_are_means_over_the_past() -> None:
    track = np.stack([np.arange(9.0) * 2, np.zeros(9)], axis=1)
    np.testing.assert_allclose(speeds(track, 3, 10.0), [[20.0, 0.0]] * 9)
    jump = np.array([0.0, 0, 0, 0, 6, 6, 6, 6, 6])
    np.testing.assert_allclose(speeds(jump, 3, 1.0), [0, 0, 0, 0, 2, 2, 2, 0, 0])
    assert speeds(np.array([[5.0]]), 3, 10.0).tolist() == [[0.0]]


@pytest.mark.parametrize(
    "wrong", [{"components": 0}, {"span_s": 0.0}, {"distance_m": np.inf}, {"shape_weight": -1.0}]
)
def test_settings_out_of_range_are_refused(wrong: dict) -> None:
    with pytest.raises(UsageError, match=next(iter(wrong))):
        FeatureConfig(**wrong)
