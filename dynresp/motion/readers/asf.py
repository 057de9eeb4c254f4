"""Acclaim ASF: the skeleton that an AMC motion moves.

A bone has a direction and a length in the world's axes, as the skeleton stands at rest, and a
frame (`axis`) in which its rotations are given. The format is described in J. Lander, "Working with
Motion Capture File Formats", Game Developer, January 1998: `dof` and `order` say in which order
the numbers stand in the AMC file, the letters after `axis` in which order the rotations are
applied (XYZ: about x first).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dynresp.motion.readers.angles import rotations_about_axes
from dynresp.motion.readers.skeleton import MAX_JOINTS
from dynresp.motion.readers.text import decode, file_error, numbers, read_bounded
from dynresp.motion.rotations import FloatArray, angle_between

ROOT = "root"
MAX_ASF_BYTES = 2**20
"""Largest ASF file that is read [bytes]; CMU's have 8 KiB."""
_INCH = 0.0254
_NEW_LINE = re.compile(r"\r\n|\r|\n")
_CHANNELS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_SAME_PLACE = 0.005
_SAME_ANGLE = np.radians(1.0)


@dataclass
class Bone:
    """One bone, or the root: what moves it and where it points at rest.

    Attributes:
        name: Its name.
        axis: Angles of its frame, in the file's angle unit, about x, y and z.
        order: Axes in the order in which rotations are applied, first to last; 0, 1, 2 are x, y, z.
        channels: Names of its numbers in an AMC line.
        vector: From its start to its end at rest, in the file's unit and axes, (3,).
    """

    name: str
    axis: list[float]
    order: tuple[int, ...]
    channels: tuple[str, ...]
    vector: FloatArray = field(default_factory=lambda: np.zeros(3))


@dataclass
class AsfSkeleton:
    """A skeleton as its ASF file describes it, the root first and parents before children.

    Attributes:
        path: The file.
        bones: Root and bones.
        parents: Index of each bone's parent, -1 for the root.
        radians: What one of its angle units is [rad].
        unit: Metres per file unit as `:units length` states it.
        root_position: The root's own position, for channels that the root does not have.
    """

    path: Path
    bones: list[Bone]
    parents: list[int]
    radians: float
    unit: float
    root_position: FloatArray

    def frame(self, bone: Bone) -> FloatArray:
        """Quaternion (4,) of the frame in which a bone's rotations are given."""
        order = bone.order[::-1]
        angles = np.array([[bone.axis[axis] for axis in order]]) * self.radians
        return rotations_about_axes(order, angles).reshape(4)

    def joints(self) -> tuple[list[str], list[int], FloatArray]:
        """Names, parents and rest offsets (joints, 3) of the joints: bones, then their free ends.

        A bone's joint is where the bone starts, which is its parent's end; all bones of the root
        start at the root.
        """
        names = [bone.name for bone in self.bones]
        parents = list(self.parents)
        offsets = [self.bones[parent].vector if parent >= 0 else np.zeros(3) for parent in parents]
        for index in range(1, len(self.bones)):
            if index not in self.parents:
                names.append(f"{self.bones[index].name}_end")
                parents.append(index)
                offsets.append(self.bones[index].vector)
        return names, parents, np.array(offsets)

    def size(self) -> float:
        """Length of all bones together [m]."""
        return float(sum(np.linalg.norm(bone.vector) for bone in self.bones)) * self.unit

    def resembles(self, other: AsfSkeleton) -> bool:
        """Whether a motion is the same on both: all but the free ends of bones agree."""
        if self.parents != other.parents or any(
            (a.name, a.channels, a.order) != (b.name, b.channels, b.order)
            for a, b in zip(self.bones, other.bones, strict=True)
        ):
            return False
        inner = sorted({parent for parent in self.parents if parent >= 0})
        offsets = [
            np.linalg.norm(self.bones[i].vector * self.unit - other.bones[i].vector * other.unit)
            for i in inner
        ]
        turned = [
            angle_between(self.frame(a), other.frame(b))
            for a, b in zip(self.bones, other.bones, strict=True)
        ]
        return bool(max(offsets, default=0.0) < _SAME_PLACE and max(turned) < _SAME_ANGLE)


