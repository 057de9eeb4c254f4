"""Writing motions: BVH for other programs, and the product's own `.npz`.

BVH. One joint for each of the character's 14 bodies, named as in the model, with OFFSETs of the
rest pose; End Sites at the top of the head, the finger tips and the toes. Lengths are in metres,
so that Blender, whose BVH import does not scale, shows the character life-size (in
programs that count in centimetres, import at a scale of 100). +Y is up and the character faces +Z
at rest, its left being +X: the custom of BVH, which Blender turns to its own Z up. The root's
OFFSET is zero and its position channels say where the pelvis is, so that readers which add the two
and readers which do not agree. Rotation channels are in the order Z X Y: R = Rz Rx Ry, in degrees.

`.npz`. See `dynresp.motion.readers.npz`, which describes the format and reads it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.readers import npz
from dynresp.motion.rotations import FloatArray
from dynresp.support.archive import text_array
from dynresp.support.errors import MotionError
from dynresp.support.files import replacing

# World axes in the order in which they become BVH's x, y, z: left, up, forward.
_LEFT_UP_FORWARD = [1, 2, 0]
# Decimals of lengths [m] and angles [degrees].
_DIGITS = 6
# Below this length the direction of a pair of numbers is noise: the pose is at a gimbal's pole.
_NO_DIRECTION = 1e-9


def write_npz(motion: Motion, path: str | Path, character: Character) -> None:
    """Write the product's own motion file; the same motion gives the same bytes.

    Args:
        motion: What to write.
        path: The file, usually ending in .npz; missing folders are made, an old file is replaced.
        character: The character that the motion is of.

    Raises:
        MotionError: The motion is longer, or a name is, than such a file may hold.
        DynrespError: The file cannot be written.
    """
    names = [label.name for label in motion.labels]
    ranges = [(label.start, label.stop) for label in motion.labels]
    arrays = {
        "character": _texts(character.identity),
        "name": _texts(motion.name),
        "fps": np.array(motion.fps, dtype="<f8"),
        "poses": motion.poses.astype("<f8"),
        "contacts": motion.contacts,
        "label_names": _texts(names),
        "label_ranges": np.array(ranges, dtype="<i8").reshape(-1, 2),
    }
    for name, array in arrays.items():
        problem = npz.FORMAT.problem(name, array.dtype.str, array.shape)
        if problem:
            raise MotionError(f"motion {motion.name[:80]!r} does not fit a .npz file: {problem}")
    npz.FORMAT.write(path, arrays)


def write_bvh(motion: Motion, path: str | Path, character: Character) -> None:
    """Write a BVH file, which Blender and most animation programs open.

    Angles are continuous over the frames where the motion is, also through a gimbal's poles (X at
    90 degrees), so that a program may interpolate between frames.

    Args:
        motion: What to write. Foot contacts, labels and the name have no place in a BVH file.
        path: The file, usually ending in .bvh; missing folders are made, an old file is replaced.
        character: The character that the motion is of.

    Raises:
        DynrespError: The file cannot be written.
    """
    quaternions = motion.poses[:, 3:].reshape(len(motion), -1, 4)
    angles = np.degrees(zxy_angles(quaternions[..., [0, *(1 + i for i in _LEFT_UP_FORWARD)]]))
    values = np.concatenate(
        [motion.root_positions[:, _LEFT_UP_FORWARD], angles.reshape(len(motion), -1)], axis=1
    )
    # Adding zero turns -0.0 into 0.0.
    rows = (np.round(values, _DIGITS) + 0.0).tolist()
    row = " ".join([f"%.{_DIGITS}f"] * values.shape[1]) + "\n"
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write("HIERARCHY\n")
        file.writelines(f"{line}\n" for line in _joint_lines(character, 0, 0))
        file.write(f"MOTION\nFrames: {len(motion)}\nFrame Time: {1.0 / motion.fps:.12f}\n")
        file.writelines(row % tuple(numbers) for numbers in rows)


def zxy_angles(quaternions: npt.ArrayLike) -> FloatArray:
    """Angles a, b, c of R = Rz(a) Rx(b) Ry(c), continuous over the frames.

    Half the sum and half the difference of a and c are the directions of (w + x, y + z) and
    (w - x, z - y), and b follows from the lengths of the two, as multiplying the three half-angle
    quaternions out shows. At a pole one of the lengths is zero and its direction, which then
    does not matter, stays what it was. Nothing loses digits on the way there, and passing
    through a pole is a change of that length's sign.

    Args:
        quaternions: (frames, ..., 4), w x y z, of unit length.

    Returns:
        (frames, ..., 3): a, b, c [rad]. The first frame's are between -pi and pi.
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    half_sum, sum_length = _continuous_polar(w + x, y + z)
    half_difference, difference_length = _continuous_polar(w - x, z - y)
    b = np.unwrap(0.5 * np.pi - 2.0 * np.arctan2(difference_length, sum_length), axis=0)
    angles = np.stack([half_sum + half_difference, b, half_sum - half_difference], axis=-1)
    turn = 2.0 * np.pi
    return np.asarray(angles - turn * np.round(angles[:1] / turn))


