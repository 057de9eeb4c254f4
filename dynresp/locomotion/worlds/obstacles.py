"""Boxes on the ground, and distances of points and bodies to them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion.character import POSE_SIZE, Character, as_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number, check_vector
from dynresp.support.errors import UsageError

# Half the thickness of the walls around a world [m], too thick to pass through.
_RIM = 500.0
# No body of a character of human size is farther than this from its root [m].
_REACH = 1.5
# Limits of memory and time: planning in cells of 0.1 m over the largest world takes about 1.5 GB
# and half a minute.
_MAX_SIDE_M = 400.0
_MAX_AREA_M2 = 40_000.0
_MAX_CELLS = 5_000_000
MAX_BOXES = 10_000
"""Most boxes of a world."""
# The ground within this distance of each box [m], added up, is at most this large [m^2].
_NEAR_M, _MAX_NEAR_M2 = 2.0, 1e6


@dataclass(frozen=True)
class Obstacle:
    """A box that stands on the ground.

    Attributes:
        center: Middle of its base, x and y [m].
        half_sizes: Half its size along its own x and y [m].
        yaw: Angle about the vertical [rad].
        height: Its height [m].

    Raises:
        UsageError: A number is not finite, or a size is not above 0.
    """

    center: tuple[float, float]
    half_sizes: tuple[float, float]
    yaw: float = 0.0
    height: float = 2.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_vector("center of an obstacle", self.center, 2)
        check_vector("half_sizes of an obstacle", self.half_sizes, 2, above=0.0)
        check_number("yaw of an obstacle", self.yaw)
        check_number("height of an obstacle", self.height, 0.0, above_low=True)


@dataclass(frozen=True)
class World:
    """Level ground with a rim, and boxes on it. Leaving the rim counts as a collision.

    Attributes:
        bounds: Smallest x, smallest y, largest x, largest y [m].
        obstacles: The boxes; they may overlap.

    Raises:
        UsageError: The bounds enclose nothing, or more than 400 m along a side or 40,000 m^2; or
            there are more than 10,000 boxes, or boxes so large and many that the ground within 2 m
            of each, added up, is more than 1,000,000 m^2.
    """

    bounds: tuple[float, float, float, float]
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_vector("bounds", self.bounds, 4)
        low_x, low_y, high_x, high_y = self.bounds
        if not (low_x < high_x and low_y < high_y):
            raise UsageError(
                f"bounds must be (smallest x, smallest y, largest x, largest y), got {self.bounds}"
            )
        wide, deep = high_x - low_x, high_y - low_y
        if max(wide, deep) > _MAX_SIDE_M:
            raise UsageError(
                f"bounds must have sides of at most {_MAX_SIDE_M:g} m, got {wide:g} x {deep:g} m; "
                "cut the world to where the avatar walks"
            )
        area = wide * deep
        if area > _MAX_AREA_M2:
            raise UsageError(
                f"bounds must enclose at most {_MAX_AREA_M2:.0f} m2, got {area:.0f} m2; "
                "cut the world to where the avatar walks"
            )
        if not isinstance(self.obstacles, tuple):
            kind = type(self.obstacles).__name__
            raise UsageError(f"obstacles must be a tuple of Obstacle, got {kind}")
        if len(self.obstacles) > MAX_BOXES:
            raise UsageError(
                f"a world may have at most {MAX_BOXES} boxes, got {len(self.obstacles)}; "
                "leave out boxes that the avatar does not come near"
            )
        for box in self.obstacles:
            if not isinstance(box, Obstacle):
                raise UsageError(f"obstacles must be Obstacle, got {type(box).__name__}")
        ground = self._near_ground()
        if ground > _MAX_NEAR_M2:
            raise UsageError(
                f"the {len(self.obstacles)} boxes are too large and too many: the ground within "
                f"{_NEAR_M:g} m of each adds up to {ground:.0f} m2, at most {_MAX_NEAR_M2:.0f} "
                "are allowed; leave out boxes that others cover or that the avatar does not come "
                "near"
            )

    def _near_ground(self) -> float:
        """The ground within the bounds near each box, added up [m^2]."""
        if not self.obstacles:
            return 0.0
        boxes = self.boxes[: len(self.obstacles)]
        c, s = np.abs(boxes[:, 4]), np.abs(boxes[:, 5])
        area = np.ones(len(boxes))
        for axis, half in enumerate(
            (c * boxes[:, 2] + s * boxes[:, 3], s * boxes[:, 2] + c * boxes[:, 3])
        ):
            low = np.maximum(boxes[:, axis] - half - _NEAR_M, self.bounds[axis])
            high = np.minimum(boxes[:, axis] + half + _NEAR_M, self.bounds[2 + axis])
            area *= np.maximum(high - low, 0.0)
        return float(area.sum())

    @functools.cached_property
    def boxes(self) -> FloatArray:
        """(n + 4, 6) centre x, y, half sizes, cosine and sine of the yaw; the rim's walls last."""
        low_x, low_y, high_x, high_y = self.bounds
        mid = (0.5 * (low_x + high_x), 0.5 * (low_y + high_y))
        wide, deep = 0.5 * (high_x - low_x) + 2 * _RIM, 0.5 * (high_y - low_y) + 2 * _RIM
        rim = [
            Obstacle((low_x - _RIM, mid[1]), (_RIM, deep)),
            Obstacle((high_x + _RIM, mid[1]), (_RIM, deep)),
            Obstacle((mid[0], low_y - _RIM), (wide, _RIM)),
            Obstacle((mid[0], high_y + _RIM), (wide, _RIM)),
        ]
        rows = [
            (*o.center, *o.half_sizes, math.cos(o.yaw), math.sin(o.yaw))
            for o in (*self.obstacles, *rim)
        ]
        boxes = np.array(rows)
        boxes.flags.writeable = False
        return boxes

    def grid_shape(self, side_m: float) -> tuple[int, int]:
        """Number of square cells along x and y of a grid over the bounds.

        Args:
            side_m: Side of the cells [m].

        Raises:
            UsageError: There are too many cells.
        """
        if not 0 < side_m < math.inf:
            raise UsageError(f"the side of cells must be above 0 and finite, got {side_m:g}")
        low_x, low_y, high_x, high_y = self.bounds
        size = (high_x - low_x, high_y - low_y)
        # Floats, since they may be infinite here.
        cells = [max(1.0, float(np.ceil(length / side_m))) for length in size]
        if not math.prod(cells) <= _MAX_CELLS:
            raise UsageError(
                f"a world of {size[0]:g} x {size[1]:g} m in cells of {side_m:g} m has too "
                f"many cells: at most {_MAX_CELLS} are allowed; choose larger cells or a "
                "smaller world"
            )
        return int(cells[0]), int(cells[1])

    def distances(self, points: npt.ArrayLike) -> FloatArray:
        """Distance of points on the ground to the nearest box or rim.

        Args:
            points: (..., 2) [m].

        Returns:
            (...) [m]; negative inside.
        """
        points = np.asarray(points, dtype=np.float64)
        nearest = np.full(points.shape[:-1], np.inf)
        for box in self.boxes:
            np.minimum(nearest, box_distance(points, box), out=nearest)
        return nearest


