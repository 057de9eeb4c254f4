"""A story: everything that recording, filmstrip, video and plan show.

It holds the main character's motion, other characters, balls, blocks, events and phases. World:
metres, Z up. All parts use the clock of the main motion: row k is at time k / fps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError, UnknownNameError

PhaseName = Literal["base motion", "physics", "blend", "reaction"]
PHASE_NAMES: tuple[PhaseName, ...] = get_args(PhaseName)


@dataclass(frozen=True, eq=False)
class MovingSphere:
    """A moving ball. Arrays are read-only.

    Attributes:
        name: What it is, for people, such as "ball".
        radius: [m].
        positions: (n, 3) centre in the world [m], one row a frame of the story; rows of NaN where
            it is absent. May be shorter than the story: it is absent from then on.

    Raises:
        MotionError: A wrong shape, a radius that is not positive, a row only partly NaN.
    """

    name: str
    radius: float
    positions: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        _check_length("radius", self.name, self.radius)
        object.__setattr__(self, "positions", _rows(self.name, "positions", self.positions, 3))


@dataclass(frozen=True, eq=False)
class MovingCapsule:
    """A moving limb or stick. Arrays are read-only.

    Attributes:
        name: What it is, for people, such as "fist".
        radius: [m].
        half_length: Half the length of its straight part, along its own Z axis [m].
        positions: (n, 3) centre in the world [m], one row a frame of the story; rows of NaN where
            it is absent. May be shorter than the story: it is absent from then on.
        quaternions: (n, 4) orientation, w x y z; ignored where it is absent.

    Raises:
        MotionError: A wrong shape, a size that is not positive, a row only partly NaN.
    """

    name: str
    radius: float
    half_length: float
    positions: FloatArray
    quaternions: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        _check_length("radius", self.name, self.radius)
        _check_length("half_length", self.name, self.half_length)
        positions = _rows(self.name, "positions", self.positions, 3)
        quaternions = np.asarray(self.quaternions, dtype=np.float64)
        if quaternions.shape != (len(positions), 4):
            raise MotionError(
                f"{self.name}: quaternions must be ({len(positions)}, 4), got {quaternions.shape}"
            )
        present = ~np.isnan(positions[:, 0])
        if not np.isfinite(quaternions[present]).all():
            raise MotionError(f"{self.name}: a quaternion is not finite where it is present")
        quaternions = rotations.normalize(np.where(present[:, None], quaternions, 0.0))
        quaternions.flags.writeable = False
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "quaternions", quaternions)


@dataclass(frozen=True)
class Block:
    """A box that does not move: a wall, a stool, a block of rough ground.

    Attributes:
        center: Its middle [m], world.
        half_sizes: Half its length along its own x, y and z [m].
        yaw: Its turn about the vertical [rad].

    Raises:
        MotionError: A number is not finite, or a size is not positive.
    """

    center: tuple[float, float, float]
    half_sizes: tuple[float, float, float]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not all(math.isfinite(x) for x in (*self.center, self.yaw)):
            raise MotionError(f"a block must be at a finite place, got {self.center}")
        for size in self.half_sizes:
            _check_length("half a side", "block", size)

    @property
    def top(self) -> float:
        """How high it reaches [m]."""
        return self.center[2] + self.half_sizes[2]


@dataclass(frozen=True, eq=False)
class GroundPath:
    """A line drawn on the ground, such as a sketched path. The array is read-only.

    Attributes:
        name: What it is, for people, such as "sketch".
        points: (n, 2) [m].

    Raises:
        MotionError: A wrong shape, or a number that is not finite.
    """

    name: str
    points: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze the points."""
        points = _rows(self.name, "points", self.points, 2)
        if np.isnan(points).any() or len(points) < 2:
            raise MotionError(f"{self.name}: a path needs two or more finite points")
        object.__setattr__(self, "points", points)


@dataclass(frozen=True)
class StoryEvent:
    """Something that happens at one moment.

    Attributes:
        name: What happens, such as "contact".
        time_s: When [s] from the start of the story.
    """

    name: str
    time_s: float


@dataclass(frozen=True)
class StoryPhase:
    """A part of the story in which one thing drives the character.

    Attributes:
        name: "base motion", "physics", "blend" or "reaction".
        start_s: When it begins [s] from the start of the story.
        stop_s: When it ends [s].

    Raises:
        UnknownNameError: Another name.
        MotionError: It ends before it begins.
    """

    name: PhaseName
    start_s: float
    stop_s: float

    def __post_init__(self) -> None:
        """Check the name and the times."""
        if self.name not in PHASE_NAMES:
            raise UnknownNameError("phase", self.name, PHASE_NAMES)
        if not self.start_s <= self.stop_s:
            raise MotionError(
                f"phase {self.name!r} must not end before it begins, "
                f"got {self.start_s} s to {self.stop_s} s"
            )


