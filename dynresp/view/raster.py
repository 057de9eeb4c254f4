"""A small renderer in plain NumPy, for machines without graphics.

A parallel projection, one light, soft shadows on the floor z = 0. All triangles become pixels at
once, and each pixel keeps the triangle nearest to the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.view.body_shapes import Mesh

# Where the light comes from, as seen by the camera: right, up, towards the camera.
_LIGHT = np.array([-0.48, 0.66, 0.58])
_LIGHT = _LIGHT / np.linalg.norm(_LIGHT)

# Bands of a shadow: lowest and highest part that throws it [m], blur of its edge [m], darkness.
# Higher parts throw a wider and fainter shadow.
_SHADOW_BANDS = ((-np.inf, 0.10, 0.03, 0.85), (0.0, 0.6, 0.08, 0.45), (0.0, np.inf, 0.16, 0.35))
_SHADOW_PIXEL = 0.01


@dataclass(frozen=True, eq=False)
class Projection:
    """A camera with parallel rays.

    Attributes:
        right: (3,) unit vector of the world that points right in the picture.
        up: (3,) unit vector that points up in the picture.
        towards: (3,) unit vector from the scene to the camera.
    """

    right: FloatArray
    up: FloatArray
    towards: FloatArray

    @classmethod
    def looking(cls, yaw: float, elevation: float) -> Projection:
        """A camera that looks in a direction and down.

        Args:
            yaw: Direction in which it looks [rad], counter-clockwise from +X.
            elevation: How far it looks down [rad].
        """
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
        vertical = np.array([0.0, 0.0, 1.0])
        towards = -np.cos(elevation) * ahead + np.sin(elevation) * vertical
        up = np.sin(elevation) * ahead + np.cos(elevation) * vertical
        return cls(right, up, towards)

    def screen(self, points: npt.ArrayLike) -> FloatArray:
        """Project points (..., 3) of the world: right, up and towards the camera [m]."""
        axes = np.stack([self.right, self.up, self.towards], axis=-1)
        return np.asarray(points, dtype=np.float64) @ axes


@dataclass(frozen=True, eq=False)
class Layer:
    """A picture with transparency, its edges on whole pixels.

    Attributes:
        rgba: (height, width, 4) colour already multiplied by alpha, and alpha, 0 to 1, top row
            first.
        left: Screen coordinate of its left edge in pixels.
        top: Screen coordinate of its upper edge in pixels, counted upwards.
    """

    rgba: npt.NDArray[np.floating[Any]]
    left: int
    top: int


class Canvas:
    """A picture onto which layers are pasted, one over the other.

    Attributes:
        rgba: (height, width, 4) as in `Layer`.
        left: Screen coordinate of its left edge in pixels.
        top: Screen coordinate of its upper edge in pixels, counted upwards.
    """

    def __init__(self, left: int, top: int, width: int, height: int) -> None:
        """Make an empty canvas; edges and size in pixels."""
        self.rgba = np.zeros((height, width, 4), dtype=np.float32)
        self.left, self.top = left, top

    def paste(self, layer: Layer, right: int = 0, up: int = 0, alpha: float = 1.0) -> None:
        """Paste a layer over what is there, moved by whole pixels; what sticks out is cut off."""
        row, column = self.top - layer.top - up, layer.left + right - self.left
        height, width = self.rgba.shape[:2]
        rows = slice(max(row, 0), max(min(row + len(layer.rgba), height), 0))
        columns = slice(max(column, 0), max(min(column + layer.rgba.shape[1], width), 0))
        over = (
            alpha
            * layer.rgba[
                rows.start - row : max(rows.stop - row, 0),
                columns.start - column : max(columns.stop - column, 0),
            ]
        )
        here = self.rgba[rows, columns]
        here *= 1.0 - over[..., 3:]
        here += over

    def picture(self) -> npt.NDArray[np.uint8]:
        """(height, width, 4), 0 to 255, colours not multiplied by alpha, as image files need it."""
        # Where nothing is drawn, colours are 0 already.
        scaled = self.rgba * (255.0 / np.maximum(self.rgba[..., 3:], 1e-6))
        scaled[..., 3] = 255.0 * self.rgba[..., 3]
        scaled += 0.5
        return np.minimum(scaled, 255.0, out=scaled).astype(np.uint8)


def draw(
    meshes: Sequence[Mesh],
    view: Projection,
    pixel: float,
    samples: int = 2,
    canvas: Canvas | None = None,
) -> Layer:
    """Draw shaded solids on a transparent layer, nearer ones over farther ones.

    Args:
        meshes: At least one, in the world.
        view: The camera.
        pixel: Size of a pixel [m].
        samples: Rays across a pixel; more make smoother edges.
        canvas: The canvas it will be pasted onto, unmoved: nothing is drawn outside of it.

    Returns:
        The smallest layer that holds them.
    """
    scene = _Triangles.of(meshes, view)
    corner, (width, height) = _grid(scene.corners[..., :2], pixel)
    if canvas is not None:
        rows, columns = canvas.rgba.shape[:2]
        first = np.maximum(corner, (canvas.left, canvas.top - rows))
        last = np.minimum(corner + np.array([width, height]), (canvas.left + columns, canvas.top))
        corner, (width, height) = first, np.maximum(last - first, 0).astype(int).tolist()
    low, step = corner * pixel, pixel / samples
    shape = (height * samples, width * samples)
    triangle, column, row = _cover(scene.corners[..., :2], low, step, shape)
    # Counted from the corner of the picture, single precision is enough, and twice as fast.
    x = ((column + 0.5) * step).astype(np.float32)
    y = ((row + 0.5) * step).astype(np.float32)
    planes = scene.planes(low).astype(np.float32)
    depth = planes[triangle, 0, 0] + planes[triangle, 1, 0] * x + planes[triangle, 2, 0] * y
    index = row * shape[1] + column
    nearest = np.full(shape[0] * shape[1], -np.inf, dtype=np.float32)
    np.maximum.at(nearest, index, depth)
    seen = depth == nearest[index]
    triangle, index, x, y = triangle[seen], index[seen], x[seen, None], y[seen, None]
    normals = planes[triangle, 0, 1:] + planes[triangle, 1, 1:] * x + planes[triangle, 2, 1:] * y
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    fine = np.zeros((len(nearest), 4), dtype=np.float32)
    fine[index, :3] = _shade(scene.colors[triangle].astype(np.float32), normals)
    fine[index, 3] = 1.0
    rgba = fine.reshape(height, samples, width, samples, 4).mean(axis=(1, 3))
    return Layer(rgba[::-1], int(corner[0]), int(corner[1]) + height)


def floor_shadow(meshes: Sequence[Mesh], yaw: float, elevation: float, pixel: float) -> Layer:
    """The soft black shadow that solids throw on the floor.

    Args:
        meshes: At least one, in the world.
        yaw: Direction in which the camera looks, as in `Projection.looking`.
        elevation: How far it looks down [rad].
        pixel: Size of a pixel [m].

    Returns:
        A layer in the camera's picture; alpha is 0 (light) to 1 (dark).
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    # From straight above; the camera sees the floor foreshortened by sin(elevation).
    above = Projection.looking(yaw, 0.5 * np.pi)
    scene = _Triangles.of(meshes, above, both_sides=True)
    flat = scene.corners[..., :2]
    reach = 3.0 * max(blur for *_, blur, _ in _SHADOW_BANDS)
    corner, (width, height) = _grid(flat, _SHADOW_PIXEL, reach)
    low = corner * _SHADOW_PIXEL
    triangle, column, row = _cover(flat, low, _SHADOW_PIXEL, (height, width))
    heights = scene.corners[triangle, :, 2].mean(axis=1)
    light = np.ones((height, width))
    for bottom, top, blur, darkness in _SHADOW_BANDS:
        band = (heights >= bottom) & (heights <= top)
        mask = np.zeros((height, width))
        mask[row[band], column[band]] = 1.0
        light *= 1.0 - darkness * gaussian_filter(mask, blur / _SHADOW_PIXEL)
    squeeze = np.array([1.0, np.sin(elevation)])
    left_low = np.floor(low * squeeze / pixel).astype(int)
    right_top = np.ceil((low + np.array([width, height]) * _SHADOW_PIXEL) * squeeze / pixel)
    x, y = (
        ((np.arange(left_low[i], int(right_top[i])) + 0.5) * pixel / squeeze[i] - low[i])
        / _SHADOW_PIXEL - 0.5
        for i in (0, 1)
    )  # fmt: skip
    dark = map_coordinates(1.0 - light, np.meshgrid(y[::-1], x, indexing="ij"), order=1)
    rgba = np.zeros((*dark.shape, 4))
    rgba[..., 3] = dark
    return Layer(rgba, int(left_low[0]), int(right_top[1]))


