"""All that is to be seen at one moment of a story, as solids in the world."""

from __future__ import annotations

import numpy as np

from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.view import shapes
from dynresp.view.shapes import Mesh
from dynresp.view.story import PhaseName, Story, row_at

_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


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
