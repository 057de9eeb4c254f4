"""A playground to climb, swing and hang in: its bars, and contacts of hands and feet with them.

Twelve clips of the CMU database (subject 1) were recorded on the same equipment in one world: hands
and feet come to the same places in clip after clip. The files do not describe the equipment. The
bars of `recorded_playground` were measured from the places of slow hands and feet, after
retargeting; they are right to some 5 cm, and bars that nobody touched are missing.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.worlds.world_contacts import palms, sole_corners, speeds, steady
from dynresp.motion.character import Character
from dynresp.motion.ground import CONTACT_GAP_S, CONTACT_HEIGHT, CONTACT_SPEED
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.checks import check_number, check_vector
from dynresp.support.errors import UsageError

# (name, one end, the other end) of each bar [m], in the world of the motions as they are loaded
# with flat_floor=False: the ground is at height 0.
_RECORDED: tuple[tuple[str, tuple[float, float, float], tuple[float, float, float]], ...] = (
    ("east ladder, rung 1", (2.80, 0.45, 0.29), (2.80, 1.12, 0.29)),
    ("east ladder, rung 2", (2.67, 0.45, 0.54), (2.67, 1.12, 0.54)),
    ("east ladder, rung 3", (2.55, 0.45, 0.81), (2.55, 1.12, 0.81)),
    ("east ladder, rung 4", (2.41, 0.45, 1.06), (2.41, 1.12, 1.06)),
    ("east ladder, rung 5", (2.24, 0.45, 1.34), (2.24, 1.12, 1.34)),
    ("east ladder, left rail", (2.24, 0.45, 1.34), (2.10, 0.45, 1.85)),
    ("east ladder, right rail", (2.24, 1.12, 1.34), (2.10, 1.12, 1.85)),
    ("overhead ladder, rung 1", (2.20, 0.45, 2.26), (2.20, 1.12, 2.26)),
    ("overhead ladder, rung 2", (1.92, 0.45, 2.24), (1.92, 1.12, 2.24)),
    ("overhead ladder, rung 3", (1.68, 0.45, 2.25), (1.68, 1.12, 2.25)),
    ("overhead ladder, rung 4", (1.02, 0.45, 2.10), (1.02, 1.12, 2.10)),
    ("overhead ladder, rung 5", (0.70, 0.45, 2.06), (0.70, 1.12, 2.06)),
    ("south ladder, rung 1", (-0.85, -1.34, 0.26), (-0.30, -1.34, 0.26)),
    ("south ladder, rung 2", (-0.85, -1.17, 0.52), (-0.30, -1.17, 0.52)),
    ("south ladder, rung 3", (-0.85, -1.03, 0.76), (-0.30, -1.03, 0.76)),
    ("south ladder, rung 4", (-0.85, -0.82, 1.00), (-0.30, -0.82, 1.00)),
    ("south ladder, rung 5", (-0.85, -0.67, 1.20), (-0.30, -0.67, 1.20)),
    ("south ladder, top", (-0.95, -0.46, 1.40), (-0.10, -0.46, 1.40)),
    ("south bar", (-0.85, -0.48, 2.25), (-0.20, -0.48, 2.25)),
    ("north ladder, rung 1", (-0.85, 2.20, 0.30), (-0.30, 2.20, 0.30)),
    ("north ladder, rung 2", (-0.85, 2.02, 0.54), (-0.30, 2.02, 0.54)),
    ("north ladder, rung 3", (-0.85, 1.81, 0.78), (-0.30, 1.81, 0.78)),
    ("north ladder, rung 4", (-0.85, 1.64, 1.00), (-0.30, 1.64, 1.00)),
    ("north ladder, rung 5", (-0.85, 1.52, 1.21), (-0.30, 1.52, 1.21)),
    ("north ladder, top", (-0.95, 1.33, 1.45), (-0.10, 1.33, 1.45)),
    ("north bar", (-0.85, 1.33, 2.20), (-0.20, 1.33, 2.20)),
    ("seat", (-0.13, -1.25, 1.40), (-0.13, 2.10, 1.45)),
    ("high bar", (0.07, -1.40, 2.25), (0.08, 2.15, 2.32)),
    ("swing bar", (0.35, -0.46, 1.76), (0.90, -0.46, 1.76)),
)


@dataclass(frozen=True)
class Bar:
    """A round bar.

    Attributes:
        name: Its name.
        start: One end [m].
        stop: The other end [m].
        radius: Its radius [m].
    """

    name: str
    start: tuple[float, float, float]
    stop: tuple[float, float, float]
    radius: float = 0.02

    def closest(self, points: npt.ArrayLike) -> FloatArray:
        """The point of its axis that is closest to each of the points (..., 3) [m]."""
        start, along = np.array(self.start), np.subtract(self.stop, self.start)
        away = np.asarray(points, dtype=np.float64) - start
        share = np.clip(away @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        return np.asarray(start + share[..., None] * along)

    def distance(self, points: npt.ArrayLike) -> FloatArray:
        """Distance [m] of points (..., 3) from its axis, (...)."""
        return np.asarray(np.linalg.norm(self.closest(points) - np.asarray(points), axis=-1))


@dataclass(frozen=True)
class Playground:
    """Bars above level ground at height 0.

    Attributes:
        bars: The bars.

    Raises:
        UsageError: Two bars have the same name, an end is not finite, or a radius is not above 0.
    """

    bars: tuple[Bar, ...]

    def __post_init__(self) -> None:
        """Check the bars."""
        names = [bar.name for bar in self.bars]
        if len(set(names)) < len(names):
            raise UsageError(f"each bar needs a different name, got {', '.join(sorted(names))}")
        for bar in self.bars:
            check_vector(f"start of bar {bar.name!r}", bar.start, 3)
            check_vector(f"stop of bar {bar.name!r}", bar.stop, 3)
            check_number(f"radius of bar {bar.name!r}", bar.radius, 0.0, above_low=True)

    def nearest(self, points: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """The bar nearest to each of the points (..., 3): its index, and its axis' distance [m].

        Raises:
            UsageError: There are no bars.
        """
        if not self.bars:
            raise UsageError("this playground has no bars, so none is nearest; give it bars")
        distances = np.stack([bar.distance(points) for bar in self.bars])
        return distances.argmin(axis=0), distances.min(axis=0)


# A hand holds a bar if its middle is at most this far from the bar's axis [m] and at most this fast
# [m/s]: hands slip along as their arms turn. The same of the middle of a sole.
_HAND_REACH_M, _HAND_SPEED = 0.13, 0.8
_FOOT_REACH_M, _FOOT_SPEED = 0.10, 0.5


@functools.cache
def recorded_playground() -> Playground:
    """The bars on which CMU's subject 1 was recorded, as far as the clips show them."""
    return Playground(tuple(Bar(*row) for row in _RECORDED))