@dataclass(frozen=True, eq=False)
class _Triangles:
    """Triangles in the picture's frame: right, up, towards the camera.

    Attributes:
        corners: (n, 3 corners, 3) [m].
        normals: (n, 3 corners, 3).
        colors: (n, 3).
    """

    corners: FloatArray
    normals: FloatArray
    colors: FloatArray

    @classmethod
    def of(cls, meshes: Sequence[Mesh], view: Projection, both_sides: bool = False) -> _Triangles:
        corners, normals, colors = [], [], []
        for mesh in meshes:
            corner = view.screen(mesh.vertices)[mesh.faces]
            edges = corner[:, 1:, :2] - corner[:, :1, :2]
            area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
            kept = np.abs(area) > 1e-12 if both_sides else area > 1e-12
            corners.append(corner[kept])
            normals.append(view.screen(mesh.normals)[mesh.faces][kept])
            colors.append(np.broadcast_to(mesh.color, (int(kept.sum()), 3)))
        return cls(np.concatenate(corners), np.concatenate(normals), np.concatenate(colors))

    def planes(self, origin: FloatArray) -> FloatArray:
        """(n, 3, 4) coefficients of depth and normal in (1, x, y) over each triangle.

        Args:
            origin: (2,) point of the picture where x and y are 0.
        """
        ones = np.ones((*self.corners.shape[:2], 1))
        base = np.concatenate([ones, self.corners[..., :2] - origin], axis=-1)
        values = np.concatenate([self.corners[..., 2:], self.normals], axis=-1)
        return np.linalg.solve(base, values)