def read_asf(path: Path) -> AsfSkeleton:
    """Read an ASF skeleton.

    Args:
        path: The file.

    Raises:
        MotionFileError: If the file is damaged, too large or no ASF.
    """
    root = _Block(1, {})
    units = _Block(1, {})
    blocks: list[_Block] = []
    children: dict[str, tuple[int, list[str]]] = {}
    section = ""
    block: _Block | None = None
    lines = _NEW_LINE.split(decode(read_bounded(path, MAX_ASF_BYTES)))
    for line, row in enumerate(lines, start=1):
        words = row.split()
        if not words or words[0].startswith("#"):
            continue
        key, rest = words[0].lower(), words[1:]
        if key.startswith(":"):
            section, block = key, None
        elif section in (":units", ":root"):
            (units if section == ":units" else root).rows[key] = (line, rest)
        elif section == ":bonedata":
            if key == "begin":
                if len(blocks) >= MAX_JOINTS:
                    raise file_error(path, f"has more than {MAX_JOINTS} bones", line)
                block = _Block(line, {})
                blocks.append(block)
            elif block is None:
                raise file_error(path, f"expected 'begin' before {key[:40]!r}", line)
            elif key == "end":
                block = None
            else:
                block.rows[key] = (line, rest)
        elif section == ":hierarchy" and words not in (["begin"], ["end"]):
            if words[0] in children:
                raise file_error(path, f"the children of {words[0]!r} are listed twice", line)
            children[words[0]] = (line, rest)
    bones = _bones(path, root, blocks)
    order, parents = _tree(path, bones, children)
    length = units.numbers(path, "length", 1, default=[1.0])[0]
    if length <= 0:
        raise file_error(path, f"expected a positive length under :units, found {length:g}")
    angle = units.rows.get("angle", (0, ["deg"]))[1]
    return AsfSkeleton(
        path=path,
        bones=order,
        parents=parents,
        radians=1.0 if angle and angle[0].lower().startswith("rad") else float(np.radians(1.0)),
        unit=_INCH / length,
        root_position=np.array(root.numbers(path, "position", 3, default=[0.0, 0.0, 0.0])),
    )


@dataclass
class _Block:
    """The lines of :units, of :root or of one bone: what each key says, and where."""

    line: int
    rows: dict[str, tuple[int, list[str]]]

    def numbers(
        self, path: Path, key: str, count: int, default: list[float] | None = None
    ) -> list[float]:
        """The first numbers after a key; an error if the key is missing and there is no default."""
        if key not in self.rows:
            if default is None:
                raise file_error(path, f"this bone has no {key!r}", self.line)
            return default
        line, words = self.rows[key]
        if len(words) < count:
            raise file_error(path, f"{key} needs {count} numbers, found {len(words)}", line)
        return numbers(path, words[:count], line, key)

    def order(self, path: Path, word: int) -> tuple[int, ...]:
        """The rotation order that stands after `axis` as its word number `word`; XYZ if none."""
        line, words = self.rows.get("axis", (self.line, []))
        letters = words[word].lower() if len(words) > word else "xyz"
        if sorted(letters) != ["x", "y", "z"]:
            raise file_error(
                path, f"expected x, y and z in some order, found {letters[:40]!r}", line
            )
        return tuple("xyz".index(letter) for letter in letters)

    def channels(self, path: Path, key: str) -> tuple[str, ...]:
        """The channels that a key names, none if it is missing."""
        line, words = self.rows.get(key, (self.line, []))
        channels = tuple(word.lower() for word in words)
        unknown = [channel for channel in channels if channel not in _CHANNELS]
        if unknown or len(set(channels)) != len(channels):
            raise file_error(
                path,
                f"{key} takes {', '.join(_CHANNELS)}, each once at most; found "
                f"{' '.join(words)[:80]!r}",
                line,
            )
        return channels


def _bones(path: Path, root: _Block, blocks: list[_Block]) -> dict[str, Bone]:
    """The root and the bones by name."""
    if not blocks:
        raise file_error(path, "has no bones under :bonedata; expected an ASF skeleton")
    bones = {
        ROOT: Bone(
            name=ROOT,
            axis=root.numbers(path, "orientation", 3, default=[0.0, 0.0, 0.0]),
            order=root.order(path, 0),
            channels=root.channels(path, "order"),
        )
    }
    for block in blocks:
        line, words = block.rows.get("name", (block.line, []))
        name = " ".join(words)
        if not name or name in bones:
            raise file_error(
                path, f"a second bone is called {name!r}" if name else "has no name", line
            )
        direction = np.array(block.numbers(path, "direction", 3))
        scale = float(np.linalg.norm(direction))
        length = block.numbers(path, "length", 1)[0]
        bones[name] = Bone(
            name=name,
            vector=direction * (length / scale) if scale > 0 else np.zeros(3),
            axis=block.numbers(path, "axis", 3, default=[0.0, 0.0, 0.0]),
            order=block.order(path, 3),
            channels=block.channels(path, "dof"),
        )
    return bones


def _tree(
    path: Path, bones: dict[str, Bone], children: dict[str, tuple[int, list[str]]]
) -> tuple[list[Bone], list[int]]:
    """Bones with parents before children, and the index of each one's parent."""
    placed: dict[str, int] = {}
    parents: list[int] = []
    waiting = [(ROOT, -1, 0)]
    while waiting:
        name, parent, line = waiting.pop()
        if name not in bones:
            raise file_error(path, f":hierarchy names {name[:40]!r}, which is not a bone", line)
        if name in placed:
            raise file_error(path, f"bone {name!r} has two parents", line)
        placed[name] = len(parents)
        parents.append(parent)
        line, below = children.get(name, (line, []))
        waiting += [(child, placed[name], line) for child in reversed(below)]
    lost = [name for name in bones if name not in placed]
    if lost:
        raise file_error(path, f"bone {lost[0]!r} is not connected to the root in :hierarchy")
    return [bones[name] for name in placed], parents
