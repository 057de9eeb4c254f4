"""All that is to be seen at one moment of a story, as solids in the world."""

from __future__ import annotations

import itertools

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.view import body_shapes as shapes
from dynresp.view.body_shapes import Mesh
from dynresp.view.story import MovingCapsule, PhaseName, Story, row_at

_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
# What reaches higher than this is a wall, of which only the lowest part is shown [m]: it would hide
# the person beside it.
_WALL, _WALL_SHOWN = 1.2, 0.35
# By how much less a block is drawn than the one before it in the list [m], so many times.
_LESS, _SIZES = 0.0004, 16
# Width and height of lines on the ground, and of the edge of the world [m].
_LINE, _EDGE = (0.035, 0.004), (0.06, 0.05)


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
        still = [_stands_still(rod, len(story.motion)) for rod in story.capsules]
        self._bars = [rod for rod, stands in zip(story.capsules, still, strict=True) if stands]
        self._limbs = [rod for rod, stands in zip(story.capsules, still, strict=True) if not stands]

    def meshes(
        self, frame: int, phase: PhaseName | None, dye: float, within: float = np.inf
    ) -> list[Mesh]:
        """All solids at a frame, in the world, but for what `standing` tells of.

        Bars that stand still are among them only where they are near.

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
        near = self._bars if np.isfinite(within) else []
        for rod in (*self._limbs, *near):
            at = row_at(rod.positions, frame)
            if at is not None and self.distance(at, frame) <= within:
                mesh = shapes.capsule(rod.radius, rod.half_length, shapes.CAPSULE_COLOR)
                meshes.append(mesh.placed(at, rod.quaternions[frame]))
        return meshes

    def standing(self) -> list[Mesh]:
        """All that stands still the whole time: blocks, bars, lines on the ground, its edge."""
        return [*self.blocks(), *self.bars(), *self.lines(), *self.edge()]

    def bars(self) -> list[Mesh]:
        """The capsules that stand still, in the world."""
        return [
            shapes.capsule(bar.radius, bar.half_length, shapes.CAPSULE_COLOR).placed(
                bar.positions[0], bar.quaternions[0]
            )
            for bar in self._bars
        ]

    def lines(self) -> list[Mesh]:
        """What is drawn on the ground, in the world."""
        return [
            shapes.ribbon(path.points, *_LINE, color)
            for path, color in zip(
                self.story.paths, itertools.cycle(shapes.PATH_COLORS), strict=False
            )
        ]

    def edge(self) -> list[Mesh]:
        """A low kerb along the bounds of the world, where it has any."""
        outline = self.story.outline
        return [] if outline is None else [shapes.ribbon(outline, *_EDGE, shapes.BOUNDS_COLOR)]

    def blocks(self) -> list[Mesh]:
        """The blocks, in the world; walls are cut off above the knee."""
        return [self._block(number) for number in range(len(self.story.blocks))]

    def underfoot(self, frame: int, within: float) -> list[Mesh]:
        """Blocks, no walls, whose middle is this near to the main character at a frame [m]."""
        return [
            self._block(number)
            for number, block in enumerate(self.story.blocks)
            if block.top <= _WALL and self.distance(np.array(block.center), frame) <= within
        ]

    def _block(self, number: int) -> Mesh:
        block = self.story.blocks[number]
        # Where two walls meet, faces that lie in one plane would flicker and be lit twice.
        less = _LESS * (number % _SIZES)
        top = (block.top if block.top <= _WALL else _WALL_SHOWN) - less
        bottom = min(block.center[2] - block.half_sizes[2], top - 0.01)
        x, y = (max(half - less, 0.5 * half) for half in block.half_sizes[:2])
        sizes = (x, y, 0.5 * (top - bottom))
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


def _stands_still(rod: MovingCapsule, frames: int) -> bool:
    """Whether a capsule is in one place through all of a story's frames."""
    ways = np.concatenate([rod.positions, rod.quaternions], axis=1)
    return len(ways) >= frames > 1 and bool((ways == ways[0]).all())