def _grid(points: FloatArray, pixel: float, margin: float = 0.0) -> tuple[FloatArray, list[int]]:
    """Lower left corner and size, both in pixels, of a picture around points (..., 2) [m]."""
    flat = points.reshape(-1, 2)
    low = np.floor((flat.min(axis=0) - margin) / pixel - 1)
    return low, [int(n) for n in np.ceil((flat.max(axis=0) + margin) / pixel + 1) - low]


def _cover(
    corners: FloatArray, low: FloatArray, step: float, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Find which samples are inside which triangles.

    Args:
        corners: (n, 3, 2) [m].
        low: (2,) corner of the canvas [m].
        step: Distance of samples [m].
        shape: Rows and columns of samples.

    Returns:
        Triangle, column and row of each covered sample, as three arrays of one length.
    """
    # In sample units, with samples at whole numbers.
    at = (corners - low) / step - 0.5
    first = np.maximum(np.ceil(at[..., 1].min(axis=1)), 0).astype(np.intp)
    last = np.minimum(np.floor(at[..., 1].max(axis=1)), shape[0] - 1).astype(np.intp)
    triangle, row = _ranges(first, last)
    y = row.astype(np.float64)
    left = np.full(len(row), np.inf)
    right = np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = at[triangle, i], at[triangle, j]
        rise = b[:, 1] - a[:, 1]
        level = rise == 0
        t = (y - a[:, 1]) / np.where(level, 1.0, rise)
        crossed = ~level & (t >= 0) & (t <= 1)
        x = a[:, 0] + t * (b[:, 0] - a[:, 0])
        left = np.where(crossed, np.minimum(left, x), left)
        right = np.where(crossed, np.maximum(right, x), right)
    met = right >= left
    triangle, row, left, right = triangle[met], row[met], left[met], right[met]
    span, column = _ranges(
        np.maximum(np.ceil(left), 0).astype(np.intp),
        np.minimum(np.floor(right), shape[1] - 1).astype(np.intp),
    )
    return triangle[span], column, row[span]


def _ranges(
    first: npt.NDArray[np.intp], last: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """All whole numbers of each range from first to last: index of the range, and the number."""
    count = np.maximum(last - first + 1, 0)
    which = np.repeat(np.arange(len(first)), count)
    start = np.cumsum(count) - count
    return which, np.arange(len(which)) - start[which] + first[which]


def _shade(
    colors: npt.NDArray[np.float32], normals: npt.NDArray[np.float32]
) -> npt.NDArray[np.float32]:
    """Lit colours (n, 3), from normals (n, 3) in the picture's frame."""
    lit = np.clip(normals @ _LIGHT.astype(np.float32), 0.0, 1.0)
    sky = 0.5 + 0.5 * normals[:, 1]
    away = 1.0 - np.clip(normals[:, 2], 0.0, 1.0)
    # Surfaces that turn away from the camera are darker, so that limbs stand out.
    brightness = (0.42 + 0.22 * sky + 0.52 * lit) * (1.0 - 0.30 * away * away * away)
    gloss = lit * lit * lit
    shaded = colors * brightness[:, None] + 0.05 * (gloss * gloss * gloss)[:, None]
    return np.asarray(np.clip(shaded, 0.0, 1.0))
