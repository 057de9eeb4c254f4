"""The motion of a skeleton, which every reader of motion files returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray, conjugate, multiply, normalize, rotate
from dynresp.support.errors import MotionError

MAX_JOINTS = 1024
"""Most joints of a skeleton, end sites included."""
MAX_FPS = 10_000.0
"""Highest frame rate [1/s]."""
MAX_OFFSET = 100.0
"""Longest bone [m]."""
MAX_DISTANCE = 100_000.0
"""Farthest root position from the origin [m]."""
_UNIT_LENGTH_TOLERANCE = 1e-6


def forward_kinematics(
    parents: npt.ArrayLike,
    offsets: npt.ArrayLike,
    root_positions: npt.ArrayLike,
    rotations: npt.ArrayLike,
) -> FloatArray:
    """Where the joints are, from global rotations.

    Args:
        parents: Parent of each joint, -1 for the root, parents before children, (joints,).
        offsets: Offsets from the parent in the rest pose, (joints, 3).
        root_positions: (frames, 3), in the unit and the axes of the offsets.
        rotations: Global rotations away from the rest pose, (frames, joints, 4), w x y z.

    Returns:
        Positions (frames, joints, 3), in the unit and the axes of the offsets.
    """
    parents = np.asarray(parents)
    offsets = np.asarray(offsets, dtype=np.float64)
    rotations = np.asarray(rotations, dtype=np.float64)
    positions = np.empty((*rotations.shape[:2], 3))
    for joint, parent in enumerate(parents):
        if parent < 0:
            positions[:, joint] = root_positions
        else:
            positions[:, joint] = positions[:, parent] + rotate(
                rotations[:, parent], offsets[joint]
            )
    return positions


@dataclass(frozen=True, eq=False)
class SkeletonMotion:
    """A recorded motion of a skeleton of rigid bones, with Z up and in metres.

    A joint's rotation is that of the bones which start at it. In the rest pose every rotation is
    the identity, so at frame t the bone to joint ``c`` points along
    ``rotate(rotations[t, parents[c]], offsets[c])``. The rest pose is the one the file defines:
    mostly a person standing with the arms out, but in some sources every bone is along one axis
    (see `with_rest`). A point where a bone ends and nothing follows is a joint as well, named
    ``<joint>_end``; it turns with its parent.

    Arrays are copied and made read-only.

    Attributes:
        names: Names of the joints, all different, parents before children.
        parents: Index of each joint's parent, -1 for the root, which is joint 0; int, (joints,).
        offsets: Offset of each joint from its parent in the rest pose [m], in world axes,
            (joints, 3). The root's own offset is zero.
        root_positions: Positions of the root [m], (frames, 3).
        rotations: Global orientation of each joint relative to the rest pose, w x y z,
            (frames, joints, 4).
        fps: Frames per second.
        name: Name of the motion.
        unit_m: Metres per unit of the file it comes from; None where there is none.
        up: "x", "y" or "z", the axis of that file that points up; None likewise.

    Raises:
        MotionError: If shapes disagree, a value is not finite or out of bounds, a parent does not
            come before its child, a name appears twice or a quaternion is not of unit length.
    """

    names: tuple[str, ...]
    parents: npt.NDArray[np.int64]
    offsets: FloatArray
    root_positions: FloatArray
    rotations: FloatArray
    fps: float
    name: str
    unit_m: float | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        """Check everything once, and freeze the arrays."""
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "fps", float(self.fps))
        self._freeze("parents", np.int64)
        for field in ("offsets", "root_positions", "rotations"):
            self._freeze(field, np.float64)
        self._check_tree()
        self._check_values()

    def _freeze(self, field: str, dtype: type[np.int64 | np.float64]) -> None:
        array = np.array(getattr(self, field), dtype=dtype)
        array.setflags(write=False)
        object.__setattr__(self, field, array)

    def _check_tree(self) -> None:
        joints = len(self.names)
        if not 1 <= joints <= MAX_JOINTS:
            raise MotionError(f"a skeleton has 1 to {MAX_JOINTS} joints, not {joints}")
        if len(set(self.names)) != joints:
            twice = sorted({name for name in self.names if self.names.count(name) > 1})
            raise MotionError(f"joint names must differ; these appear twice: {', '.join(twice)}")
        frames = self.root_positions.shape[0] if self.root_positions.ndim else 0
        for field, shape in (
            ("parents", (joints,)),
            ("offsets", (joints, 3)),
            ("root_positions", (frames, 3)),
            ("rotations", (frames, joints, 4)),
        ):
            given = getattr(self, field).shape
            if given != shape:
                raise MotionError(f"{field} must have shape {shape}, not {given}")
        if frames < 1:
            raise MotionError("a motion needs at least one frame, and has none")
        order = np.arange(joints)
        if self.parents[0] != -1 or np.any(self.parents[1:] < 0):
            raise MotionError("joint 0, and no other, must be the root (parent -1)")
        if np.any(self.parents >= order):
            late = self.names[int(np.argmax(self.parents >= order))]
            raise MotionError(f"parents must come before their children; {late!r} comes first")

    def _check_values(self) -> None:
        if not (np.isfinite(self.fps) and 0 < self.fps <= MAX_FPS):
            raise MotionError(f"fps must lie between 0 and {MAX_FPS:g}, not {self.fps:g}")
        for field, bound in (("offsets", MAX_OFFSET), ("root_positions", MAX_DISTANCE)):
            largest = np.max(np.abs(getattr(self, field)))
            # Written so that it is refused if it is not a number, too.
            if not largest <= bound:
                raise MotionError(f"{field} must be within {bound:g} m, and reach {largest:g} m")
        # Joint by joint, so that a long motion needs no second array of its size.
        for joint, name in enumerate(self.names):
            error = np.max(np.abs(np.linalg.norm(self.rotations[:, joint], axis=-1) - 1.0))
            if not error <= _UNIT_LENGTH_TOLERANCE:
                raise MotionError(
                    f"rotations must be unit quaternions; those of {name!r} are off by {error:g}"
                )

    @property
    def frames(self) -> int:
        """How many frames the motion has."""
        return len(self.root_positions)

    def joint_positions(self) -> FloatArray:
        """Positions of all joints in the world [m], (frames, joints, 3)."""
        return forward_kinematics(self.parents, self.offsets, self.root_positions, self.rotations)

    def rest_positions(self) -> FloatArray:
        """Positions of all joints in the rest pose [m], root at the origin, (joints, 3)."""
        positions = np.zeros_like(self.offsets)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                positions[joint] = positions[parent] + self.offsets[joint]
        return positions

    def with_rest(self, rest: npt.ArrayLike) -> SkeletonMotion:
        """The same motion relative to another rest pose.

        Useful if the file's own rest pose is not the pose of a person: pass the rotations of a
        frame in which the person stands straight.

        Args:
            rest: Global orientation of each joint, relative to the present rest pose, in the pose
                that is to become the rest pose, w x y z, (joints, 4).

        Returns:
            A motion with the same joint positions in every frame, whose rotations are relative to
            the new rest pose.

        Raises:
            MotionError: If `rest` has another shape.
        """
        rest = np.asarray(rest, dtype=np.float64)
        if rest.shape != (len(self.names), 4):
            raise MotionError(f"rest must have shape {(len(self.names), 4)}, not {rest.shape}")
        rest = normalize(rest)
        offsets = self.offsets.copy()
        offsets[1:] = rotate(rest[self.parents[1:]], self.offsets[1:])
        return SkeletonMotion(
            names=self.names,
            parents=self.parents,
            offsets=offsets,
            root_positions=self.root_positions,
            rotations=normalize(multiply(self.rotations, conjugate(rest))),
            fps=self.fps,
            name=self.name,
            unit_m=self.unit_m,
            up=self.up,
        )
