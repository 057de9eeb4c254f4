"""Fast collision test: which footprints overlap the boxes of a world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.obstacles import World
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError

if TYPE_CHECKING:
    from dynresp.locomotion.worlds.collision_kernel import Grid

# Most boxes in the lists of all cells: 400 MB, and below 2^31, the limit of `CollisionGrid.starts`.
_MAX_MEMBERS = 100_000_000
# Half the diagonal of a cell of side 1, and a little more.
_DIAGONAL = 0.7072


@dataclass(frozen=True, eq=False)
class CollisionGrid:
    """A world prepared for the collision test. Arrays are read-only.

    Attributes:
        frame: (3,) x and y of the grid's corner, side of its cells [m].
        clearance: (columns, rows) distance from the middle of each cell to the nearest box [m];
            beyond `reach_m` any larger number.
        starts: (columns * rows + 1,) where the boxes near each cell begin in `members`.
        members: (k,) boxes.
        boxes: (n, 6) rows of `World.boxes`.
        reach_m: Largest distance at which a box counts as near [m].
    """

    frame: FloatArray
    clearance: npt.NDArray[np.float32]
    starts: npt.NDArray[np.int32]
    members: npt.NDArray[np.int32]
    boxes: FloatArray
    reach_m: float = 0.0

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.frame, self.clearance, self.starts, self.members, self.boxes):
            array.flags.writeable = False

    @property
    def arrays(self) -> Grid:
        """The arrays, as the kernels take them."""
        from dynresp.locomotion.worlds.collision_kernel import Grid

        return Grid(self.frame, self.clearance, self.starts, self.members, self.boxes)

    @classmethod
    def of(cls, world: World, reach_m: float, cell_m: float = 0.2) -> CollisionGrid:
        """Prepare a world; the time grows with the number of cells near boxes.

        Args:
            world: The boxes.
            reach_m: Largest distance of the ground that a body covers from its root [m], margins
                included.
            cell_m: Side of the grid's cells [m].

        Raises:
            UsageError: There are too many cells, or too many boxes near to them.
        """
        # Numba takes a third of a second to import, the kernels longer when first compiled.
        from dynresp.locomotion.worlds.collision_kernel import count_kernel, list_kernel

        columns, rows = world.grid_shape(cell_m)
        frame = np.array([*world.bounds[:2], cell_m])
        near = reach_m + _DIAGONAL * cell_m
        windows = _windows(world.boxes, frame, near, (columns, rows))
        clearance = np.full((columns, rows), np.inf, dtype=np.float32)
        counts = np.zeros(columns * rows, dtype=np.int64)
        count_kernel(world.boxes, windows, frame, near, clearance, counts)
        total = int(counts.sum())
        if total > _MAX_MEMBERS:
            raise UsageError(
                f"the lists of boxes within reach ({reach_m:g} m) of each cell ({cell_m:g} m) "
                f"would hold {total}, at most {_MAX_MEMBERS} are allowed; leave out boxes that "
                "others cover, or choose larger cells"
            )
        starts = np.zeros(columns * rows + 1, dtype=np.int64)
        np.cumsum(counts, out=starts[1:])
        members = np.empty(total, dtype=np.int32)
        list_kernel(world.boxes, windows, frame, near, rows, starts[:-1].copy(), members)
        return cls(frame, clearance, starts.astype(np.int32), members, world.boxes, reach_m)

    def distances(self, points: npt.ArrayLike) -> FloatArray:
        """Distance of points on the ground to the nearest box or rim, as `World.distances`.

        Args:
            points: (n, 2) [m].

        Returns:
            (n,) [m], negative inside; at most `reach_m`.
        """
        from dynresp.locomotion.worlds.collision_kernel import distances_kernel

        at = np.ascontiguousarray(points, dtype=np.float64)
        out = np.empty(len(at))
        distances_kernel(at, self.reach_m, self.arrays, out)
        return out

    def collisions(
        self, roots: npt.ArrayLike, footprints: npt.ArrayLike, margin_m: float = 0.0
    ) -> BoolArray:
        """Which footprints overlap a box, or stand outside of the grid.

        Args:
            roots: (n, 3) x, y [m] and yaw [rad].
            footprints: (n, 4); see `dynresp.locomotion.worlds.footprints`.
            margin_m: How far they are widened on all sides [m].

        Returns:
            (n,) bool.
        """
        # Numba takes a third of a second to import, the kernel longer when first compiled.
        from dynresp.locomotion.worlds.collision_kernel import collisions_kernel

        at = np.ascontiguousarray(roots, dtype=np.float64)
        reach = np.ascontiguousarray(footprints, dtype=np.float32)
        out = np.zeros(len(at), dtype=bool)
        collisions_kernel(at, reach, margin_m, self.arrays, out)
        return out


def _windows(
    boxes: FloatArray, frame: FloatArray, near: float, shape: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """(n, 4) first and last column, first and last row of the cells that may be near each box."""
    c, s = np.abs(boxes[:, 4]), np.abs(boxes[:, 5])
    halves = np.stack(
        [c * boxes[:, 2] + s * boxes[:, 3], s * boxes[:, 2] + c * boxes[:, 3]], axis=1
    )
    low = np.floor((boxes[:, :2] - halves - near - frame[:2]) / frame[2])
    high = np.floor((boxes[:, :2] + halves + near - frame[:2]) / frame[2])
    last = np.array(shape) - 1.0
    # Clipped before they become whole numbers, which cannot hold the largest boxes.
    low, high = np.clip(low, 0.0, last + 1.0), np.clip(high, -1.0, last)
    windows = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    return np.ascontiguousarray(windows.astype(np.int64))
