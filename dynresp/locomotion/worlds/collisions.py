"""Which footprints overlap the boxes of a world, fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.errors import UsageError
from dynresp.locomotion.worlds.obstacles import World, box_distance
from dynresp.motion.rotations import FloatArray

BoolArray = npt.NDArray[np.bool_]

# Most boxes in the lists of all cells: about 1 GB while they are sorted, and far below the 2^31
# that `CollisionGrid.starts` can count.
_MOST_MEMBERS = 20_000_000


@dataclass(frozen=True, eq=False)
class CollisionGrid:
    """A world laid out for the collision test. Arrays are read-only.

    Attributes:
        frame: (3,) x and y of the grid's corner, side of its cells [m].
        clearance: (columns, rows) distance from the middle of each cell to the nearest box [m].
        starts: (columns * rows + 1,) where the boxes near each cell begin in `members`.
        members: (k,) boxes.
        boxes: (n, 6) rows of `World.boxes`.
    """

    frame: FloatArray
    clearance: npt.NDArray[np.float32]
    starts: npt.NDArray[np.int32]
    members: npt.NDArray[np.int32]
    boxes: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in self.arrays:
            array.flags.writeable = False

    @property
    def arrays(self) -> tuple[npt.NDArray, ...]:  # type: ignore[type-arg]
        """What the kernels take, in their order."""
        return self.frame, self.clearance, self.starts, self.members, self.boxes

    @classmethod
    def of(cls, world: World, reach_m: float, cell_m: float = 0.2) -> CollisionGrid:
        """Lay out a world.

        Args:
            world: The boxes.
            reach_m: Bodies cover no ground farther than this from their root [m], margins
                included.
            cell_m: Side of the grid's cells [m].

        Raises:
            UsageError: There are too many cells, or too many boxes near to them.
        """
        low = np.array(world.bounds[:2])
        columns, rows = world.grid_shape(cell_m)
        x = low[0] + cell_m * (np.arange(columns) + 0.5)
        y = low[1] + cell_m * (np.arange(rows) + 0.5)
        middles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        clearance = np.full((columns, rows), np.inf)
        cells, members, count = [], [], 0
        for index, box in enumerate(world.boxes):
            distance = box_distance(middles, box)
            np.minimum(clearance, distance, out=clearance)
            near = np.flatnonzero(distance.ravel() <= reach_m + 0.7072 * cell_m)
            count += len(near)
            if count > _MOST_MEMBERS:
                raise UsageError(
                    f"the lists of boxes within reach ({reach_m:g} m) of each cell ({cell_m:g} m) "
                    f"would hold more than {_MOST_MEMBERS}; leave out boxes that others cover, or "
                    "choose larger cells"
                )
            cells.append(near)
            members.append(np.full(len(near), index, dtype=np.int32))
        all_cells = np.concatenate(cells)
        order = np.argsort(all_cells, kind="stable")
        starts = np.zeros(columns * rows + 1, dtype=np.int32)
        np.cumsum(np.bincount(all_cells, minlength=columns * rows), out=starts[1:])
        return cls(
            np.array([*low, cell_m]),
            clearance.astype(np.float32),
            starts,
            np.concatenate(members)[order],
            world.boxes,
        )

    def collisions(
        self, roots: npt.ArrayLike, footprints: npt.ArrayLike, margin_m: float = 0.0
    ) -> BoolArray:
        """Which footprints overlap a box, or stand outside of the grid.

        Args:
            roots: (n, 3) x, y [m] and yaw [rad].
            footprints: (n, 4); see `dynresp.locomotion.worlds.footprints`.
            margin_m: By how much they are widened on all sides [m].

        Returns:
            (n,).
        """
        # Numba takes a third of a second to import, the kernel longer when first compiled.
        from dynresp.locomotion.worlds.collision_kernel import collisions_kernel

        at = np.ascontiguousarray(roots, dtype=np.float64)
        reach = np.ascontiguousarray(footprints, dtype=np.float32)
        out = np.zeros(len(at), dtype=bool)
        collisions_kernel(at, reach, margin_m, *self.arrays, out)
        return out
