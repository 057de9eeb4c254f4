"""All solids of a story at one moment, in the world: characters, balls, blocks, lines."""

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
# A block higher than this is a wall [m]. Only its lowest part is shown: it would hide the person
# beside it.
_WALL, _WALL_SHOWN = 1.2, 0.35
# Each block is drawn this much smaller than the one before it in the list [m]; this many sizes.
_LESS, _SIZES = 0.0004, 16
# Width and height of lines on the ground, and of the edge of the world [m].
_LINE, _EDGE = (0.035, 0.004), (0.06, 0.05)


class SceneSolids:
    """The characters and things of a story.

    Attributes:
        story: The story.
        solids: The solids that make up a character.
        states: Bodies of the main character, frame by frame.
        others: Bodies of the further characters, each as many frames as it has.
        head: Index of the head among the bodies.
    """

    def __init__(self, story: Story) -> None:
        """Compute the kinematics of all characters.

        Args:
            story: What is shown.
        """
        character = default_character()
        self.story = story
        self.head = character.body("head")
        self.solids = shapes.character_solids(character)
        self.states = character.kinematics(story.motion.poses)
        self.others = tuple(character.kinematics(other.poses) for other in story.others)
        static = [_is_static(rod, len(story.motion)) for rod in story.capsules]
        self._bars = [rod for rod, fixed in zip(story.capsules, static, strict=True) if fixed]
        self._limbs = [rod for rod, fixed in zip(story.capsules, static, strict=True) if not fixed]

    def meshes(
        self, frame: int, phase: PhaseName | None, dye: float, within: float = np.inf
    ) -> list[Mesh]:
        """All solids at a frame, in the world, without those that `static` returns.

        Bars that do not move are included only if they are near.

        Args:
            frame: Frame of the story.
            phase: The phase whose colour the main character's clothes take.
            dye: How much of that colour, 0 to 1.
            within: Things farther than this from the main character's pelvis, along the ground,
                are left out [m]; for other characters the distance is twice this.
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

    def static(self) -> list[Mesh]:
        """All that never moves: blocks, bars, lines on the ground, the edge of the world."""
        return [*self.blocks(), *self.bars(), *self.lines(), *self.edge()]

    def bars(self) -> list[Mesh]:
        """The capsules that never move, in the world."""
        return [
            shapes.capsule(bar.radius, bar.half_length, shapes.CAPSULE_COLOR).placed(
                bar.positions[0], bar.quaternions[0]
            )
            for bar in self._bars
        ]

    def lines(self) -> list[Mesh]:
        """The lines on the ground, in the world."""
        return [
            shapes.ribbon(path.points, *_LINE, color)
            for path, color in zip(
                self.story.paths, itertools.cycle(shapes.PATH_COLORS), strict=False
            )
        ]

    def edge(self) -> list[Mesh]:
        """A low kerb along the bounds of the world, if it has bounds."""
        outline = self.story.outline
        return [] if outline is None else [shapes.ribbon(outline, *_EDGE, shapes.BOUNDS_COLOR)]

    def blocks(self) -> list[Mesh]:
        """The blocks, in the world; walls are cut off above the knee."""
        return [self._block(number) for number in range(len(self.story.blocks))]

    def underfoot(self, frame: int, within: float) -> list[Mesh]:
        """Blocks (not walls) whose centre is within a distance [m] of the main character."""
        return [
            self._block(number)
            for number, block in enumerate(self.story.blocks)
            if block.top <= _WALL and self.distance(np.array(block.center), frame) <= within
        ]

    def _block(self, number: int) -> Mesh:
        block = self.story.blocks[number]
        # Faces of two walls in one plane would flicker and be lit twice.
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

    def ground_point(self, frame: int) -> FloatArray:
        """(3,) the point on the floor below the main character's centre of mass [m]."""
        masses = default_character().masses
        middle = masses @ self.states.centers[frame] / masses.sum()
        return np.array([middle[0], middle[1], 0.0])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) of the box around all characters at all times [m]."""
        points = np.concatenate(
            [states.positions.reshape(-1, 3) for states in (self.states, *self.others)]
        )
        return points.min(axis=0), points.max(axis=0)


def _is_static(rod: MovingCapsule, frames: int) -> bool:
    """Whether a capsule keeps its pose through all frames of a story."""
    rows = np.concatenate([rod.positions, rod.quaternions], axis=1)
    return len(rows) >= frames > 1 and bool((rows == rows[0]).all())
