"""Boxes on the ground, and how far points and bodies are from them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.errors import UsageError
from dynresp.motion.character import POSE_SIZE, Character, as_poses
from dynresp.motion.rotations import FloatArray

# Half the thickness [m] of the walls that stand around a world: nobody gets to their far side.
_RIM = 500.0
# Bodies farther than this from a root in rest [m] belong to no character of human size.
_REACH = 1.5
# Grids over a world, and what is worked out in each cell for each box, must fit into memory and
# time: a plan in cells of 0.1 m over the largest world takes about 1.5 GB and half a minute.
_MOST_SIDE_M = 400.0
_MOST_AREA_M2 = 40_000.0
_MOST_BOX_AREA_M2 = 4e6
_MOST_CELLS = 5_000_000
_MOST_BOX_CELLS = 500_000_000
# The walls of the rim.
_WALLS = 4


@dataclass(frozen=True)
class Obstacle:
    """A box that stands on the ground.

    Attributes:
        center: Of its base, x and y [m].
        half_sizes: Half its length along its own x and y [m].
        yaw: By how much it is turned about the vertical [rad].
        height: How high it is [m].

    Raises:
        UsageError: A number is not finite, or a size is not above 0.
    """

    center: tuple[float, float]
    half_sizes: tuple[float, float]
    yaw: float = 0.0
    height: float = 2.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not all(math.isfinite(v) for v in (*self.center, self.yaw)):
            raise UsageError(
                f"an obstacle must be at a finite place, got {self.center}, {self.yaw}"
            )
        if not all(math.isfinite(v) and v > 0 for v in (*self.half_sizes, self.height)):
            raise UsageError(
                f"the sizes of an obstacle must be above 0, got half sizes {self.half_sizes} "
                f"and height {self.height}"
            )


@dataclass(frozen=True)
class World:
    """Level ground with a rim, and boxes on it. Leaving the rim counts as a collision.

    Attributes:
        bounds: Least x, least y, largest x, largest y [m].
        obstacles: The boxes; they may overlap.

    Raises:
        UsageError: The bounds enclose nothing, or more than 400 m along a side or 40,000 m^2; or
            there are more boxes than can be planned around: the area times the boxes and the
            rim's four walls must not exceed 4,000,000 m^2.
    """

    bounds: tuple[float, float, float, float]
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        """Check the bounds."""
        low_x, low_y, high_x, high_y = self.bounds
        if not (all(math.isfinite(v) for v in self.bounds) and low_x < high_x and low_y < high_y):
            raise UsageError(
                f"bounds must be (least x, least y, largest x, largest y), got {self.bounds}"
            )
        wide, deep = high_x - low_x, high_y - low_y
        if max(wide, deep) > _MOST_SIDE_M:
            raise UsageError(
                f"bounds must have sides of at most {_MOST_SIDE_M:g} m, got {wide:g} x {deep:g} m; "
                "cut the world to where the avatar walks"
            )
        area = wide * deep
        if area > _MOST_AREA_M2:
            raise UsageError(
                f"bounds must enclose at most {_MOST_AREA_M2:.0f} m2, got {area:.0f} m2; "
                "cut the world to where the avatar walks"
            )
        if area * (len(self.obstacles) + _WALLS) > _MOST_BOX_AREA_M2:
            raise UsageError(
                f"a world of {area:.0f} m2 may have at most "
                f"{int(_MOST_BOX_AREA_M2 / area) - _WALLS} boxes, got {len(self.obstacles)}; "
                "leave out boxes that the avatar does not come near, or cut the world"
            )

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

    def grid_shape(self, side_m: float, more: int = 0) -> tuple[int, int]:
        """How many square cells a grid over the bounds has along x and y.

        Args:
            side_m: Side of the cells [m].
            more: How many things there are to keep clear of beside the boxes.

        Raises:
            UsageError: There are too many cells, or too many for so many boxes.
        """
        if not 0 < side_m < math.inf:
            raise UsageError(f"the side of cells must be above 0 and finite, got {side_m:g}")
        low_x, low_y, high_x, high_y = self.bounds
        size = (high_x - low_x, high_y - low_y)
        # Floats, which may be infinite here, as whole numbers may not.
        cells = [max(1.0, float(np.ceil(length / side_m))) for length in size]
        boxes = len(self.obstacles) + _WALLS + more
        if not (math.prod(cells) <= _MOST_CELLS and math.prod(cells) * boxes <= _MOST_BOX_CELLS):
            raise UsageError(
                f"a world of {size[0]:g} x {size[1]:g} m in cells of {side_m:g} m with {boxes} "
                f"boxes is too much to lay out: at most {_MOST_CELLS} cells, and {_MOST_BOX_CELLS} "
                "times a box; choose larger cells or a smaller world, or leave out boxes"
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
    world: World, character: Character, poses: npt.ArrayLike, farthest: float = 0.5
) -> FloatArray:
    """How near the body comes to the boxes, by MuJoCo's distances between geoms.

    Exact, and slow: about a tenth of a millisecond a frame. The rim is left out.

    Args:
        world: The boxes.
        character: Whose poses they are.
        poses: (frames, 59).
        farthest: Distances beyond this are not told apart [m].

    Returns:
        (frames,) least distance of any geom of the body to any box [m], at most `farthest`;
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
    out = np.full(len(poses), farthest)
    for frame, pose in enumerate(poses):
        data.qpos[:POSE_SIZE] = pose
        mujoco.mj_kinematics(model, data)
        for wall, box in zip(walls, world.boxes, strict=False):
            if box_distance(pose[:2], box) > _REACH + farthest:
                continue
            for geom in bodies:
                found = mujoco.mj_geomDistance(model, data, int(geom), wall, out[frame], None)
                out[frame] = min(out[frame], found)
    return out
