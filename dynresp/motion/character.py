"""The character: names, mirror pairs and kinematics of whole motions at once.

A pose is a row of MuJoCo `qpos` of `models/ragdoll.xml`: root position (3) [m], root quaternion
(4), then one quaternion (4) for each of the 13 ball joints, w x y z: 59 numbers. A velocity is a
row of `qvel`: root linear velocity in the world (3) [m/s], root angular velocity in the root's own
frame (3) [rad/s], then each joint's angular velocity in the child body's frame: 45 numbers.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.support import paths
from dynresp.support.arrays import frozen
from dynresp.support.errors import MotionError, UnknownNameError

POSE_SIZE = 59
VELOCITY_SIZE = 45
ROOT = slice(0, 3)
ROOT_QUAT = slice(3, 7)
JOINTS = slice(7, POSE_SIZE)

GEOM_TYPES = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_BOX,
)
"""Shapes that the bodies of a character may have; `ground.clearances` knows how low these reach."""

# A pose mirrored in the plane y = 0: y of positions, and x and z of quaternions, change sign.
_MIRROR_POSITION = np.array([1.0, -1.0, 1.0])
_MIRROR_QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True)
class BodyStates:
    """Where all bodies are, frame by frame.

    Attributes:
        positions: (frames, bodies, 3) origin of each body, its proximal joint [m], world.
        quaternions: (frames, bodies, 4) orientation of each body, w x y z, world.
        centers: (frames, bodies, 3) centre of mass of each body [m], world.
    """

    positions: FloatArray
    quaternions: FloatArray
    centers: FloatArray


class Character:
    """A character of 14 bodies and 13 ball joints: its names, masses and kinematics.

    A pose is 59 numbers, a row of MuJoCo's `qpos`: root position [m] (Z up), root quaternion, then
    one quaternion for each joint relative to its parent, all w x y z. Arrays are read-only.

    Attributes:
        file: The MJCF file from which it was loaded.
        model: Its MuJoCo model, without floor or servos.
        body_names: The 14 bodies, the pelvis first, parents before children.
        joint_names: The 13 ball joints in the order of a pose; joint i moves body i + 1.
        parents: (14,) index of each body's parent, -1 for the pelvis.
        offsets: (14, 3) origin of each body in its parent's frame [m].
        masses: (14,) mass of each body [kg].
        mirror_bodies: (14,) index of the body on the other side; a body in the middle has its own.
        rest_pose: (59,) the pose standing, arms hanging, facing +X.
        identity: Short hash of the model; it changes when the character does.

    Examples:
        >>> import dynresp
        >>> character = dynresp.Character()
        >>> character.body_names[:4]
        ('pelvis', 'abdomen', 'chest', 'head')
        >>> states = character.kinematics(character.rest_pose)
        >>> states.positions.shape  # frames, bodies, x y z [m]
        (1, 14, 3)
    """

    def __init__(self, model_file: Path | None = None) -> None:
        """Load the character.

        Args:
            model_file: An MJCF file with a free root and 13 ball joints; by default dynresp's own,
                `models/ragdoll.xml`.

        Raises:
            MotionError: The file cannot be read, its model has other joints, or its body frames
                are turned or not at their joints.
        """
        self.file = file = model_file or paths.models_folder() / "ragdoll.xml"
        try:
            self.model = mujoco.MjModel.from_xml_path(str(file))
        except ValueError as error:
            raise MotionError(f"{file}: not a MuJoCo model ({error}); give an MJCF file") from error
        _check_layout(file, self.model)
        bodies = range(1, self.model.nbody)
        self.body_names = tuple(self.model.body(i).name for i in bodies)
        self.joint_names = tuple(self.model.joint(i).name for i in range(1, self.model.njnt))
        self.parents = frozen(self.model.body_parentid[1:] - 1)
        self.offsets = frozen(np.where(self.parents[:, None] < 0, 0.0, self.model.body_pos[1:]))
        self.masses = frozen(np.array(self.model.body_mass[1:]))
        self.mirror_bodies = frozen(_mirror_permutation(self.body_names))
        self._mirror_joints = _mirror_permutation(self.joint_names)
        self.rest_pose = frozen(np.array(self.model.qpos0))
        self._center_offsets = self.model.body_ipos[1:].copy()
        self._parents = self.parents.astype(np.int64)
        self.identity = hashlib.sha256(_contents(self.model)).hexdigest()[:16]

    def body(self, name: str) -> int:
        """Index of a body by its name (0 is the pelvis).

        Raises:
            UnknownNameError: There is no such body.
        """
        return _index("body", name, self.body_names)

    def joint(self, name: str) -> int:
        """Index of a ball joint by its name, in the order of `joint_names`.

        Raises:
            UnknownNameError: There is no such joint.
        """
        return _index("joint", name, self.joint_names)

    def mirror_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs (left, right) of body names that mirroring exchanges."""
        names = self.body_names
        pairs = ((names[i], names[j]) for i, j in enumerate(self.mirror_bodies) if i < j)
        return tuple(pairs)

    def kinematics(self, poses: npt.ArrayLike) -> BodyStates:
        """Positions and orientations of all bodies in all frames, in the world.

        Args:
            poses: (frames, 59), or one pose (59,), which counts as one frame.

        Returns:
            The states, with the same number of frames.

        Raises:
            MotionError: The poses have another shape.
        """
        # Numba takes a third of a second to import, the kernel a second when first compiled.
        from dynresp.motion.kinematics_kernel import kinematics_kernel

        poses = np.ascontiguousarray(as_poses(poses))
        shape = (len(poses), len(self.body_names))
        states = BodyStates(np.empty((*shape, 3)), np.empty((*shape, 4)), np.empty((*shape, 3)))
        kinematics_kernel(
            poses, self._parents, self.offsets, self._center_offsets,
            states.positions, states.quaternions, states.centers,
        )  # fmt: skip
        return states

    def local_rotations(self, quaternions: npt.ArrayLike) -> FloatArray:
        """Joint quaternions from the orientations of all bodies.

        Args:
            quaternions: (frames, 14, 4) world orientations, w x y z.

        Returns:
            (frames, 14, 4): the root's own orientation first, then the 13 joints'.
        """
        world = np.asarray(quaternions, dtype=np.float64)
        local = world.copy()
        local[:, 1:] = rotations.multiply(
            rotations.conjugate(world[:, self.parents[1:]]), world[:, 1:]
        )
        return local

    def mirror(self, poses: npt.ArrayLike) -> FloatArray:
        """Poses (frames, 59) mirrored in the plane y = 0: left becomes right."""
        poses = as_poses(poses)
        mirrored = poses.copy()
        mirrored[:, ROOT] *= _MIRROR_POSITION
        mirrored[:, ROOT_QUAT] *= _MIRROR_QUATERNION
        joints = poses[:, JOINTS].reshape(len(poses), -1, 4)[:, self._mirror_joints]
        mirrored[:, JOINTS] = (joints * _MIRROR_QUATERNION).reshape(len(poses), -1)
        return mirrored


