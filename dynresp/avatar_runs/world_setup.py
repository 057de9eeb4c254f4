"""The worlds of graph plans: what counts as a contact in each, and what stands about in it."""

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

# Boxes farther than this from a way [m] are not shown with it.
_SHOWN_M = 12.0


@dataclass(frozen=True, eq=False)
class LaidOut:
    """Motions in their world.

    Attributes:
        motions: The motions.
        contacts: Of each (frames, 2 or 4), see `database.CONTACTS`; None for those that it has.
    """

    motions: Sequence[Motion]
    contacts: Sequence[BoolArray] | None = None


def lay_out(world: str, motions: Sequence[Motion], character: Character) -> LaidOut:
    """Bring motions into their world, and find what they touch there.

    About the stool each is also taken turned by quarter turns: it looks alike from its four sides.

    Args:
        world: "flat", "terrain", "stool" or "playground".
        motions: As they were loaded.
        character: Whose motions they are.

    Raises:
        MotionError: On terrain, there are too few stances to tell the blocks.
    """
    if world == TERRAIN:
        return LaidOut(onto_blocks(character, motions)[0])
    if world == STOOL:
        motions = [copy for motion in motions for copy in from_all_sides(motion)]
        return LaidOut(motions, [stool_contacts(motion, character) for motion in motions])
    if world == PLAYGROUND:
        return LaidOut(motions, [playground_contacts(motion, character) for motion in motions])
    return LaidOut(motions)


def play_in_world(
    graph: MotionGraph, character: Character, frames: npt.ArrayLike, fps: float
) -> Composition:
    """Play a walk as its world asks: on the playground hands hold on to the bars.

    Args:
        graph: Whose walk; its database knows the world.
        character: Whose body it is.
        frames: (k,) a walk; two frames or more.
        fps: Frame rate of the motion [1/s].

    Raises:
        UsageError: The graph is one of rough terrain: a walk frame by frame knows no blocks.
    """
    refuse_blocks(graph)
    if graph.database.world == PLAYGROUND:
        return compose_on_playground(graph, character, frames, fps)
    return compose(graph, character, frames, fps=fps)


def refuse_blocks(graph: MotionGraph) -> None:
    """Refuse a graph of rough terrain where nothing says which blocks are walked on.

    Raises:
        UsageError: It is one.
    """
    if graph.database.world == TERRAIN:
        raise UsageError(
            "on rough terrain a way is searched over blocks that are drawn, and neither choice nor "
            "balls know them: use `dynresp graph walk` without --choose, --choices and --balls, or "
            "`dynresp graph sketch`"
        )


def blocks_of(world: World | None, track: FloatArray | None = None) -> list[Block]:
    """The boxes of a world as they are shown.

    Args:
        world: Boxes; None for none.
        track: (n, 2) a way through them [m]: boxes far from it are left out.
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


def standing_about(world: str, frames: int) -> tuple[list[Block], list[MovingCapsule]]:
    """What is shown of a world: blocks and bars.

    Args:
        world: "flat", "terrain", "stool" or "playground".
        frames: Of the story in which it is shown.
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
