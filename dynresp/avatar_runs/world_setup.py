"""The worlds of graph specs: what counts as a contact in each, and which objects stand in it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import Composition, compose
from dynresp.locomotion.worlds.obstacles import World, box_distance
from dynresp.locomotion.worlds.playground import playground_contacts, recorded_playground
from dynresp.locomotion.worlds.playground_fitting import compose_on_playground
from dynresp.locomotion.worlds.recorded_terrain import onto_blocks
from dynresp.locomotion.worlds.stool import from_all_sides, stool_contacts, stool_world
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import UsageError
from dynresp.view.story import Block, MovingCapsule

FLAT, TERRAIN, STOOL, PLAYGROUND = "flat", "terrain", "stool", "playground"

# Boxes farther than this from a track [m] are not shown with it.
_SHOWN_M = 12.0


@dataclass(frozen=True, eq=False)
class WorldMotions:
    """Motions in their world.

    Attributes:
        motions: The motions.
        contacts: (frames, 2 or 4) of each motion, see `frame_database.CONTACTS`; None for the
            motions' own.
    """

    motions: Sequence[Motion]
    contacts: Sequence[BoolArray] | None = None


def place_in_world(world: str, motions: Sequence[Motion], character: Character) -> WorldMotions:
    """Bring motions into their world, and find what they touch there.

    Each motion on the stool is also used after every quarter turn: the stool has four equal sides.

    Args:
        world: "flat", "terrain", "stool" or "playground".
        motions: The motions as they were loaded.
        character: Their character.

    Raises:
        MotionError: Motions on terrain have too few stances to find the blocks.
    """
    if world == TERRAIN:
        return WorldMotions(onto_blocks(character, motions)[0])
    if world == STOOL:
        motions = [copy for motion in motions for copy in from_all_sides(motion)]
        return WorldMotions(motions, [stool_contacts(motion, character) for motion in motions])
    if world == PLAYGROUND:
        return WorldMotions(motions, [playground_contacts(motion, character) for motion in motions])
    return WorldMotions(motions)


def play_in_world(
    graph: MotionGraph, character: Character, frames: npt.ArrayLike, fps: float
) -> Composition:
    """Play a walk in its world: on the playground hands hold on to the bars.

    Args:
        graph: The motion graph; its database says which world.
        character: The avatar's body.
        frames: (k,) the walk, two frames or more.
        fps: Frame rate of the motion [1/s].

    Raises:
        UsageError: The graph is one of rough terrain: its walks need blocks.
    """
    refuse_terrain(graph)
    if graph.database.world == PLAYGROUND:
        return compose_on_playground(graph, character, frames, fps)
    return compose(graph, character, frames, fps=fps)


def refuse_terrain(graph: MotionGraph) -> None:
    """Refuse a graph of rough terrain.

    Raises:
        UsageError: It is one.
    """
    if graph.database.world == TERRAIN:
        raise UsageError(
            "the graph holds steps over rough terrain, which need blocks to step on, and this kind "
            "of run has none; build another graph, or use `dynresp graph walk` or `dynresp graph "
            "sketch`"
        )


def blocks_of(world: World | None, track: FloatArray | None = None) -> list[Block]:
    """The boxes of a world, as pictures show them.

    Args:
        world: The boxes; None for no boxes.
        track: (n, 2) a walk between them [m]; boxes more than 12 m from it are left out.
    """
    if world is None:
        return []
    shown = world.obstacles
    if track is not None:
        near = [box_distance(track, box).min() <= _SHOWN_M for box in world.boxes[: len(shown)]]
        shown = tuple(itertools.compress(shown, near))
    return [
        Block((*box.center, 0.5 * box.height), (*box.half_sizes, 0.5 * box.height), yaw=box.yaw)
        for box in shown
    ]


def standing_objects(world: str, frames: int) -> tuple[list[Block], list[MovingCapsule]]:
    """The blocks and bars of a world, as pictures show them.

    Args:
        world: "flat", "terrain", "stool" or "playground".
        frames: Frames of the story that shows them.
    """
    if world == STOOL:
        return blocks_of(stool_world()), []
    if world != PLAYGROUND:
        return [], []
    rods = []
    for number, bar in enumerate(recorded_playground().bars):
        start, end = np.array(bar.start), np.array(bar.stop)
        turn = rotations.between_vectors(np.array([0.0, 0.0, 1.0]), end - start)
        rods.append(
            MovingCapsule(
                f"bar {number}",
                bar.radius,
                0.5 * float(np.linalg.norm(end - start)),
                np.repeat(0.5 * (start + end)[None], frames, axis=0),
                np.repeat(turn[None], frames, axis=0),
            )
        )
    return [], rods
