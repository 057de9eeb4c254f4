"""Measure gait: stances, step lengths, widths and times (Lee et al. 2002, figure 9).

Stances are detected in every motion from the heights and speeds of its soles, so a recording and a
walk through a graph are measured alike.

A step is defined by three consecutive stances: one foot's, the other's and the first's again. The
line from the first to the third is the stride. The step's width is the distance of the second
stance from that line, its length how far the third stance is ahead of the second along the line,
and its time the time between their starts. Steps to the side and turning on the spot are not
counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.ground import foot_contacts, sole_points
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError
from dynresp.support.runs import runs

# A foot that comes down closer than this to its last stance has not moved [m].
_MOVED_M = 0.05
# Shorter strides are not counted as walking [m].
_STRIDE_M = 0.2
# Strides at larger angles to the facing direction, or its opposite, are steps to the side.
_MIN_COSINE = np.cos(np.radians(45.0))


@dataclass(frozen=True, eq=False)
class Gait:
    """The stances of a motion, sorted by their starts, and its steps.

    Attributes:
        feet: (k,) 0 for the left foot, 1 for the right one.
        places: (k, 2) position of the middle of the sole [m].
        yaws: (k,) yaw of the foot [rad].
        begins_s: (k,) start of each stance [s].
        lengths: (m,) of the steps [m].
        widths: (m,) of the steps [m]; negative where the feet cross.
        times: (m,) of the steps [s].
    """

    feet: npt.NDArray[np.int8]
    places: FloatArray
    yaws: FloatArray
    begins_s: FloatArray
    lengths: FloatArray
    widths: FloatArray
    times: FloatArray

    @property
    def cadence(self) -> float:
        """Steps a minute, by the median step; NaN without steps."""
        return 60.0 / float(np.median(self.times)) if len(self.times) else float("nan")


def measure_gait(motion: Motion, character: Character) -> Gait:
    """Measure how a motion walks on level ground.

    Args:
        motion: The motion; use 30 fps or more for exact step times.
        character: The character of the motion.
    """
    states = character.kinematics(motion.poses)
    contacts = foot_contacts(character, states, motion.fps)
    rows: list[tuple[float, int, float, float, float]] = []
    for foot, side in enumerate(FEET):
        body = character.body(f"{side}_foot")
        turns = states.quaternions[:, body]
        middle = sole_points(character, side).mean(axis=0)
        soles = (states.positions[:, body] + rotations.rotate(turns, middle))[:, :2]
        last = np.full(2, np.inf)
        for start, stop in runs(contacts[:, foot]):
            place = np.median(soles[start:stop], axis=0)
            if np.hypot(*(place - last)) >= _MOVED_M:
                yaw = float(rotations.yaw_of(turns[(start + stop) // 2]))
                rows.append((start / motion.fps, foot, float(place[0]), float(place[1]), yaw))
                last = place
    stances = np.array(sorted(rows)).reshape(-1, 5)
    begins, feet, places = stances[:, 0], stances[:, 1].astype(np.int8), stances[:, 2:4]
    frames = np.round(begins * motion.fps).astype(int)
    facing = rotations.yaw_of(motion.root_quaternions)[frames]
    return Gait(feet, places, stances[:, 4], begins, *_steps(feet, places, begins, facing))


def _steps(
    feet: npt.NDArray[np.int8], places: FloatArray, begins: FloatArray, facing: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths, widths and times of the steps among stances; see `Gait`.

    Args:
        feet: (k,).
        places: (k, 2).
        begins: (k,).
        facing: (k,) yaw of the root at the start of each stance [rad].
    """
    found = []
    for k in range(1, len(feet) - 1):
        stride = places[k + 1] - places[k - 1]
        length = float(np.hypot(*stride))
        if feet[k - 1] == feet[k] or feet[k + 1] == feet[k] or length < _STRIDE_M:
            continue
        if begins[k] == 0.0:
            # It stood there before the motion began.
            continue
        along = stride / length
        ahead = float(along @ (np.cos(facing[k]), np.sin(facing[k])))
        if abs(ahead) < _MIN_COSINE:
            continue
        other = places[k] - places[k - 1]
        # To the left of the facing direction, also when walking backward.
        left = float(along[0] * other[1] - along[1] * other[0]) * np.sign(ahead)
        side = 1.0 if feet[k] == 0 else -1.0
        found.append((length - float(other @ along), side * left, begins[k + 1] - begins[k]))
    lengths, widths, times = np.array(found).reshape(-1, 3).T
    return lengths, widths, times


def ground_speeds(motion: Motion, over_s: float = 1.0) -> FloatArray:
    """Speed of the root over the ground, frame by frame.

    The root sways with every step, so the speed is the distance between two positions `over_s`
    apart, about one cycle of a walk, divided by the time; less time at the ends of the motion.

    Args:
        motion: The motion, of at least two frames.
        over_s: Time between the positions [s].

    Returns:
        (frames,) [m/s].

    Raises:
        UsageError: The motion has only one frame, or the time is not above 0.
    """
    if len(motion) < 2 or not over_s > 0:
        raise UsageError(
            f"a speed needs two frames and a time above 0, got {len(motion)} frames, {over_s} s"
        )
    track = motion.root_positions[:, :2]
    half = max(1, round(0.5 * over_s * motion.fps))
    frames = np.arange(len(track))
    before, after = np.maximum(frames - half, 0), np.minimum(frames + half, len(track) - 1)
    distances: FloatArray = np.linalg.norm(track[after] - track[before], axis=1)
    return distances * motion.fps / (after - before)
