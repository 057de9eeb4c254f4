"""Features of a silhouette: its shape, and the motion of its centre (Lee et al. 2002, 5.3).

The paper describes a shape by the seven Hu moments. They do not change when a shape is turned in
the picture; when it is mirrored, only the sign of the seventh does. So poses that differ may look
alike to them. By default a shape is therefore described by a grid over the silhouette, whose size
follows the silhouette's spread. Like Hu's moments it depends neither on where the person is nor on
how tall or how far away. The covered share of each cell is then reduced to principal components.

Of the centre only its motion counts. Its speed is measured in silhouette radii a second. The radius
is the root mean square distance of a silhouette's points from its centre: about a quarter of the
height of a standing person.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.vision.segmentation import Mask
from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number
from dynresp.support.extras import require

# The grid: rows and columns, and how far it reaches from the centre up and aside [radii].
_GRID = (12, 8)
_REACH = (2.4, 1.6)
# Each of Hu's moments is a sum of products of so many moments; these roots have similar sizes.
_DEGREES = np.array([1.0, 2.0, 2.0, 2.0, 4.0, 3.0, 4.0])


class Shape(Enum):
    """How the shape of a silhouette is described."""

    GRID = "grid"
    """The covered share of each cell of a grid."""
    HU = "hu"
    """The seven Hu moments, as in the paper."""


@dataclass(frozen=True)
class FeatureConfig:
    """Which features are compared, and their weights.

    All of it is written to the file of silhouettes, and is part of its identity.

    Attributes:
        shape: How shapes are described.
        components: Number of principal components of the grid.
        span_s: Speeds are means over this time up to now [s].
        distance_m: Assumed distance of the camera [m]; from it follows how fast a person who comes
            nearer seems to grow.
        shape_weight: Weight of the squared distance of shapes.
        speed_weight: Weight of the squared differences of the centre's speeds, right and up.
        growth_weight: Weight of the squared difference of growth.
    """

    shape: Shape = Shape.GRID
    components: int = 30
    span_s: float = 0.4
    distance_m: float = 6.0
    shape_weight: float = 2.0
    speed_weight: float = 2.0
    growth_weight: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One of them is out of range.
        """
        check_number("components", self.components, 1, _GRID[0] * _GRID[1], whole=True)
        for name in ("span_s", "distance_m"):
            check_number(name, getattr(self, name), 0.0, above_low=True)
        for name in ("shape_weight", "speed_weight", "growth_weight"):
            check_number(name, getattr(self, name), 0.0)


@dataclass(frozen=True)
class Measures:
    """What is measured of one silhouette.

    Attributes:
        shape: (96,) covered shares of the grid, row by row from the top left, or (7,) signed roots
            of Hu's moments.
        right: The centre's distance from the picture's left edge [pixels].
        up: The centre's height over the picture's upper edge, so below 0 [pixels].
        radius: Root mean square distance of the silhouette's points from the centre [pixels].
    """

    shape: FloatArray
    right: float
    up: float
    radius: float


def measure(mask: Mask, shape: Shape) -> Measures | None:
    """Measure a silhouette.

    Args:
        mask: (height, width), not 0 inside the silhouette.
        shape: How to describe its shape.

    Returns:
        What is measured; None if the mask is empty.
    """
    require("cv2")
    import cv2

    moments = cv2.moments(mask, binaryImage=True)
    area = moments["m00"]
    if area == 0.0:
        return None
    x, y = moments["m10"] / area, moments["m01"] / area
    # A single pixel has a spread, too.
    radius = max(((moments["mu20"] + moments["mu02"]) / area) ** 0.5, 0.4)
    if shape is Shape.HU:
        described = signed_roots(np.asarray(cv2.HuMoments(moments), dtype=np.float64)[:, 0])
    else:
        described = _grid(mask, x, y, radius)
    return Measures(described, float(x), -float(y), float(radius))


def signed_roots(hu: npt.NDArray[Any]) -> FloatArray:
    """The root of each of Hu's moments (..., 7), by its degree, with the moment's sign.

    The moments span many powers of ten, so their logarithms are often used. But a logarithm jumps
    where a moment passes through 0, as four of them do whenever a shape is symmetric; a root does
    not.
    """
    return np.asarray(np.sign(hu) * np.abs(hu) ** (1.0 / _DEGREES), dtype=np.float64)


def _grid(mask: Mask, x: float, y: float, radius: float) -> FloatArray:
    """Covered shares (96,) of the cells of a grid about a point; all in pixels."""
    import cv2

    rows, columns = mask.shape
    high, wide = _REACH[0] * radius, _REACH[1] * radius
    top, bottom = round(y - high), round(y + high) + 1
    left, right = round(x - wide), round(x + wide) + 1
    cut = np.zeros((bottom - top, right - left), dtype=np.float32)
    inside = mask[max(top, 0) : min(bottom, rows), max(left, 0) : min(right, columns)]
    row, column = max(-top, 0), max(-left, 0)
    cut[row : row + inside.shape[0], column : column + inside.shape[1]] = inside != 0
    cells = cv2.resize(cut, _GRID[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(cells, dtype=np.float64).ravel()


def speeds(tracks: npt.NDArray[Any], span: int, fps: float) -> npt.NDArray[Any]:
    """Mean speed over the last frames of each frame.

    Args:
        tracks: (frames, ...) positions in one clip.
        span: Over how many frames. There are fewer at the beginning; the first frame has the
            second one's speed.
        fps: Frames per second.

    Returns:
        Same shape as `tracks`, per second.
    """
    now = np.arange(len(tracks))
    now[0] = min(1, len(tracks) - 1)
    before = np.maximum(now - span, 0)
    passed = np.maximum(now - before, 1) / fps
    return (tracks[now] - tracks[before]) / passed.reshape(-1, *([1] * (tracks.ndim - 1)))
