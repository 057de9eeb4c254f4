"""A motion graph prepared for walks over blocks: the block on which each foot of each frame stands.

Clips are placed in whole blocks, whole levels and quarter turns. So a placement on the grid is four
whole numbers, here called a cell placement: column, row, level, quarter turns.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.graph_config import Coordinates
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.world_contacts import sole_corners
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import LongArray
from dynresp.support.errors import MotionError, UsageError
from dynresp.support.runs import runs

# A sole is flat if its heel and its ball differ in height by at most this [m].
_FLAT = 0.03
# Feet of the database may be off whole levels by at most this [m].
_OFF_LEVEL = 0.01


class TerrainGraph:
    """A motion graph prepared for walks over blocks; made once for any number of walks.

    Attributes:
        graph: The graph.
        character: Its character.
        stands: (n, 2) whether a foot stands in a frame.
        blocks: (n, 2, 2) column and row of the block it stands on, in the clip's own world.
        levels: (n, 2) the level of that block.
        over: (n, 2, 4) how far its sole reaches over the edge of that block to +x, +y, -x, -y [m];
            negative inside.
        moves: (m, 4) of each jump of the graph, the cell placement of the target's clip seen from
            the source's.
        planar: (n, 3) x, y [m] and yaw [rad] of the roots.

    The entries of a foot are the same for all frames of a stance. Arrays are read-only.
    """

    def __init__(self, graph: MotionGraph, character: Character | None = None) -> None:
        """Prepare a graph.

        Args:
            graph: In `Coordinates.BLOCKS`, of motions on a grid that begins at the origin; see
                `recorded_terrain.onto_blocks`.
            character: Its character, by default the product's own.

        Raises:
            UsageError: The graph is in other coordinates.
            MotionError: Its feet do not stand on whole levels.
        """
        if graph.config.coordinates is not Coordinates.BLOCKS:
            raise UsageError(
                "walking on a terrain needs a graph in blocks coordinates, got "
                f"{graph.config.coordinates.value}; build it with Coordinates.BLOCKS"
            )
        self.graph = graph
        self.character = character or default_character()
        database, config = graph.database, graph.config
        self._unit = np.array([config.block_m, config.block_m, config.block_height_m, 0.5 * np.pi])
        self.stands = np.ascontiguousarray(database.contacts[:, :2])
        soles = sole_corners(self.character, self.character.kinematics(database.poses))
        self._find_blocks(soles)
        self.moves = np.round(graph.placements / self._unit).astype(np.int64)
        self.moves[:, 3] %= 4
        self.planar = np.ascontiguousarray(database.planar[:, [0, 1, 3]])
        for array in (
            self.stands, self.blocks, self.levels, self.over, self.moves, self.planar,
        ):  # fmt: skip
            array.flags.writeable = False

    def _find_blocks(self, soles: FloatArray) -> None:
        """Find the block of every stance."""
        n, block = len(soles), self.graph.config.block_m
        self.blocks = np.zeros((n, 2, 2), dtype=np.int64)
        self.levels = np.zeros((n, 2), dtype=np.int64)
        self.over = np.zeros((n, 2, 4))
        low = soles[..., 2].min(axis=-1) / self.graph.config.block_height_m
        tilt = np.abs(soles[..., :2, 2].mean(axis=-1) - soles[..., 2:, 2].mean(axis=-1))
        for clip in self.graph.database.clips:
            for foot in range(2):
                for start, stop in runs(self.stands[clip.start : clip.stop, foot]):
                    rows = slice(clip.start + start, clip.start + stop)
                    flat = tilt[rows, foot] <= _FLAT
                    sole = soles[rows, foot][flat if flat.any() else slice(None)]
                    sole = np.median(sole, axis=0)[:, :2]
                    cell = np.floor(sole.mean(axis=0) / block)
                    self.blocks[rows, foot] = cell
                    self.levels[rows, foot] = np.round(np.median(low[rows, foot]))
                    corner = cell * block
                    self.over[rows, foot, :2] = sole.max(axis=0) - corner - block
                    self.over[rows, foot, 2:] = corner - sole.min(axis=0)
        off = np.abs(low - self.levels)[self.stands] * self.graph.config.block_height_m
        if off.size and np.median(off) > _OFF_LEVEL:
            raise MotionError(
                f"half of the standing feet are more than {np.median(off):.3f} m off whole levels; "
                "bring the motions onto blocks first (recorded_terrain.onto_blocks)"
            )

    def standing(
        self, terrain: Terrain, frame: int, cell: npt.ArrayLike, turns: int
    ) -> LongArray | None:
        """The cell placement at which all standing feet of a frame stand on blocks; None if none.

        Args:
            terrain: The blocks.
            frame: A frame in which a foot stands.
            cell: (2,) its column and row.
            turns: Its quarter turns.
        """
        found = np.array([*np.asarray(cell), 0, turns], dtype=np.int64)
        feet = np.flatnonzero(self.stands[frame])
        blocks = self.blocks_under(terrain, [frame], self.meters(terrain, found[None]))[0, feet]
        levels = terrain.levels[tuple(blocks.T)] - self.levels[frame, feet]
        if (blocks < 0).any() or np.ptp(levels) > 0:
            return None
        found[2] = levels[0]
        return found

    def meters(self, terrain: Terrain, cell_placements: LongArray) -> FloatArray:
        """Placements (..., 4) [m, rad] of cell placements (..., 4) on a terrain."""
        out = cell_placements * self._unit
        out[..., :2] += terrain.corner
        out[..., 3] = placement.wrapped(out[..., 3])
        return np.asarray(out)

    def cell_placement(self, terrain: Terrain, at: npt.ArrayLike) -> LongArray:
        """The cell placement (4,) of a placement (4,) on a terrain.

        Raises:
            UsageError: It is not on the grid.
        """
        moved = (np.asarray(at) - [*terrain.corner, 0.0, 0.0]) / self._unit
        out = np.round(moved).astype(np.int64)
        if not np.abs(moved - out).max() < 1e-6:
            raise UsageError(
                f"a clip must be placed in whole blocks, levels and quarter turns, got "
                f"{list(moved)}; start_on_terrain gives such a state"
            )
        out[3] %= 4
        return out

    def blocks_under(
        self, terrain: Terrain, frames: npt.ArrayLike, placements: FloatArray
    ) -> LongArray:
        """The block on which each foot stands.

        Args:
            terrain: The blocks.
            frames: (k,) frames.
            placements: (k, 4) placements of their clips: whole blocks and levels, quarter turns.

        Returns:
            (k, 2, 2) column and row; -1 if a foot does not stand, or stands beside the grid.
        """
        at = np.asarray(frames)
        middles = np.zeros((len(at), 2, 4))
        middles[..., :2] = (self.blocks[at] + 0.5) * terrain.block_m
        cells = terrain.cells(placement.compose(placements[:, None], middles))
        inside = np.all((cells >= 0) & (cells < terrain.levels.shape), axis=-1)
        return np.where((self.stands[at] & inside)[..., None], cells, -1)

    def check(self, terrain: Terrain) -> None:
        """Refuse a terrain of other blocks.

        Raises:
            UsageError: Its blocks or levels are not the graph's.
        """
        config = self.graph.config
        if (terrain.block_m, terrain.level_m) != (config.block_m, config.block_height_m):
            raise UsageError(
                f"the graph has blocks of {config.block_m} and levels of {config.block_height_m} m,"
                f" the terrain {terrain.block_m} and {terrain.level_m} m; they must be the same"
            )
