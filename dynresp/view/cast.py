"""All that is to be seen at one moment of a story, as solids in the world."""

from __future__ import annotations

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.view import shapes
from dynresp.view.shapes import Mesh
from dynresp.view.story import Block, PhaseName, Story, row_at

_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
# What reaches higher than this is a wall, of which only the lowest part is shown [m]: it would hide
# the person beside it.
_WALL, _WALL_SHOWN = 1.2, 0.35


class Cast:
    """The characters and things of a story.

    Attributes:
        story: Whose they are.
        solids: What a character is made of.
        states: Bodies of the main character, frame by frame.
        others: Bodies of the further characters, each as many frames as it has.
        head: Index of the head among the bodies.
    """

    def __init__(self, story: Story) -> None:
        """Compute where all bodies are.

        Args:
            story: What is shown.
        """
        character = default_character()
        self.story = story
        self.head = character.body("head")
        self.solids = shapes.character_solids(character)
        self.states = character.kinematics(story.motion.poses)
        self.others = tuple(character.kinematics(other.poses) for other in story.others)

    def meshes(
        self, frame: int, phase: PhaseName | None, dye: float, within: float = np.inf
    ) -> list[Mesh]:
        """All solids at a frame, in the world.

        Args:
            frame: Frame of the story.
            phase: In whose colour the main character's clothes are dyed.
            dye: How much, 0 to 1.
            within: Things further than this from the main character's pelvis, along the ground,
                are left out; further characters count from twice as far [m].
        """
        colors = shapes.phase_colors(self.solids, phase, dye)
        meshes = shapes.place(self.solids, self.states, frame, colors)
        for number, states in enumerate(self.others):
            there = min(frame, len(states.positions) - 1)
            if self.distance(states.positions[there, 0], frame) <= 2 * within:
                colors = shapes.other_colors(self.solids, number)
                meshes += shapes.place(self.solids, states, there, colors)
        for ball in self.story.spheres:
            at = row_at(ball.positions, frame)
            if at is not None and self.distance(at, frame) <= within:
                meshes.append(shapes.sphere(ball.radius, shapes.BALL_COLOR).placed(at, _UPRIGHT))
        for rod in self.story.capsules:
            at = row_at(rod.positions, frame)
            if at is not None and self.distance(at, frame) <= within:
                mesh = shapes.capsule(rod.radius, rod.half_length, shapes.CAPSULE_COLOR)
                meshes.append(mesh.placed(at, rod.quaternions[frame]))
        return meshes

    def blocks(self) -> list[Mesh]:
        """The blocks, in the world; walls are cut off above the knee."""
        return [self._block(block) for block in self.story.blocks]

    def underfoot(self, frame: int, within: float) -> list[Mesh]:
        """Blocks, no walls, whose middle is this near to the main character at a frame [m]."""
        return [
            self._block(block)
            for block in self.story.blocks
            if block.top <= _WALL and self.distance(np.array(block.center), frame) <= within
        ]

    @staticmethod
    def _block(block: Block) -> Mesh:
        top = block.top if block.top <= _WALL else _WALL_SHOWN
        bottom = min(block.center[2] - block.half_sizes[2], top - 0.01)
        sizes = (*block.half_sizes[:2], 0.5 * (top - bottom))
        center = np.array([*block.center[:2], 0.5 * (top + bottom)])
        return shapes.box(sizes, shapes.BLOCK_COLOR).placed(center, rotations.from_yaw(block.yaw))

    def distance(self, point: FloatArray, frame: int) -> float:
        """From the main character's pelvis to a point (3,), along the ground [m]."""
        return float(np.linalg.norm((point - self.states.positions[frame, 0])[:2]))

    def foot_print(self, frame: int) -> FloatArray:
        """(3,) the point of the floor below the main character's centre of mass."""
        masses = default_character().masses
        middle = masses @ self.states.centers[frame] / masses.sum()
        return np.array([middle[0], middle[1], 0.0])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) of the box that all characters stay in [m]."""
        points = np.concatenate(
            [states.positions.reshape(-1, 3) for states in (self.states, *self.others)]
        )
        return points.min(axis=0), points.max(axis=0)
