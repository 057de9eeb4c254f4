"""DeepMimic motion files: JSON with one row of 44 numbers a frame, for one fixed humanoid.

X. B. Peng et al., "DeepMimic: Example-Guided Deep Reinforcement Learning of Physics-Based Character
Skills", ACM Transactions on Graphics 37(4), 2018. A row holds the time to the next frame [s], the
root's position [m] and rotation, and the joints' rotations relative to their parents: quaternions
w x y z, or an angle [rad] where the joint is a hinge.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from dynresp.motion.readers.angles import rotations_about_axes
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.readers.text import (
    MAX_NUMBER,
    bad_number,
    check_size,
    decode,
    file_error,
    rate_of_frame_time,
    read_bounded,
)
from dynresp.motion.readers.world import check_options, to_world
from dynresp.motion.rotations import FloatArray, identity, multiply, normalize, slerp

MAX_JSON_BYTES = 16 * 2**20
"""Largest DeepMimic file that is read [bytes], 10 minutes at 30 fps: parsed JSON takes up to
thirty times the space of its text."""
# The times to the next frame may differ, as in a clip with a few frames left out: the longest by at
# most
# this factor from the usual one, which bounds how long the motion gets when it is evened out.
_MAX_STRETCH = 10.0
# Quaternions are normalised. In clips of the release whose gaps were filled by straight lines
# between quaternions they are as short as 0.6; beyond these lengths they say nothing.
_QUATERNION_LENGTHS = (0.1, 1.5)

# The humanoid of the DeepMimic release: name, parent, offset from the parent [m] with X forward,
# Y up and Z to the right, and how many numbers of the row are the joint's.
_HUMANOID = (
    ("root", -1, (0.0, 0.0, 0.0), 4),
    ("chest", 0, (0.0, 0.236151, 0.0), 4),
    ("neck", 1, (0.0, 0.223894, 0.0), 4),
    ("right_hip", 0, (0.0, 0.0, 0.084887), 4),
    ("right_knee", 3, (0.0, -0.421546, 0.0), 1),
    ("right_ankle", 4, (0.0, -0.40987, 0.0), 4),
    ("right_shoulder", 1, (-0.02405, 0.2435, 0.18311), 4),
    ("right_elbow", 6, (0.0, -0.274788, 0.0), 1),
    ("left_hip", 0, (0.0, 0.0, -0.084887), 4),
    ("left_knee", 8, (0.0, -0.421546, 0.0), 1),
    ("left_ankle", 9, (0.0, -0.40987, 0.0), 4),
    ("left_shoulder", 1, (-0.02405, 0.2435, -0.18311), 4),
    ("left_elbow", 11, (0.0, -0.274788, 0.0), 1),
)
# The free ends: wrists as in the release; the crown and the toes from the middle and the half size
# of its head's sphere and its feet's boxes.
_ENDS = (
    ("neck_end", 2, (0.0, 0.2775, 0.0)),
    ("right_ankle_end", 5, (0.1335, -0.0225, 0.0)),
    ("right_elbow_end", 7, (0.0, -0.258947, 0.0)),
    ("left_ankle_end", 10, (0.1335, -0.0225, 0.0)),
    ("left_elbow_end", 12, (0.0, -0.258947, 0.0)),
)
_ROW = 44


def read_deepmimic(path: str | Path, *, fps: float | None = None) -> SkeletonMotion:
    """Read a DeepMimic motion file.

    Only the frame rate can be given, since the format fixes the rest: metres, Y up, X forward. The
    rest pose stands with the arms hanging. Frames whose times differ (a clip with frames left out)
    are evened out to the usual time by interpolation, unless `fps` is given.

    Args:
        path: The file.
        fps: Frames per second of the rows; None takes the times they hold.

    Raises:
        MotionFileError: If the file is damaged, too large or no DeepMimic motion.
    """
    path = Path(path)
    check_options(None, None, fps)
    rows = _rows(path, decode(read_bounded(path, MAX_JSON_BYTES)))
    names = [name for name, *_ in (*_HUMANOID, *_ENDS)]
    check_size(path, len(rows), len(names))
    root_positions = rows[:, 1:4]
    local = _local_rotations(path, rows[:, 4:])
    if fps is None:
        steps, step = _steps(path, rows[:, 0])
        fps = rate_of_frame_time(repr(step))
        if steps is not None:
            check_size(path, len(steps), len(names))
            at = np.minimum(steps.astype(int), len(rows) - 2)
            part = steps - at
            root_positions = root_positions[at] + part[:, None] * (
                root_positions[at + 1] - root_positions[at]
            )
            local = slerp(local[at], local[at + 1], part[:, None])
    parents = [parent for _, parent, *_ in (*_HUMANOID, *_ENDS)]
    rotations = np.empty((len(local), len(names), 4))
    for joint, parent in enumerate(parents):
        if joint >= len(_HUMANOID):
            rotations[:, joint] = rotations[:, parent]
        elif parent < 0:
            rotations[:, joint] = local[:, joint]
        else:
            rotations[:, joint] = multiply(rotations[:, parent], local[:, joint])
    offsets = np.array([offset for _, _, offset, *_ in (*_HUMANOID, *_ENDS)])
    # A quarter turn about X: Y becomes Z, Z (the right) becomes -Y, and X stays forward.
    motion = to_world(
        path,
        names=names,
        parents=parents,
        offsets=_quarter_turn(offsets),
        root_positions=_quarter_turn(root_positions),
        rotations=np.concatenate([rotations[..., :1], _quarter_turn(rotations[..., 1:])], axis=-1),
        fps=fps,
        unit=1.0,
        up="z",
    )
    # As the file has it; it was turned here.
    return replace(motion, up="y")


def _quarter_turn(vectors: FloatArray) -> FloatArray:
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def _rows(path: Path, text: str) -> FloatArray:
    """The rows under "Frames", (frames, 44)."""
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise file_error(path, f"expected DeepMimic JSON: {error.msg}", error.lineno) from error
    except RecursionError as error:
        raise file_error(path, "expected DeepMimic JSON, and it is nested too deeply") from error
    except ValueError as error:  # a number of thousands of digits
        raise file_error(path, f"expected DeepMimic JSON: {error}") from error
    rows = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not rows:
        raise file_error(path, 'expected DeepMimic JSON with rows of numbers under "Frames"')
    for index, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != _ROW:
            given = f"{len(row)} numbers" if isinstance(row, list) else type(row).__name__
            raise file_error(path, f"frame {index}: expected {_ROW} numbers, found {given}")
        for value in row:
            # bool counts as int in Python, but not in a motion.
            if type(value) not in (int, float) or not abs(value) <= MAX_NUMBER:
                raise file_error(path, f"frame {index}: {bad_number(_shown(value))}")
    return np.array(rows, dtype=np.float64)


def _shown(value: object) -> str:
    # An int of thousands of digits cannot be printed; its size is all there is to say.
    if type(value) is int and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    return repr(value) if isinstance(value, int | float | str) else type(value).__name__


def _local_rotations(path: Path, numbers: FloatArray) -> FloatArray:
    """Rotations of the joints relative to their parents, (frames, joints, 4)."""
    local = identity(len(numbers), len(_HUMANOID))
    column = 0
    for joint, (name, _, _, width) in enumerate(_HUMANOID):
        part = numbers[:, column : column + width]
        column += width
        if width == 1:
            local[:, joint] = rotations_about_axes([2], part)
            continue
        length = np.linalg.norm(part, axis=1)
        wrong = (length < _QUATERNION_LENGTHS[0]) | (length > _QUATERNION_LENGTHS[1])
        if np.any(wrong):
            worst = int(np.argmax(wrong))
            raise file_error(
                path, f"frame {worst}: {name} needs a unit quaternion, found {part[worst]}"
            )
        local[:, joint] = normalize(part)
    return local


def _steps(path: Path, times: FloatArray) -> tuple[FloatArray | None, float]:
    """Where evenly spaced frames lie among the rows, and their spacing [s].

    Args:
        path: The file, for errors.
        times: Times to the next row [s]; the last, mostly 0, only matters in a loop.

    Returns:
        Positions among the rows, such as 3.5 for half-way between rows 3 and 4, None if the rows
        are evenly spaced as they are; and the spacing.
    """
    between = times[:-1] if len(times) > 1 else times
    if np.min(between) <= 0:
        raise file_error(
            path,
            f"frame {int(np.argmin(between))}: expected a positive time to the next frame; or give "
            "fps",
        )
    # Of an even number of times the lower middle one, so that it is a time of the file.
    step = float(np.sort(between)[(len(between) - 1) // 2])
    if np.max(np.abs(between - step)) <= 0.01 * step:
        return None, step
    if np.max(between) > _MAX_STRETCH * step:
        raise file_error(
            path,
            f"frame {int(np.argmax(between))} lasts {np.max(between):g} s, and the usual is "
            f"{step:g} s; give fps",
        )
    clock = np.concatenate([[0.0], np.cumsum(between)])
    # A last step that is nearly full counts, and ends at the last row.
    even = np.arange(int(clock[-1] / step + 0.1) + 1) * step
    return np.interp(even, clock, np.arange(len(clock))), step
