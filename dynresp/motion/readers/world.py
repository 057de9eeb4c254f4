"""From a file's own unit and axes to the world: metres, Z up."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.motion.readers.skeleton import SkeletonMotion, forward_kinematics
from dynresp.motion.readers.text import file_error
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError, MotionFileError

UNITS = (1.0, 0.01, 0.0254, 0.001, 0.0254 / 0.45)
"""Units found by size [m]: metre, centimetre, inch, millimetre, and CMU's 1/0.45 inch."""
_TYPICAL_REACH = 1.25
"""Longest path along bones from the hips to an end [m]; 1.0 to 1.5 in the adults looked at."""
_REACH_RANGE = (0.5, 2.5)
# Half-way, as a ratio, between the two units that lie closest together.
_SURE_FACTOR = 1.5

UPS = ("x", "y", "z")
"""Axes that may point up. Even permutations bring them to Z, so left stays left."""
_TO_Z_UP = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}

_FEET = re.compile(r"foot|feet|ankle|toe", re.IGNORECASE)
_HEAD = re.compile(r"head|neck", re.IGNORECASE)
_TRUNK = re.compile(r"spine|chest|torso|thorax", re.IGNORECASE)
_SAMPLES = 64
# In at least this part of the frames a person stands along the axis that is up.
_SOMETIMES = 0.05