@functools.cache
def default_character() -> Character:
    """The default character, loaded once."""
    return Character()


def as_poses(poses: npt.ArrayLike) -> FloatArray:
    """Poses as a float64 array (frames, 59).

    Raises:
        MotionError: Another shape.
    """
    array = np.asarray(poses, dtype=np.float64)
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != POSE_SIZE:
        raise MotionError(f"poses must have the shape (frames, {POSE_SIZE}), got {array.shape}")
    return array


def _index(kind: str, name: str, names: tuple[str, ...]) -> int:
    try:
        return names.index(name)
    except ValueError:
        raise UnknownNameError(kind, name, names) from None


def _mirror_permutation(names: tuple[str, ...]) -> npt.NDArray[np.intp]:
    def other(name: str) -> str:
        if name.startswith("left_"):
            return "right_" + name.removeprefix("left_")
        if name.startswith("right_"):
            return "left_" + name.removeprefix("right_")
        return name

    return np.array([names.index(other(name)) for name in names])


def _check_layout(file: Path, model: mujoco.MjModel) -> None:
    """Refuse a model whose poses are not in the layout that this module assumes."""
    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    if model.jnt_type.tolist() != [free] + [ball] * 13 or model.nbody != 15:
        raise MotionError(
            f"{file}: the character needs a free root and 13 ball joints, each with a body of its "
            f"own (nq {POSE_SIZE}, nv {VELOCITY_SIZE}); this model has {model.njnt} joints, "
            f"{model.nbody - 1} bodies, nq {model.nq} and nv {model.nv}"
        )
    one_each = model.jnt_bodyid.tolist() == list(range(1, 15))
    if not (
        one_each and np.all(model.body_quat == rotations.identity()) and not model.jnt_pos.any()
    ):
        raise MotionError(
            f"{file}: every body needs one joint, at its origin, and a frame aligned with the "
            "world in the rest pose; take out quat, euler or axisangle of bodies and pos of joints"
        )
    known = {int(kind) for kind in GEOM_TYPES}
    if not set(model.geom_type.tolist()) <= known:
        raise MotionError(f"{file}: geoms must be spheres, capsules or boxes; this has others")


def _contents(model: mujoco.MjModel) -> bytes:
    """What identifies a character: its tree, sizes and masses.

    Rounded, since the model compiler's last digits may differ from machine to machine.
    """
    parts = (model.body_parentid, model.body_pos, model.body_mass, model.body_inertia,
             model.body_ipos, model.geom_type, model.geom_size, model.geom_pos)  # fmt: skip
    return b"".join((np.round(part, 9) + 0.0).astype("<f8").tobytes() for part in parts)
