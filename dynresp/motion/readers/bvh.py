"""Biovision BVH: a hierarchy of joints with offsets and channels, then one row of numbers a frame.

The format has no standard; this follows what exporters write and Blender reads. Angles are in
degrees, a joint's rotation is the product of its rotation channels in the order listed, and
position channels are where the joint is relative to its parent: they replace its OFFSET, and are
not added to it. Unit and up axis are not in the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dynresp.motion.readers.angles import rotations_about_axes
from dynresp.motion.readers.skeleton import MAX_JOINTS, SkeletonMotion
from dynresp.motion.readers.text import (
    check_size,
    decode,
    file_error,
    number,
    number_table,
    numbers,
    rate_of_frame_time,
    read_bounded,
)
from dynresp.motion.readers.world import check_options, to_world
from dynresp.motion.rotations import FloatArray, multiply, normalize, rotate

_MOTION = re.compile(rb"(?:\A|[\r\n])[ \t]*MOTION\b", re.IGNORECASE)
_CLOCK = re.compile(rb"\s*Frames\s*:?\s*(\S+)\s+Frame\s*Time\s*:?\s*(\S+)", re.IGNORECASE)
_NEW_LINE = re.compile(r"\r\n|\r|\n")
_BRACES = re.compile(r"([{}])")
_MAX_HEADER_BYTES = 2**20
_CHANNELS = {
    f"{axis}{kind}": (kind, index)
    for index, axis in enumerate("xyz")
    for kind in ("position", "rotation")
}
# How far a joint's position channels may stray from their median, relative to the largest bone,
# for the bone to count as rigid: soft tissue and solver noise, not a second moving body.
_RIGID = 0.05


@dataclass
class _Joint:
    """One joint or end site of the hierarchy, as read."""

    name: str
    parent: int
    line: int
    offset: list[float] | None = None
    channels: tuple[tuple[str, int], ...] | None = None
    is_end: bool = False


def read_bvh(
    path: str | Path,
    *,
    unit: float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> SkeletonMotion:
    """Read a BVH file.

    Any channel order, line ending and indentation is read. A joint other than the root may have
    position channels, if they hold still (the bone's length is then theirs) or if the joint is one
    of a line of joints that only carry the hips, as in a "reference" joint above them: then it
    becomes the root. A bone that otherwise changes its length is refused, since no skeleton of
    rigid bones moves so.

    Args:
        path: The file.
        unit: Metres per unit of the file; None finds it by the skeleton's size.
        up: "x", "y" or "z", the axis that points up; None finds it by how the person stands.
        fps: Frames per second; None takes the file's frame time (0.0333333 s is read as 30 fps).

    Raises:
        MotionFileError: If the file is damaged, too large or no BVH, or the unit is not clear.
    """
    path = Path(path)
    check_options(unit, up, fps)
    data = read_bounded(path)
    motion = _MOTION.search(data)
    if motion is None or motion.start() > _MAX_HEADER_BYTES:
        raise file_error(path, "has no line MOTION after its hierarchy; expected a BVH file")
    joints = _hierarchy(path, decode(data[: motion.start()]))
    columns = sum(len(joint.channels or ()) for joint in joints)
    if columns == 0:
        raise file_error(path, "no joint has channels, so nothing moves")
    frames, found_fps, start = _clock(path, data, motion.end(), fps)
    check_size(path, frames, len(joints))
    line = 1 + data.count(b"\n", 0, start)
    values = number_table(path, data, start, (frames, columns), line)
    return _motion(path, joints, values, unit=unit, up=up, fps=found_fps)


def _hierarchy(path: Path, text: str) -> list[_Joint]:
    """The joints of the part before MOTION, parents before children."""
    joints: list[_Joint] = []
    open_joints: list[int] = []
    pending: int | None = None  # a joint whose brace has not been read yet
    line = 0
    for line, row in enumerate(_NEW_LINE.split(text), start=1):
        for piece in filter(None, map(str.strip, _BRACES.split(row))):
            keyword, rest = (*piece.split(None, 1), "")[:2]
            keyword = keyword.upper()
            if piece == "{":
                if pending is None:
                    raise file_error(path, "a brace opens without a joint before it", line)
                open_joints.append(pending)
                pending = None
            elif pending is not None:
                raise file_error(path, f"expected '{{' after {joints[pending].name!r}", line)
            elif piece == "}":
                if not open_joints:
                    raise file_error(path, "a brace closes that was not opened", line)
                open_joints.pop()
            elif keyword in ("ROOT", "JOINT", "END"):
                joints.append(_new_joint(path, line, keyword, rest, joints, open_joints))
                pending = len(joints) - 1
            elif keyword in ("OFFSET", "CHANNELS") and open_joints:
                _describe(path, line, keyword, rest, joints[open_joints[-1]])
            elif keyword != "HIERARCHY" or joints:
                raise file_error(
                    path,
                    f"expected ROOT, JOINT, End Site, OFFSET, CHANNELS or a brace, found "
                    f"{piece[:40]!r}",
                    line,
                )
    if pending is not None or open_joints or not joints:
        what = "has braces left open" if joints else "has no ROOT; expected a BVH file"
        raise file_error(path, what, line)
    return joints


def _new_joint(
    path: Path, line: int, keyword: str, name: str, joints: list[_Joint], open_joints: list[int]
) -> _Joint:
    if len(joints) >= MAX_JOINTS:
        raise file_error(path, f"has more than {MAX_JOINTS} joints", line)
    if keyword == "ROOT":
        if joints:
            raise file_error(path, "has a second ROOT; one skeleton a file is read", line)
    elif not open_joints:
        raise file_error(path, f"{keyword} stands outside of the ROOT's braces", line)
    parent = open_joints[-1] if open_joints else -1
    if parent >= 0 and joints[parent].is_end:
        raise file_error(path, "an End Site cannot have a joint below it", line)
    taken = {joint.name for joint in joints}
    if keyword == "END":
        name = base = f"{joints[parent].name}_end"
        count = 2
        while name in taken:
            name, count = f"{base}{count}", count + 1
    elif not name or name in taken:
        what = "a second joint is called" if name else "a joint needs a name, not"
        raise file_error(path, f"{what} {name!r}", line)
    return _Joint(name, parent, line, is_end=keyword == "END")


def _describe(path: Path, line: int, keyword: str, rest: str, joint: _Joint) -> None:
    """Take an OFFSET or CHANNELS line into the joint it belongs to."""
    words = rest.split()
    if keyword == "OFFSET":
        if len(words) != 3 or joint.offset is not None:
            raise file_error(path, f"{joint.name!r} needs one OFFSET of 3 numbers", line)
        joint.offset = numbers(path, words, line, "OFFSET")
        return
    names = [word.lower() for word in words[1:]]
    unknown = [word for word in names if word not in _CHANNELS]
    if unknown:
        known = ", ".join(name.capitalize() for name in _CHANNELS)
        raise file_error(path, f"unknown channel {unknown[0][:40]!r}; known are {known}", line)
    if joint.is_end or joint.channels is not None or not words or words[0] != str(len(names)):
        raise file_error(
            path,
            f"{joint.name!r} needs one CHANNELS line, with as many channels as it says, and an End "
            "Site none",
            line,
        )
    channels = tuple(_CHANNELS[name] for name in names)
    if len(set(channels)) != len(channels):
        raise file_error(path, f"{joint.name!r} has a channel twice", line)
    joint.channels = channels


def _clock(path: Path, data: bytes, start: int, fps: float | None) -> tuple[int, float, int]:
    """Number of frames, frames per second, and where the numbers begin."""
    clock = _CLOCK.match(data, start)
    if clock is None:
        line = 1 + data.count(b"\n", 0, start)
        raise file_error(path, "expected 'Frames: N' and 'Frame Time: seconds' after MOTION", line)
    count, seconds = clock[1], clock[2]
    if not (count.isdigit() and len(count) <= 9 and int(count) > 0):
        line = 1 + data.count(b"\n", 0, clock.start(1))
        raise file_error(
            path, f"expected a positive number of frames, found {decode(count[:40])!r}", line
        )
    if fps is None:
        time = number(seconds)
        if time is None or time <= 0:
            line = 1 + data.count(b"\n", 0, clock.start(2))
            word = decode(seconds[:40])
            raise file_error(
                path, f"expected a positive frame time, found {word!r}; or give fps", line
            )
        fps = rate_of_frame_time(seconds.decode("latin-1"))
    return int(count), fps, clock.end()


def _motion(
    path: Path,
    joints: list[_Joint],
    values: FloatArray,
    *,
    unit: float | None,
    up: str | None,
    fps: float,
) -> SkeletonMotion:
    """Global rotations and root positions from the channels."""
    offsets = np.array([joint.offset or (0.0, 0.0, 0.0) for joint in joints])
    rotations = np.empty((len(values), len(joints), 4))
    places: dict[int, FloatArray] = {}
    column = 0
    for index, joint in enumerate(joints):
        channels = joint.channels or ()
        table = values[:, column : column + len(channels)]
        column += len(channels)
        rotation = _rotation(channels, table)
        if joint.parent >= 0:
            rotation = multiply(rotations[:, joint.parent], rotation)
        rotations[:, index] = normalize(rotation)
        if index == 0 or any(kind == "position" for kind, _ in channels):
            places[index] = _place(channels, table, offsets[index])
    root, root_positions = _carry(path, joints, offsets, places, rotations)
    return to_world(
        path,
        names=[joint.name for joint in joints[root:]],
        parents=[max(joint.parent - root, -1) for joint in joints[root:]],
        offsets=offsets[root:],
        root_positions=root_positions,
        rotations=rotations[:, root:],
        fps=fps,
        unit=unit,
        up=up,
    )


def _rotation(channels: tuple[tuple[str, int], ...], table: FloatArray) -> FloatArray:
    """A joint's own rotation, (frames, 4)."""
    columns = [column for column, (kind, _) in enumerate(channels) if kind == "rotation"]
    return rotations_about_axes(
        [channels[column][1] for column in columns], np.radians(table[:, columns])
    )


def _place(
    channels: tuple[tuple[str, int], ...], table: FloatArray, offset: FloatArray
) -> FloatArray:
    """Where a joint is relative to its parent, (frames, 3): its OFFSET where no channel says."""
    place = np.repeat(offset[None], len(table), axis=0)
    for column, (kind, axis) in enumerate(channels):
        if kind == "position":
            place[:, axis] = table[:, column]
    return place


def _carry(
    path: Path,
    joints: list[_Joint],
    offsets: FloatArray,
    places: dict[int, FloatArray],
    rotations: FloatArray,
) -> tuple[int, FloatArray]:
    """Settle the position channels: which joint is the root, and where it goes.

    The offsets of joints whose position channels hold still become those positions; where they
    hold still at zero the OFFSET stays, since some exporters mean "no move" by it.

    Returns:
        Index of the root, and its positions (frames, 3). Joints before it drop out.
    """
    bones = np.linalg.norm(offsets[1:], axis=1)
    slack = _RIGID * max(float(np.max(bones, initial=0.0)), 1e-9)
    moving = []
    for index, place in places.items():
        middle = np.median(place, axis=0)
        if index and np.max(np.abs(place - middle)) > slack:
            moving.append(index)
        elif np.any(np.abs(middle) > 0):
            offsets[index] = middle
    parents = [joint.parent for joint in joints]
    at = root_positions = places[0]
    root, index = 0, 1
    while moving and index < len(joints) and parents.count(index - 1) == 1:
        at = at + rotate(rotations[:, index - 1], places.get(index, offsets[index]))
        if index in moving:
            root, root_positions = index, at
        index += 1
    stretched = [joints[index] for index in moving if index > root]
    if stretched:
        raise file_error(
            path,
            f"the position channels of {stretched[0].name!r} change its bone's length; only the "
            "root may travel (and joints that do nothing but carry the hips)",
            stretched[0].line,
        )
    return root, root_positions