def check_options(unit: float | None, up: str | None, fps: float | None) -> None:
    """Refuse a unit, up axis or frame rate that makes no sense, before the file is read.

    Raises:
        MotionFileError: If one is given and is not a positive number or a known axis.
    """
    for what, value in (("unit", unit), ("fps", fps)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise MotionFileError(f"{what} must be a positive number, not {value!r}")
    if up is not None and up.lower() not in UPS:
        raise MotionFileError(f"up must be one of {', '.join(UPS)}, not {up!r}")


def to_world(
    path: Path,
    *,
    names: Sequence[str],
    parents: npt.ArrayLike,
    offsets: npt.ArrayLike,
    root_positions: FloatArray,
    rotations: FloatArray,
    fps: float,
    unit: float | None,
    up: str | None,
    hint: float | None = None,
) -> SkeletonMotion:
    """The motion in metres with Z up.

    With Y up the axes become (z, x, y), which turns a person who faces +Z (the custom of BVH) to
    face +X.

    Args:
        path: The file; its name without suffix becomes the motion's.
        names: Names of the joints, parents before children.
        parents: Index of each joint's parent, -1 for the root.
        offsets: Rest offsets in the file's unit and axes, (joints, 3); the root's is ignored.
        root_positions: In the file's unit and axes, (frames, 3).
        rotations: Global rotations in the file's axes, w x y z, (frames, joints, 4).
        fps: Frames per second.
        unit: Metres per file unit, or None to find it by the skeleton's size.
        up: Which axis of the file points up, or None to find it by how the person stands.
        hint: Unit that the file states; believed if a person comes out.

    Raises:
        MotionFileError: If the unit cannot be found, or the motion is out of bounds.
    """
    tree = np.asarray(parents, dtype=np.int64)
    offsets = np.array(offsets, dtype=np.float64)
    offsets[0] = 0.0
    if unit is None:
        unit = find_unit(path, tree, offsets, hint)
    if up is None:
        up = find_up(names, tree, offsets, root_positions, rotations)
    axes = list(_TO_Z_UP[up.lower()])
    try:
        return SkeletonMotion(
            names=tuple(names),
            parents=tree,
            offsets=offsets[:, axes] * unit,
            root_positions=root_positions[:, axes] * unit,
            # An even permutation of the axes permutes the vector parts alike.
            rotations=rotations[:, :, [0, *(1 + axis for axis in axes)]],
            fps=fps,
            name=path.stem,
            unit_m=unit,
            up=up.lower(),
        )
    except MotionError as error:
        raise file_error(path, f"{error} (unit {unit:g} m, {up} up)") from error


def find_unit(
    path: Path, parents: npt.NDArray[np.int64], offsets: FloatArray, hint: float | None = None
) -> float:
    """Metres per file unit, by the size of the skeleton: that of an adult.

    The size is the longest path along the bones from the hips (the first joint with two children)
    to an end, since that does not depend on the rest pose.

    Args:
        path: The file, for errors.
        parents: Index of each joint's parent, -1 for the root.
        offsets: Rest offsets in the file's unit, (joints, 3).
        hint: Unit that the file states; taken if it makes a person.

    Raises:
        MotionFileError: If no unit of `UNITS` makes the skeleton a person's size.
    """
    reach = _reach(parents, offsets)
    if hint is not None and _TYPICAL_REACH / _SURE_FACTOR < reach * hint < (
        _TYPICAL_REACH * _SURE_FACTOR
    ):
        return hint
    sizes = reach * np.array(UNITS)
    with np.errstate(divide="ignore"):
        nearest = int(np.argmin(np.abs(np.log(sizes / _TYPICAL_REACH))))
    if not _REACH_RANGE[0] <= sizes[nearest] <= _REACH_RANGE[1]:
        raise file_error(
            path,
            f"the unit is not clear: from hips to hands or feet the skeleton measures {reach:g}, "
            "which is not a person's size in metres, centimetres, inches or millimetres; give the "
            "unit (metres per file unit)",
        )
    return UNITS[nearest]


def _fork(parents: npt.NDArray[np.int64]) -> int:
    """The first joint with more than one child: the hips, below joints that only move them."""
    children = np.bincount(parents[parents >= 0], minlength=len(parents))
    return int(np.argmax(children > 1))


def _reach(parents: npt.NDArray[np.int64], offsets: FloatArray) -> float:
    lengths = np.linalg.norm(offsets, axis=1)
    fork = _fork(parents)
    reach = np.zeros(len(parents))
    for joint in range(fork + 1, len(parents)):
        reach[joint] = reach[parents[joint]] + lengths[joint]
    return float(reach.max())


def find_up(
    names: Sequence[str],
    parents: npt.NDArray[np.int64],
    offsets: FloatArray,
    root_positions: FloatArray,
    rotations: FloatArray,
) -> str:
    """Which axis of the file points up: the one along which the head is above the feet.

    Found from frames spread over the motion or, if the person lies or crawls, from the rest pose.
    If neither shows it: Y, the custom of all formats read here. A person who lies most of the time,
    always with the same side up, seems to stand on a wall; so an axis along which the rest pose
    stands, and the person for some of the time, too, comes first.

    Args:
        names: Names of the joints.
        parents: Index of each joint's parent, -1 for the root.
        offsets: Rest offsets in the file's unit and axes, (joints, 3).
        root_positions: In the file's unit and axes, (frames, 3).
        rotations: Global rotations in the file's axes, w x y z, (frames, joints, 4).

    Returns:
        "y" or "z".
    """
    head, feet = _head_and_feet(names, parents)
    if not head or not feet:
        return "y"
    sample = np.linspace(0, len(rotations) - 1, min(_SAMPLES, len(rotations))).astype(int)
    still = np.zeros((1, len(parents), 4))
    still[..., 0] = 1.0
    bodies = []
    for at, turns in ((root_positions[sample], rotations[sample]), (np.zeros((1, 3)), still)):
        positions = forward_kinematics(parents, offsets, at, turns)
        bodies.append(positions[:, head].mean(axis=1) - positions[:, feet].mean(axis=1))
    moving, rest = (_upright_along(body) for body in bodies)
    if rest is not None and rest != moving:
        often = np.mean([_upright_along(frame[None]) == rest for frame in bodies[0]])
        if moving is None or often > _SOMETIMES:
            return rest
    return moving or "y"


def _upright_along(bodies: FloatArray) -> str | None:
    """The axis, y or z, to which vectors from feet to head (frames, 3) clearly point on average."""
    length = np.linalg.norm(bodies, axis=1).mean()
    mean = bodies.mean(axis=0)
    for axis, other in ((1, 2), (2, 1)):
        # Clearly: within about 45 degrees.
        if mean[axis] > max(0.7 * length, 1.5 * abs(mean[other])):
            return UPS[axis]
    return None


def _head_and_feet(
    names: Sequence[str], parents: npt.NDArray[np.int64]
) -> tuple[list[int], list[int]]:
    """Joints of the head (or the trunk) and of the feet: by name, else by how it branches.

    By branching: legs are the chains without branches that start at the hips, and the joint where
    the rest branches next, the chest, stands in for the head.
    """
    head = [i for i, name in enumerate(names) if _HEAD.search(name)]
    head = head or [i for i, name in enumerate(names) if _TRUNK.search(name)]
    feet = [i for i, name in enumerate(names) if _FEET.search(name)]
    if head and feet:
        return head, feet
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    chests: list[int] = []
    ends: list[int] = []
    for joint in children[_fork(parents)]:
        at = joint
        while len(children[at]) == 1:
            at = children[at][0]
        (chests if children[at] else ends).append(at)
    return chests, ends
