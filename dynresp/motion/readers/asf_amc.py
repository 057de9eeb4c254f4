"""Acclaim AMC: what a skeleton (ASF) does, bone by bone and frame by frame."""

from __future__ import annotations

import io
import re
from array import array
from pathlib import Path

import numpy as np

from dynresp.motion.readers.angles import rotations_about_axes
from dynresp.motion.readers.asf import AsfSkeleton, Bone, read_asf
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.readers.text import (
    MAX_NUMBER,
    bad_number,
    check_size,
    decode,
    file_error,
    number,
    read_bounded,
)
from dynresp.motion.readers.world import check_options, to_world
from dynresp.motion.rotations import FloatArray, conjugate, multiply, normalize

CMU_FPS = 120.0
"""Frame rate [1/s] of an AMC file that states none: that of the CMU database, which documents it
on its pages and not in its files."""
_MAX_LINE_BYTES = 2**14
# How far a bone's translations may be from zero, relative to the longest bone.
_RIGID = 0.05


def read_asf_amc(
    amc_path: str | Path,
    asf_path: str | Path | None = None,
    *,
    unit: float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> SkeletonMotion:
    """Read an AMC motion with its ASF skeleton.

    The skeleton, if it is not given, is searched beside the AMC, then one folder up: the only ASF
    there; or the one whose name the AMC's name begins with or has after an underscore, as in
    ann_walk or take3_ann with ann.asf (the longest); or, if all that are there describe one
    skeleton, any.

    Args:
        amc_path: The motion.
        asf_path: The skeleton; None looks for it.
        unit: Metres per unit of the file; None takes `:units length` of the ASF (CMU's 0.45 means
            1/0.45 inch), unless that is not a person's size: then the skeleton's size shows it.
        up: "x", "y" or "z", the axis that points up; None finds it by how the person stands.
        fps: Frames per second; None takes `:SAMPLES-PER-SECOND` of the AMC, else 120, the rate of
            the CMU database, whose files do not state it.

    Raises:
        MotionFileError: If a file is damaged or too large, the two do not belong together, the
            skeleton is not clear, or bones change their length.
    """
    path = Path(amc_path)
    check_options(unit, up, fps)
    data = read_bounded(path)
    skeleton = read_asf(Path(asf_path)) if asf_path is not None else _find_asf(path)
    reader = _AmcReader(path, skeleton)
    tables = reader.read(data)
    names, parents, offsets = skeleton.joints()
    rotations = np.empty((reader.frames, len(names), 4))
    for joint, parent in enumerate(parents):
        if joint < len(skeleton.bones):
            rotation = _rotation(skeleton, joint, tables[joint], reader.radians)
            if parent >= 0:
                rotation = multiply(rotations[:, parent], rotation)
            rotations[:, joint] = normalize(rotation)
        else:
            rotations[:, joint] = rotations[:, parent]
    _check_rigid(path, skeleton, tables)
    root_positions = np.repeat(skeleton.root_position[None], reader.frames, axis=0)
    for column, channel in enumerate(skeleton.bones[0].channels):
        if channel[0] == "t":
            root_positions[:, "xyz".index(channel[1])] = tables[0][:, column]
    return to_world(
        path,
        names=names,
        parents=parents,
        offsets=offsets,
        root_positions=root_positions,
        rotations=rotations,
        fps=fps or reader.fps or CMU_FPS,
        unit=unit,
        up=up,
        hint=skeleton.unit,
    )


class _AmcReader:
    """Reads the lines of an AMC file; its first frame fixes the order of the bones."""

    def __init__(self, path: Path, skeleton: AsfSkeleton) -> None:
        self.path = path
        self.skeleton = skeleton
        self.fps: float | None = None
        self.radians = skeleton.radians
        self.frames = 0
        self._moving = {bone.name: bone for bone in skeleton.bones if bone.channels}
        self._order: list[tuple[bytes, Bone]] = []
        self._values = array("d")
        self._last = 0

    def read(self, data: bytes) -> list[FloatArray]:
        """The numbers of each bone of the skeleton, (frames, channels)."""
        data = data.removeprefix(b"\xef\xbb\xbf")
        if b"\n" not in data:
            data = data.replace(b"\r", b"\n")
        at = 0  # how many bones of the present frame have been read
        line = 0
        for line, row in enumerate(io.BytesIO(data), start=1):
            if len(row) > _MAX_LINE_BYTES:
                raise file_error(self.path, "the line is too long for an AMC file", line)
            words = row.split()
            if not words or words[0].startswith(b"#"):
                continue
            if self.frames == 0 and words[0].startswith(b":"):
                self._header(words, line)
            elif len(words) == 1 and words[0].isdigit():
                self._check_frame_full(at, line)
                self._begin_frame(words[0], line)
                at = 0
            elif self.frames == 0:
                raise file_error(
                    self.path, f"expected a frame number, found {_word(words[0])}", line
                )
            else:
                self._bone(words, at, line)
                at += 1
        if self.frames == 0:
            raise file_error(self.path, "has no frames; expected an AMC file")
        self._check_frame_full(at, line)
        return self._tables()

    def _header(self, words: list[bytes], line: int) -> None:
        key = words[0].lower()
        if key == b":degrees":
            self.radians = float(np.radians(1.0))
        elif key == b":radians":
            self.radians = 1.0
        elif key == b":samples-per-second":
            self.fps = number(words[1]) if len(words) > 1 else None
            if self.fps is None or self.fps <= 0:
                raise file_error(
                    self.path, "expected a positive number of samples per second", line
                )

    def _begin_frame(self, word: bytes, line: int) -> None:
        # Long runs of digits are not frame numbers, and slow to convert.
        index = int(word) if len(word) <= 9 else -1
        if self.frames and index != self._last + 1:
            raise file_error(
                self.path, f"expected frame {self._last + 1}, found frame {_word(word)}", line
            )
        self._last = index
        self.frames += 1
        check_size(self.path, self.frames, len(self.skeleton.bones))

    def _check_frame_full(self, bones: int, line: int) -> None:
        if self.frames and bones < len(self._moving):
            seen = {bone.name for _, bone in self._order[:bones]}
            missing = next(name for name in self._moving if name not in seen)
            raise file_error(
                self.path,
                f"frame {self._last} ends without {missing!r}; expected {len(self._moving)} bones, "
                f"all with dof in {self.skeleton.path.name}",
                line,
            )

    def _bone(self, words: list[bytes], at: int, line: int) -> None:
        if self.frames == 1:
            name = decode(words[0])
            if name not in self._moving or name in {bone.name for _, bone in self._order}:
                raise file_error(
                    self.path,
                    f"{name[:40]!r} is not a bone with dof in {self.skeleton.path.name}, or comes "
                    "twice; is this the right skeleton?",
                    line,
                )
            self._order.append((words[0], self._moving[name]))
        elif at >= len(self._order) or words[0] != self._order[at][0]:
            expected = (
                f"bone {self._order[at][1].name!r}" if at < len(self._order) else "a frame number"
            )
            raise file_error(self.path, f"expected {expected}, found {_word(words[0])}", line)
        channels = self._order[at][1].channels
        if len(words) != len(channels) + 1:
            raise file_error(
                self.path,
                f"expected {len(channels)} numbers after {_word(words[0])}, found {len(words) - 1}",
                line,
            )
        try:
            self._values.extend(map(float, words[1:]))
        except ValueError:
            wrong = next(word for word in words[1:] if number(word) is None)
            raise file_error(self.path, bad_number(wrong), line) from None

    def _tables(self) -> list[FloatArray]:
        values = np.frombuffer(self._values).reshape(self.frames, -1)
        tables = {bone.name: np.zeros((self.frames, 0)) for bone in self.skeleton.bones}
        column = 0
        for _, bone in self._order:
            table = values[:, column : column + len(bone.channels)]
            column += len(bone.channels)
            believable = np.all(np.abs(table) <= MAX_NUMBER, axis=1)
            if not np.all(believable):
                row = int(np.argmin(believable))
                wrong = next(x for x in table[row] if not abs(x) <= MAX_NUMBER)
                raise file_error(
                    self.path,
                    f"frame {self._last - self.frames + 1 + row}, bone {bone.name!r}: "
                    f"{bad_number(str(wrong))}",
                )
            tables[bone.name] = table
        return [tables[bone.name] for bone in self.skeleton.bones]


def _word(word: bytes) -> str:
    return repr(decode(word[:40]))


def _rotation(skeleton: AsfSkeleton, index: int, table: FloatArray, radians: float) -> FloatArray:
    """A bone's rotation relative to its parent, in world axes at rest, (frames, 4)."""
    bone = skeleton.bones[index]
    columns = [
        (axis, bone.channels.index(f"r{'xyz'[axis]}"))
        for axis in reversed(bone.order)
        if f"r{'xyz'[axis]}" in bone.channels
    ]
    angles = table[:, [column for _, column in columns]] * radians
    frame = skeleton.frame(bone)
    return multiply(
        multiply(frame, rotations_about_axes([axis for axis, _ in columns], angles)),
        conjugate(frame),
    )


def _check_rigid(path: Path, skeleton: AsfSkeleton, tables: list[FloatArray]) -> None:
    """Refuse bones that move away or stretch: rigid bones do not."""
    slack = _RIGID * max(float(np.linalg.norm(bone.vector)) for bone in skeleton.bones)
    for bone, table in list(zip(skeleton.bones, tables, strict=True))[1:]:
        moving = [column for column, name in enumerate(bone.channels) if name[0] != "r"]
        if np.any(np.abs(table[:, moving]) > slack):
            raise file_error(
                path,
                f"bone {bone.name!r} changes its place or length (tx, ty, tz or l); only the root "
                "may travel",
            )


def _find_asf(path: Path) -> AsfSkeleton:
    """The skeleton of an AMC file for which none is given; see `read_asf_amc`."""
    stem = path.stem.lower()
    for folder in (path.parent, path.parent.resolve().parent):
        try:
            found = sorted(file for file in folder.iterdir() if file.suffix.lower() == ".asf")
        except OSError:
            continue
        if not found:
            continue
        named = [
            file
            for file in found
            if re.search(rf"(\A|_){re.escape(file.stem.lower())}(?![a-z0-9])", stem)
        ]
        if len(found) == 1 or named:
            return read_asf(max(named or found, key=lambda file: len(file.stem)))
        skeletons = [read_asf(file) for file in found]
        if all(skeletons[0].resembles(other) for other in skeletons[1:]):
            return max(skeletons, key=AsfSkeleton.size)
        raise file_error(
            path,
            f"which skeleton it belongs to is not clear: {', '.join(map(str, found))}; give one",
        )
    raise file_error(path, f"no ASF skeleton in {path.parent} nor one folder up; give one")
