"""Draw silhouettes of the character as filled shapes, from viewpoints all around it.

The camera is far away: its rays are parallel, so a picture has one scale [m]. So the outline of a
capsule is a stadium, that of a ball a circle, and that of a box a hexagon. OpenCV fills the pixels
on their edges, too. That makes a silhouette about a centimetre wider all around, as clothes do.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.locomotion.vision.segmentation import Mask
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.extras import require

PIXEL = 0.03
"""Size of a pixel [m]."""
SIZE = 96
"""Pixels along a side: 2.9 m, with the pelvis in the middle."""

# Fractional bits of the coordinates that OpenCV gets.
_SHIFT = 4
# Points on each of the two round ends of a stadium.
_ROUND = 7
# Frames whose outlines are computed together: about 20 MB.
_CHUNK = 256


@dataclass(frozen=True)
class Viewpoints:
    """Cameras at equal angles around the vertical, which all look down by the same angle.

    Attributes:
        count: Number of cameras; the paper has 18 (section 5.3).
        elevation: How far they look down [rad].
    """

    count: int = 18
    elevation: float = math.radians(8.0)

    @property
    def step(self) -> float:
        """Angle between neighbours [rad]."""
        return 2.0 * math.pi / self.count

    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The directions right, up and away in the pictures: (count, 3) unit vectors of the world.

        Camera 0 looks along +X; the next one looks further to the left.
        """
        yaw = self.step * np.arange(self.count)
        cosine, sine, zero = np.cos(yaw), np.sin(yaw), np.zeros(self.count)
        ahead = np.stack([cosine, sine, zero], axis=1)
        right = np.stack([sine, -cosine, zero], axis=1)
        vertical = np.array([0.0, 0.0, 1.0])
        low, high = math.sin(self.elevation), math.cos(self.elevation)
        return right, low * ahead + high * vertical, high * ahead - low * vertical


def draw_silhouettes(
    poses: FloatArray, character: Character, views: Viewpoints
) -> Iterator[tuple[int, int, Mask]]:
    """Draw every pose from every viewpoint.

    Args:
        poses: (n, 59).
        character: Whose poses they are.
        views: The viewpoints.

    Yields:
        Numbers of pose and viewpoint, and the picture (SIZE, SIZE), top row first: 1 inside, 0
        outside. The pelvis (the root) is where four pixels meet in the middle. The next picture
        overwrites this one.
    """
    require("cv2")
    import cv2

    fill = cv2.fillConvexPoly
    picture = np.zeros((SIZE, SIZE), dtype=np.uint8)
    solids = _solids(character)
    right, up, _ = views.axes()
    for start in range(0, len(poses), _CHUNK):
        part = poses[start : start + _CHUNK]
        outlines = _outlines(part, character, solids, right, up)
        for frame in range(len(part)):
            for view in range(views.count):
                picture[:] = 0
                for outline in outlines:
                    fill(picture, outline[frame, view], 1, 8, _SHIFT)
                yield start + frame, view, picture


@dataclass(frozen=True, eq=False)
class _Solids:
    """The geoms of a character in the frames of their bodies.

    Attributes:
        round_bodies: (c,) bodies of capsules and balls.
        ends: (c, 2, 3) the two centres of each [m].
        radii: (c,) [m].
        box_bodies: (b,) bodies of boxes.
        centers: (b, 3) [m].
        half_edges: (b, 3, 3) half edges, one a row [m].
    """

    round_bodies: npt.NDArray[np.intp]
    ends: FloatArray
    radii: FloatArray
    box_bodies: npt.NDArray[np.intp]
    centers: FloatArray
    half_edges: FloatArray


@functools.lru_cache(maxsize=4)
def _solids(character: Character) -> _Solids:
    model = character.model
    is_box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
    is_capsule = model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE
    boxes, others = np.flatnonzero(is_box), np.flatnonzero(~is_box)
    half = np.where(is_capsule, model.geom_size[:, 1], 0.0)[others]
    along = rotations.rotate(model.geom_quat[others], np.array([0.0, 0.0, 1.0])) * half[:, None]
    centers = model.geom_pos[others]
    edges = model.geom_size[boxes][:, :, None] * np.eye(3)
    return _Solids(
        model.geom_bodyid[others] - 1,
        np.stack([centers - along, centers + along], axis=1),
        model.geom_size[others, 0].copy(),
        model.geom_bodyid[boxes] - 1,
        model.geom_pos[boxes].copy(),
        rotations.rotate(model.geom_quat[boxes][:, None], edges),
    )


def _outlines(
    poses: FloatArray, character: Character, solids: _Solids, right: FloatArray, up: FloatArray
) -> list[npt.NDArray[np.int32]]:
    """Outlines of all solids, each (frames, views, points, 2), in OpenCV's fixed-point numbers."""
    states = character.kinematics(poses)
    root = states.positions[:, :1]
    axes = np.stack([right, -up], axis=-1)  # (views, 3, 2): columns and rows of the picture

    def seen(bodies: npt.NDArray[np.intp], points: FloatArray, turned_only: bool) -> FloatArray:
        """Points (k, p, 3) of bodies (k,) in the pictures: (frames, views, k, p, 2) [m].

        With `turned_only` they are vectors, which the body's position does not move.
        """
        world = rotations.rotate(states.quaternions[:, bodies, None], points)
        if not turned_only:
            world += (states.positions[:, bodies] - root)[:, :, None]
        return np.einsum("fkpx,vxc->fvkpc", world, axes)

    ends = seen(solids.round_bodies, solids.ends, turned_only=False)
    along = ends[..., 1, :] - ends[..., 0, :]
    angle = np.arctan2(along[..., 1], along[..., 0])[..., None]
    swing = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _ROUND)
    # A polygon in a circle covers less than the circle; a slightly larger radius makes up for it.
    radii = solids.radii[:, None] / math.cos(0.25 * math.pi / (_ROUND - 1))
    arc = angle + swing
    offset = np.stack([radii * np.cos(arc), radii * np.sin(arc)], axis=-1)
    stadium = np.concatenate(
        [ends[..., 1:2, :] + offset, ends[..., 0:1, :] - offset], axis=-2
    )  # fmt: skip
    center = seen(solids.box_bodies, solids.centers[:, None], turned_only=False)
    edges = seen(solids.box_bodies, solids.half_edges, turned_only=True)
    shapes = [stadium[:, :, k] for k in range(len(solids.radii))]
    shapes += [center[:, :, k] + _hexagon(edges[:, :, k]) for k in range(len(solids.centers))]
    # In OpenCV, whole numbers are the centres of pixels.
    return [
        np.round((shape / PIXEL + 0.5 * (SIZE - 1)) * (1 << _SHIFT)).astype(np.int32)
        for shape in shapes
    ]


def _hexagon(edges: FloatArray) -> FloatArray:
    """Outline (..., 6, 2) of a box about its centre from its half edges (..., 3, 2) in the picture.

    The outline of a box is the sum of three segments, its edges. Turned to point upwards and sorted
    by direction, they are the sides of the hexagon.
    """
    upwards = np.where(edges[..., 1:] < 0, -edges, edges)
    order = np.argsort(np.arctan2(upwards[..., 1], upwards[..., 0]), axis=-1)
    a, b, c = np.moveaxis(np.take_along_axis(upwards, order[..., None], axis=-2), -2, 0)
    half = np.stack([a - b - c, a + b - c, a + b + c], axis=-2)
    return np.concatenate([half, -half], axis=-2)
