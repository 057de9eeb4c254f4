"""The worlds of graph plans: what counts as a contact in each, and what stands about in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.database import BoolArray
from dynresp.locomotion.worlds.blocks import onto_blocks
from dynresp.locomotion.worlds.playground import playground_contacts, recorded_playground
from dynresp.locomotion.worlds.stool import from_all_sides, stool_contacts, stool_world
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.view.story import Block, MovingCapsule

FLAT, TERRAIN, STOOL, PLAYGROUND = "flat", "terrain", "stool", "playground"


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


def standing_about(world: str, frames: int) -> tuple[list[Block], list[MovingCapsule]]:
    """What is shown of a world: blocks and bars.

    Args:
        world: "flat", "terrain", "stool" or "playground".
        frames: Of the story in which it is shown.
    """
    if world == STOOL:
        return [
            Block((*box.center, 0.5 * box.height), (*box.half_sizes, 0.5 * box.height), box.yaw)
            for box in stool_world().obstacles
        ], []
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
