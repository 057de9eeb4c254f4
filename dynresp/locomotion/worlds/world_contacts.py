"""Contacts with an environment that is no flat floor: soles on uneven ground, hands on bars.

A body part touches a thing if it is near it and hardly moves (Lee et al. 2002, section 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.ground import CONTACT_GAP_S, CONTACT_HEIGHT, CONTACT_SPEED, sole_points
from dynresp.motion.motion import FEET
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray
from dynresp.support.runs import runs

Ground: TypeAlias = Callable[[FloatArray], FloatArray]
"""Height [m] of the ground at points (..., 2): (...); not a number where there is none."""

# Part of the way from a sole's middle to its corners at which the ground beneath it is looked up. A
# toe may stick out over an edge, or seem to reach into the next block by what the grid is wrong.
_INNER = 0.5
PALM = np.array([0.0, 0.0, -0.35])
"""The middle of a hand, which closes about things, in the forearm's frame [m]."""
PALM.flags.writeable = False


@dataclass(frozen=True)
class StanceConfig:
    """When a foot stands, whatever it stands on.

    Attributes:
        speed: All corners of its sole are at most this fast [m/s].
        shortest_s: For at least this long [s].
    """

    speed: float = 0.35
    shortest_s: float = 0.1


@dataclass(frozen=True, eq=False)
class Stances:
    """Times at which feet stand.

    Attributes:
        feet: (k,) 0 for the left foot, 1 for the right one.
        starts: (k,) first frames.
        stops: (k,) one past the last frames.
        soles: (k, 4, 3) where the corners of the soles are, medians over the frames [m].
    """

    feet: npt.NDArray[np.intp]
    starts: npt.NDArray[np.intp]
    stops: npt.NDArray[np.intp]
    soles: FloatArray

    def __len__(self) -> int:
        """Number of stances."""
        return len(self.feet)


def sole_corners(character: Character, states: BodyStates) -> FloatArray:
    """(frames, 2, 4, 3) corners of the left and the right sole [m]: two of the heel, then ball."""
    columns = []
    for side in FEET:
        foot = character.body(f"{side}_foot")
        corners = rotations.rotate(states.quaternions[:, foot, None], sole_points(character, side))
        columns.append(states.positions[:, foot, None] + corners)
    return np.stack(columns, axis=1)


def standing_soles(character: Character, poses: npt.ArrayLike, contacts: BoolArray) -> FloatArray:
    """Where the feet stand, frame by frame.

    Args:
        character: The character.
        poses: (frames, 59).
        contacts: (frames, 2 or more) what touches; the first two columns are the feet.

    Returns:
        (frames, 2, 4, 3) corners of the soles [m]; not numbers where a foot does not stand.
    """
    corners = sole_corners(character, character.kinematics(poses))
    return np.where(contacts[:, :2, None, None], corners, np.nan)


def palms(character: Character, states: BodyStates) -> FloatArray:
    """(frames, 2, 3) the middle of the left and of the right hand [m]."""
    columns = []
    for side in FEET:
        arm = character.body(f"{side}_forearm")
        columns.append(
            states.positions[:, arm] + rotations.rotate(states.quaternions[:, arm], PALM)
        )
    return np.stack(columns, axis=1)


def speeds(points: FloatArray, fps: float) -> FloatArray:
    """Speeds (frames, ...) [m/s] of points (frames, ..., 3), by central differences."""
    if len(points) < 2:
        return np.zeros(points.shape[:-1])
    return np.asarray(np.linalg.norm(np.gradient(points, 1.0 / fps, axis=0), axis=-1))


def find_stances(corners: FloatArray, fps: float, config: StanceConfig | None = None) -> Stances:
    """When and where feet stand.

    Args:
        corners: (frames, 2, 4, 3) corners of the soles [m]; see `sole_corners`.
        fps: Frame rate [1/s].
        config: What standing is.

    Returns:
        The stances, those of the left foot first, each foot's in the order of time.
    """
    config = config or StanceConfig()
    slow = np.all(speeds(corners, fps) <= config.speed, axis=2)
    found = [
        (foot, start, stop)
        for foot in range(2)
        for start, stop in runs(slow[:, foot])
        if stop - start >= config.shortest_s * fps
    ]
    feet, starts, stops = np.array(found, dtype=np.intp).reshape(-1, 3).T
    soles = [np.median(corners[start:stop, foot], axis=0) for foot, start, stop in found]
    return Stances(feet, starts, stops, np.array(soles).reshape(-1, 4, 3))


def heights_above(ground: Ground, soles: FloatArray) -> FloatArray:
    """Heights [m] of the points of soles above the ground.

    Args:
        ground: Its height.
        soles: (..., points, 3) [m].

    Returns:
        (..., points). The ground is taken half way between each point and the middle of its sole.
    """
    middle = soles[..., :2].mean(axis=-2, keepdims=True)
    return np.asarray(soles[..., 2] - ground(middle + _INNER * (soles[..., :2] - middle)))


def feet_on(ground: Ground, corners: FloatArray, fps: float) -> BoolArray:
    """Which feet stand on uneven ground: some corner of the sole is near it and slow.

    As near and as slow as on level ground (`dynresp.motion.ground`).

    Args:
        ground: Its height.
        corners: (frames, 2, 4, 3) corners of the soles [m].
        fps: Frame rate [1/s].

    Returns:
        (frames, 2): left, right.
    """
    low = heights_above(ground, corners) <= CONTACT_HEIGHT
    near = np.any(low & (speeds(corners, fps) <= CONTACT_SPEED), axis=2)
    return steady(near, fps, CONTACT_GAP_S)


def steady(flags: BoolArray, fps: float, gap_s: float) -> BoolArray:
    """Flags (frames, columns) with gaps closed, then runs dropped, that are shorter than a time.

    Runs and gaps at the ends are cut off by the recording, and stay.

    Args:
        flags: What is to be made steady.
        fps: Frame rate [1/s].
        gap_s: The time [s].
    """
    from scipy import ndimage

    length = max(1, round(gap_s * fps))
    window = np.ones((length, 1), dtype=bool)
    # Ends are drawn out so that what is cut off there counts as long.
    padded = np.pad(flags, ((2 * length, 2 * length), (0, 0)), mode="edge")
    closed = ndimage.binary_closing(padded, window)
    opened: BoolArray = ndimage.binary_opening(closed, window)[2 * length : -2 * length]
    return opened