def playground_contacts(
    motion: Motion,
    character: Character,
    playground: Playground | None = None,
) -> BoolArray:
    """Which hands and feet hold a bar or stand on the ground, frame by frame.

    Args:
        motion: A motion in the world of the playground, loaded with flat_floor=False.
        character: The character.
        playground: The bars, by default `recorded_playground`.

    Returns:
        (frames, 4): left foot, right foot, left hand, right hand.
    """
    playground = recorded_playground() if playground is None else playground
    states = character.kinematics(motion.poses)
    corners = sole_corners(character, states)
    low = corners[..., 2] <= CONTACT_HEIGHT
    standing = (low & (speeds(corners, motion.fps) <= CONTACT_SPEED)).any(axis=2)
    hands, soles = palms(character, states), corners.mean(axis=2)
    if playground.bars:
        standing |= (playground.nearest(soles)[1] <= _FOOT_REACH_M) & (
            speeds(soles, motion.fps) <= _FOOT_SPEED
        )
        holding = (playground.nearest(hands)[1] <= _HAND_REACH_M) & (
            speeds(hands, motion.fps) <= _HAND_SPEED
        )
    else:
        holding = np.zeros(hands.shape[:2], dtype=bool)
    return steady(np.concatenate([standing, holding], axis=1), motion.fps, CONTACT_GAP_S)
