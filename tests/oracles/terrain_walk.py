"""Slow twin of `dynresp.locomotion.worlds.terrain_walk`: which states of a walk can be reached.

It computes with the graph's placements in metres and the positions of the soles. It takes recorded
steps alone, and feet need not be drawn in.
"""

import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.locomotion.worlds.world_contacts import sole_corners
from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray


def placed(sole: FloatArray, place: FloatArray) -> FloatArray:
    """(4, 3) corners of a sole, put somewhere."""
    turn = rotations.from_yaw(np.array([place[3]]))
    return rotations.rotate(turn, sole) + place[:3]


def stands(terrain: Terrain, soles: FloatArray, contacts: BoolArray, place: FloatArray) -> bool:
    """Whether every standing foot is on the level of the block beneath its middle."""
    for foot in np.flatnonzero(contacts):
        sole = placed(soles[foot], place)
        if not abs(sole[:, 2].min() - terrain.height(sole.mean(axis=0))) < 0.3 * terrain.level_m:
            return False
    return True


def block_of(terrain: Terrain, sole: FloatArray, place: FloatArray) -> tuple[int, ...]:
    """The block beneath the middle of a sole."""
    return tuple(terrain.cells(placed(sole, place).mean(axis=0)).tolist())


def reachable(graph: TerrainGraph, terrain: Terrain, start: AvatarState) -> list[FloatArray]:
    """(4,) roots of all states that can be reached."""
    database = graph.graph.database
    contacts = database.contacts[:, :2]
    soles = sole_corners(graph.character, graph.character.kinematics(database.poses))
    seen = set()
    waiting = [(start.frame, np.array(start.placement))]
    roots = []
    while waiting:
        frame, place = waiting.pop()
        roots.append(placement.compose(place, database.planar[frame]))
        for edge in range(graph.graph.offsets[frame], graph.graph.offsets[frame + 1]):
            entry = int(graph.graph.targets[edge])
            there = placement.compose(place, graph.graph.placements[edge])
            key = (entry, *np.round(there, 3) + 0.0)
            if key in seen:
                continue
            same = all(
                block_of(terrain, soles[frame, foot], place)
                == block_of(terrain, soles[entry, foot], there)
                for foot in np.flatnonzero(contacts[frame] & contacts[entry])
            )
            if same and stands(terrain, soles[entry], contacts[entry], there):
                seen.add(key)
                waiting.append((entry, there))
    return roots
