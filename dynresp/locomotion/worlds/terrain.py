"""Rough terrain: square blocks of several heights on a grid (Lee et al. 2002, section 6).

Heights are whole numbers of levels. The recorded terrain (`recorded_terrain.onto_blocks`) has
blocks of 24 inches and levels of 2.5 inches, a third of the paper's height of 7.5 inches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.worlds.world_contacts import heights_above
from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number, check_vector
from dynresp.support.errors import UsageError

BLOCK_M = 0.6096
"""Side of a block [m]: 24 inches."""
LEVEL_M = 0.0635
"""Height of a level [m]: 2.5 inches."""

# Thickness of the ground that is drawn below level 0 [m].
_GROUND = 0.05


@dataclass(frozen=True, eq=False)
class Terrain:
    """Blocks on a grid along x and y. Beside the grid there is no ground.

    Attributes:
        levels: (columns along x, rows along y) whole numbers, height of each block; read-only.
        corner: Where the grid begins: least x and least y [m].
        block_m: Side of a block [m].
        level_m: Height of a level [m].

    Raises:
        UsageError: There is no block, or a number is not finite or a size not above 0.
    """

    levels: npt.NDArray[np.int64]
    corner: tuple[float, float] = (0.0, 0.0)
    block_m: float = BLOCK_M
    level_m: float = LEVEL_M

    def __post_init__(self) -> None:
        """Check and freeze."""
        levels = np.array(self.levels)
        if levels.ndim != 2 or levels.size == 0 or not np.issubdtype(levels.dtype, np.integer):
            raise UsageError(
                "the levels of a terrain must be whole numbers in a grid (columns, rows), "
                f"got {levels.dtype} {levels.shape}"
            )
        check_number("block_m", self.block_m, 0.0, above_low=True)
        check_number("level_m", self.level_m, 0.0, above_low=True)
        check_vector("corner of a terrain", self.corner, 2)
        levels.flags.writeable = False
        object.__setattr__(self, "levels", levels)

    @classmethod
    def random(
        cls,
        rng: np.random.Generator,
        columns: int,
        rows: int,
        highest: int = 6,
        steepest: int = 3,
    ) -> Terrain:
        """A random terrain.

        One block after the other gets a random height that its neighbours allow.

        Args:
            rng: Source of random numbers.
            columns: Blocks along x.
            rows: Blocks along y.
            highest: Highest level; the lowest is 0. Six are the paper's two blocks.
            steepest: Largest difference in levels between neighbours, also diagonal ones. Three
                are one of the paper's blocks.

        Raises:
            UsageError: There would be no block, or a level below 0.
        """
        if min(columns, rows) < 1 or highest < 0 or steepest < 0:
            raise UsageError(
                "a terrain needs at least one column and one row, and levels of 0 or more; got "
                f"{columns} x {rows}, highest {highest}, steepest {steepest}"
            )
        levels = np.zeros((columns, rows), dtype=np.int64)
        for i in range(columns):
            for j in range(rows):
                # Neighbours that have a height differ by two steps at most, so there is always a
                # height that fits.
                before = levels[max(i - 1, 0) : i, max(j - 1, 0) : j + 2].ravel()
                around = np.concatenate([before, levels[i, max(j - 1, 0) : j]])
                low, high = 0, highest
                if len(around):
                    low = max(low, int(around.max()) - steepest)
                    high = min(high, int(around.min()) + steepest)
                levels[i, j] = rng.integers(low, high + 1)
        return cls(levels)

    @property
    def size(self) -> tuple[float, float]:
        """Size of the grid along x and along y [m]."""
        columns, rows = self.levels.shape
        return columns * self.block_m, rows * self.block_m

    def cells(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(..., 2) column and row of the blocks under points (..., 2 or more) [m].

        Beside the grid they are below 0 or beyond it, where there is no block.
        """
        at = np.asarray(points, dtype=np.float64)[..., :2]
        # NaN becomes a cell beside the grid.
        steps = np.nan_to_num(np.floor((at - np.array(self.corner)) / self.block_m), nan=-1.0)
        return np.clip(steps, -1, np.array(self.levels.shape)).astype(np.int64)

    def height(self, points: npt.ArrayLike) -> FloatArray:
        """Height [m] of the surface under points (..., 2 or more) [m]; NaN beside the grid."""
        ij = self.cells(points)
        inside = np.all((ij >= 0) & (ij < np.array(self.levels.shape)), axis=-1)
        i, j = np.moveaxis(np.where(inside[..., None], ij, 0), -1, 0)
        return np.where(inside, self.levels[i, j] * self.level_m, np.nan)

    def supports(
        self, soles: npt.ArrayLike, placements: npt.ArrayLike, tolerance: float = 0.03
    ) -> npt.NDArray[np.bool_]:
        """Whether feet of placed clips stand on the terrain.

        A foot stands if its lowest point is at the height of the block below it, within the
        tolerance. It may stick out over an edge; see `world_contacts.heights_above`.

        Args:
            soles: (..., points, 3) of each foot, in the clip's own world [m]. A foot of NaN is in
                the air and needs no ground.
            placements: (..., 4) placements of the clips: x, y, z [m] and yaw [rad]; broadcast
                against the feet.
            tolerance: Largest distance above or below the block [m].

        Returns:
            (...) for each foot.
        """
        points = np.asarray(soles, dtype=np.float64)
        above = self._above(points, np.asarray(placements, dtype=np.float64))
        standing = np.abs(above.min(axis=-1)) <= tolerance
        return np.asarray(standing | np.any(np.isnan(points), axis=(-2, -1)))

    def standing(self, soles: npt.ArrayLike, at: npt.ArrayLike) -> FloatArray:
        """The placement at the height at which the feet of a frame stand.

        Args:
            soles: (feet, points, 3) of one frame, as in `supports`; at least one foot stands.
            at: (4,) x, y and yaw of the placement; its z has no effect.

        Returns:
            (4,) with z a whole number of levels, the lowest at which no standing foot sinks into a
            block by more than half a level.

        Raises:
            UsageError: No foot stands, or one would stand beside the grid.
        """
        points = np.asarray(soles, dtype=np.float64)
        placed = np.array(at, dtype=np.float64)
        placed[2] = 0.0
        above = self._above(points, placed).min(axis=-1)
        stands = ~np.any(np.isnan(points), axis=(-2, -1))
        if not stands.any() or np.isnan(above[stands]).any():
            raise UsageError(
                "the feet do not stand on a block there; take a frame in which a foot stands, and "
                f"a place inside the grid of {self.size[0]:g} x {self.size[1]:g} m"
            )
        placed[2] = self.level_m * np.ceil(-above[stands].min() / self.level_m - 0.5)
        return placed

    def boxes(self) -> tuple[FloatArray, FloatArray]:
        """The blocks as boxes along the axes, for drawing.

        Returns:
            Centres (n, 3) and half sizes (n, 3) [m]. All reach down to a little below the lower of
            level 0 and the lowest level.
        """
        columns, rows = self.levels.shape
        i, j = np.mgrid[0:columns, 0:rows].reshape(2, -1)
        bottom = min(0.0, float(self.levels.min()) * self.level_m) - _GROUND
        top = self.levels[i, j] * self.level_m
        x, y = (c + (k + 0.5) * self.block_m for c, k in zip(self.corner, (i, j), strict=True))
        centers = np.stack([x, y, 0.5 * (top + bottom)], axis=1)
        half = np.full(len(i), 0.5 * self.block_m)
        return centers, np.stack([half, half, 0.5 * (top - bottom)], axis=1)

    def _above(self, soles: FloatArray, placements: FloatArray) -> FloatArray:
        """Heights (..., points) [m] of placed soles above the blocks."""
        states = np.concatenate([soles, np.zeros((*soles.shape[:-1], 1))], axis=-1)
        there = placement.compose(placements[..., None, :], states)
        return heights_above(self.height, there[..., :3])
