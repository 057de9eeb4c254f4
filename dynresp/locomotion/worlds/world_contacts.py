"""Contacts with worlds other than a flat floor: soles on uneven ground, hands on bars.

A body part touches a thing if it is near and hardly moves (Lee et al. 2002, section 3).
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
"""Height [m] of the ground at points (..., 2): (...); NaN where there is no ground."""

# The ground under a sole is that at this share of the distance from its middle to its corners: a
# toe may stick out over an edge, and an error of the grid may put it into the next block.
_INNER = 0.5
PALM = np.array([0.0, 0.0, -0.35])
"""The middle of a gripping hand, in the forearm's frame [m]."""
PALM.flags.writeable = False


# A foot stands, whatever it stands on, while no corner of its sole is faster than this [m/s],
# for at least this long [s].
_STANCE_SPEED, _MIN_STANCE_S = 0.35, 0.1


@dataclass(frozen=True, eq=False)
class Stances:
    """Times at which feet stand.

    Attributes:
        feet: (k,) 0 for the left foot, 1 for the right one.
        starts: (k,) first frames.
        stops: (k,) one past the last frames.
        soles: (k, 4, 3) corners of the soles, medians over the frames [m].
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


def find_stances(corners: FloatArray, fps: float) -> Stances:
    """Find when and where feet stand.

    Args:
        corners: (frames, 2, 4, 3) corners of the soles [m]; see `sole_corners`.
        fps: Frame rate [1/s].

    Returns:
        The stances: first those of the left foot; of each foot in the order of time.
    """
    slow = np.all(speeds(corners, fps) <= _STANCE_SPEED, axis=2)
    found = [
        (foot, start, stop)
        for foot in range(2)
        for start, stop in runs(slow[:, foot])
        if stop - start >= _MIN_STANCE_S * fps
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
        (..., points). The ground is that half-way between each point and the middle of its sole.
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

    Runs and gaps at the ends stay: they may be longer than the recording shows.

    Args:
        flags: What to make steady.
        fps: Frame rate [1/s].
        gap_s: The time [s].
    """
    from scipy import ndimage

    length = max(1, round(gap_s * fps))
    window = np.ones((length, 1), dtype=bool)
    # The ends are extended, so that runs that are cut off there count as long.
    padded = np.pad(flags, ((2 * length, 2 * length), (0, 0)), mode="edge")
    closed = ndimage.binary_closing(padded, window)
    opened: BoolArray = ndimage.binary_opening(closed, window)[2 * length : -2 * length]
    return opened