def box_distance(points: FloatArray, box: FloatArray) -> FloatArray:
    """Distance of points (..., 2) to a row of `World.boxes` [m], negative inside."""
    x, y = points[..., 0] - box[0], points[..., 1] - box[1]
    beyond_x = np.abs(box[4] * x + box[5] * y) - box[2]
    beyond_y = np.abs(box[4] * y - box[5] * x) - box[3]
    outside: FloatArray = np.hypot(np.maximum(beyond_x, 0.0), np.maximum(beyond_y, 0.0))
    return outside + np.minimum(np.maximum(beyond_x, beyond_y), 0.0)


def body_clearances(
    world: World, character: Character, poses: npt.ArrayLike, max_distance: float = 0.5
) -> FloatArray:
    """Distance of the body to the boxes, by MuJoCo's distances between geoms.

    Exact, and slow: about a tenth of a millisecond a frame. The rim is left out.

    Args:
        world: The boxes.
        character: The character.
        poses: (frames, 59).
        max_distance: Larger distances count as this [m].

    Returns:
        (frames,) smallest distance of any geom of the body to any box [m], at most `max_distance`;
        negative where they overlap.
    """
    poses = as_poses(poses)
    spec = mujoco.MjSpec.from_file(str(character.file))
    for index, box in enumerate(world.obstacles):
        half_yaw = 0.5 * box.yaw
        spec.worldbody.add_geom(
            name=f"obstacle {index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(*box.center, 0.5 * box.height),
            size=(*box.half_sizes, 0.5 * box.height),
            quat=(math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)),
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    bodies = np.flatnonzero(model.geom_bodyid > 0)
    walls = [model.geom(f"obstacle {index}").id for index in range(len(world.obstacles))]
    out = np.full(len(poses), max_distance)
    for frame, pose in enumerate(poses):
        data.qpos[:POSE_SIZE] = pose
        mujoco.mj_kinematics(model, data)
        for wall, box in zip(walls, world.boxes, strict=False):
            if box_distance(pose[:2], box) > _REACH + max_distance:
                continue
            for geom in bodies:
                found = mujoco.mj_geomDistance(model, data, int(geom), wall, out[frame], None)
                out[frame] = min(out[frame], found)
    return out