def _continuous_polar(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Direction [rad] and signed length of points (frames, ...), the direction without jumps."""
    length = np.hypot(x, y)
    frame = np.arange(len(x)).reshape(-1, *[1] * (x.ndim - 1))
    last_known = np.maximum.accumulate(np.where(length > _NO_DIRECTION, frame, 0), axis=0)
    angle = np.take_along_axis(np.arctan2(y, x), last_known, axis=0)
    smooth = np.unwrap(angle, period=np.pi, axis=0)
    half_turns = np.round((smooth - angle) / np.pi)
    return smooth, np.where(half_turns % 2 == 0, length, -length)


def _joint_lines(character: Character, body: int, depth: int) -> Iterator[str]:
    """The hierarchy from a body on, bodies in the model's order, which is depth first."""
    indent = "  " * depth
    kind = "JOINT" if depth else "ROOT"
    channels = "" if depth else "Xposition Yposition Zposition "
    yield f"{indent}{kind} {character.body_names[body]}"
    yield f"{indent}{{"
    yield f"{indent}  OFFSET {_offset(character.offsets[body])}"
    yield f"{indent}  CHANNELS {3 if depth else 6} {channels}Zrotation Xrotation Yrotation"
    children = np.flatnonzero(character.parents == body).tolist()
    for child in children:
        yield from _joint_lines(character, child, depth + 1)
    if not children:
        yield f"{indent}  End Site"
        yield f"{indent}  {{"
        yield f"{indent}    OFFSET {_offset(_tip(character, body))}"
        yield f"{indent}  }}"
    yield f"{indent}}}"


def _offset(vector: FloatArray) -> str:
    return " ".join(f"{x:.{_DIGITS}f}" for x in np.round(vector[_LEFT_UP_FORWARD], _DIGITS) + 0.0)


def _tip(character: Character, body: int) -> FloatArray:
    """Where a body without children ends, in its frame [m].

    The far side of the capsule that is farthest out, along that axis: the top of
    the head, the finger tips, the toes.
    """
    model = character.model
    geoms = [
        geom
        for geom in np.flatnonzero(model.geom_bodyid == body + 1)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
    ]
    if not geoms:
        return np.zeros(3)
    geom = max(geoms, key=lambda g: float(np.linalg.norm(model.geom_pos[g])))
    center = np.array(model.geom_pos[geom])
    axis = int(np.argmax(np.abs(center)))
    radius, half_length = model.geom_size[geom][:2]
    along = rotations.rotate(model.geom_quat[geom], [0.0, 0.0, 1.0])[axis]
    center[axis] += np.copysign(radius + half_length * abs(along), center[axis])
    return center


def _texts(text: str | list[str]) -> npt.NDArray[np.str_]:
    """Text as a fixed-width array, little-endian.

    Raises:
        MotionError: A name ends in a null character, which a fixed width cannot keep.
    """
    array = text_array(text)
    if array.tolist() != text:
        raise MotionError(f"names must not end in a null character: {text!r}")
    return array