@dataclass(frozen=True, eq=False)
class Story:
    """All that is shown, on the clock of the main character's motion.

    Attributes:
        motion: The main character.
        spheres: Balls.
        capsules: Limbs or sticks.
        others: Other characters, at the frame rate of `motion`; each holds its last pose.
        blocks: Boxes that do not move.
        paths: Lines on the ground.
        bounds: Of the world, (x, y, x, y) of two corners [m]; None without bounds.
        events: Moments with names.
        phases: What drives the main character, and when; where two overlap, the later one counts.
        title: First line, for people.
        subtitle: Second line.

    Raises:
        MotionError: Another character has another frame rate; an event is outside the story.
    """

    motion: Motion
    spheres: Sequence[MovingSphere] = ()
    capsules: Sequence[MovingCapsule] = ()
    others: Sequence[Motion] = ()
    blocks: Sequence[Block] = ()
    paths: Sequence[GroundPath] = ()
    bounds: tuple[float, float, float, float] | None = None
    events: Sequence[StoryEvent] = ()
    phases: Sequence[StoryPhase] = ()
    title: str = ""
    subtitle: str = ""
    times: FloatArray = field(init=False, repr=False)
    """(frames,) [s] of each frame, from 0."""

    def __post_init__(self) -> None:
        """Check that all parts share one clock."""
        for name in ("spheres", "capsules", "others", "blocks", "paths", "events", "phases"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for other in self.others:
            if other.fps != self.motion.fps:
                raise MotionError(
                    f"character {other.name!r} runs at {other.fps:g} fps, the story at "
                    f"{self.motion.fps:g}; use its resampled({self.motion.fps:g})"
                )
        # Half a frame of tolerance: events come from simulations that end between two frames.
        last = self.motion.duration + 0.5 / self.motion.fps
        for event in self.events:
            if not -0.5 / self.motion.fps <= event.time_s <= last:
                raise MotionError(
                    f"event {event.name!r} at {event.time_s} s is outside the story, "
                    f"which runs from 0 to {self.motion.duration:g} s"
                )
        times = np.arange(len(self.motion)) / self.motion.fps
        times.flags.writeable = False
        object.__setattr__(self, "times", times)

    @property
    def outline(self) -> FloatArray | None:
        """(5, 2) the corners of the bounds [m], the first also at the end; None without bounds."""
        if self.bounds is None:
            return None
        a, b, c, d = self.bounds
        return np.array([[a, b], [c, b], [c, d], [a, d], [a, b]])

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return self.motion.duration

    def phase_at(self, time_s: float) -> PhaseName | None:
        """What drives the main character at a time [s]; None where the story does not say."""
        for phase in reversed(self.phases):
            if phase.start_s <= time_s < phase.stop_s:
                return phase.name
        # The end of the story belongs to the phase before it.
        for phase in reversed(self.phases):
            if math.isclose(time_s, phase.stop_s, abs_tol=0.5 / self.motion.fps):
                return phase.name
        return None

    def frame_at(self, time_s: float) -> int:
        """The frame nearest to a time [s]."""
        return int(np.clip(round(time_s * self.motion.fps), 0, len(self.motion) - 1))


def row_at(rows: FloatArray, frame: int) -> FloatArray | None:
    """Where a moving thing is at a frame, or None where it is absent.

    Args:
        rows: (n, 3) as in `MovingSphere.positions`.
        frame: Frame of the story.
    """
    if frame >= len(rows) or np.isnan(rows[frame, 0]):
        return None
    row: FloatArray = rows[frame]
    return row


def _check_length(what: str, name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise MotionError(f"{name}: {what} must be a positive length in metres, got {value}")


def _rows(name: str, what: str, rows: npt.ArrayLike, width: int) -> FloatArray:
    array = np.array(rows, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != width:
        raise MotionError(f"{name}: {what} must be (n, {width}), got {array.shape}")
    absent = np.isnan(array)
    if (absent.any(axis=1) != absent.all(axis=1)).any() or np.isinf(array).any():
        raise MotionError(f"{name}: each row of {what} must be all finite or all NaN")
    array.flags.writeable = False
    return array
