"""Features of a hit, from which a classifier predicts: states of some bodies after contact.

Zordan et al. 2007 (section 4.2): positions, orientations and velocities of the bodies along the
spine and of the feet, and position and velocity of the centre of mass, in slices of a tenth of a
second from contact on. The frame of reference is where the character stood at contact: the origin
is on the ground below its pelvis, X points where the pelvis faced (`windows.facing_frames`), Z up.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import POSE_SIZE, VELOCITY_SIZE, Character
from dynresp.support.errors import MotionError, UsageError

if TYPE_CHECKING:
    from dynresp.response.prediction.hit_features_kernel import Body

SLICES_S = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
"""Times after contact at which states are recorded [s]. The paper records the first four. An
alignment needs at least half a second of look-ahead, so two more cost nothing."""

PAPER_SLICES_S = SLICES_S[:4]
"""The times of the paper [s]."""

BODIES = ("pelvis", "abdomen", "chest", "head", "left_foot", "right_foot")
"""Bodies along the spine, and the feet."""

Vector: TypeAlias = Literal["large", "small"]
VECTORS: tuple[str, ...] = get_args(Vector)
"""The two feature vectors: all states of the bodies, or a few and the centre of mass."""

_STATE = ("position", "orientation", "velocity", "angular_velocity")
_COM = "com"
_COM_STATE = ("position", "velocity")
_AXES = "xyz"
# The small vector, selected by hand: where feet and centre of mass are at first, how the hit
# changes speed and lean at once, and how balance develops. With 5,500 samples these twenty features
# predict as well as the large vector.
_SMALL = {
    "0.0": (
        "com/velocity_x",
        "left_foot/position_x",
        "left_foot/position_z",
        "right_foot/position_z",
    ),
    "0.1": (
        "com/velocity_x",
        "com/velocity_y",
        "com/velocity_z",
        "chest/orientation_x",
        "chest/orientation_y",
        "head/velocity_x",
        "head/velocity_y",
        "pelvis/angular_velocity_z",
    ),
    "0.3": (
        "com/velocity_x",
        "com/velocity_y",
        "chest/orientation_x",
        "chest/orientation_y",
        "pelvis/orientation_x",
        "pelvis/orientation_y",
        "left_foot/position_x",
        "right_foot/position_x",
    ),
}


def _names() -> tuple[str, ...]:
    states = [(body, quantity) for body in BODIES for quantity in _STATE]
    states += [(_COM, quantity) for quantity in _COM_STATE]
    return tuple(
        f"{slice_s:.1f}/{body}/{quantity}_{axis}"
        for slice_s in SLICES_S
        for body, quantity in states
        for axis in _AXES
    )


FEATURE_NAMES = _names()
"""Names of all features in order: "time after contact [s]/body/quantity_axis". Positions are those
of centres of mass [m]; orientations are rotation vectors from the rest pose [rad]; velocities are
in m/s and rad/s. "com" is the centre of mass of the whole character."""


VERSION = 1
"""Version of the meaning of the names: raised when a feature changes but keeps its name."""


def identity() -> str:
    """Short hash of names and version; other features have another one."""
    return hashlib.sha256(" ".join([str(VERSION), *FEATURE_NAMES]).encode()).hexdigest()[:16]


def slice_frames(fps: float) -> npt.NDArray[np.intp]:
    """Frames after contact that are nearest to the slices (slices,)."""
    return np.round(np.array(SLICES_S) * fps).astype(np.intp)


def extract(
    character: Character, poses: npt.ArrayLike, velocities: npt.ArrayLike, fps: float
) -> npt.NDArray[np.float32]:
    """Features of simulated hits.

    Args:
        character: The character.
        poses: (hits, frames, 59) from contact on.
        velocities: (hits, frames, 45) rows of `qvel` for the same frames.
        fps: Frame rate [1/s].

    Returns:
        (hits, features) in the order of `FEATURE_NAMES`. Slices after the last frame are NaN.

    Raises:
        MotionError: The shapes do not fit, or there is no frame.
    """
    pose = np.asarray(poses, dtype=np.float64)
    rate = np.asarray(velocities, dtype=np.float64)
    fits = pose.ndim == 3 and pose.shape[1] > 0 and pose.shape[2] == POSE_SIZE
    if not fits or rate.shape != (*pose.shape[:2], VELOCITY_SIZE):
        raise MotionError(
            f"expected poses (hits, frames, {POSE_SIZE}) and velocities (hits, frames, "
            f"{VELOCITY_SIZE}) of at least one frame, got {pose.shape} and {rate.shape}"
        )
    # Numba takes a third of a second to import, the kernel a second more when first compiled.
    from dynresp.response.prediction.hit_features_kernel import features_kernel

    frames = slice_frames(fps)
    seen = frames[frames < pose.shape[1]]
    features = np.full((len(pose), len(FEATURE_NAMES)), np.nan, dtype=np.float32)
    features_kernel(
        np.ascontiguousarray(pose), np.ascontiguousarray(rate), seen, _body(character), features
    )
    return features


@functools.lru_cache(maxsize=4)
def _body(character: Character) -> Body:
    """What the kernel needs of a character; its signature knows arrays that can be written."""
    from dynresp.response.prediction.hit_features_kernel import Body

    return Body(
        parents=character.parents.astype(np.int64),
        offsets=np.array(character.offsets, np.float64),
        centers=np.array(character.model.body_ipos[1:], np.float64),
        shares=character.masses / character.masses.sum(),
        chosen=np.array([character.body(name) for name in BODIES], np.int64),
    )


def vector_columns(
    vector: str = "large", slices_s: Sequence[float] = PAPER_SLICES_S
) -> npt.NDArray[np.intp]:
    """Columns of the features that a classifier takes.

    Args:
        vector: "large" for all states of the bodies without the centre of mass (288 in the
            paper's four slices); "small" for twenty features selected by hand, some of them of the
            centre of mass.
        slices_s: Slices to use [s], some of `SLICES_S`.

    Returns:
        Columns of the features, increasing.

    Raises:
        UsageError: There is no such vector or slice, or the vector has no feature in the slices.
    """
    if vector not in VECTORS:
        raise UsageError(f"the feature vector is one of {', '.join(VECTORS)}, got {vector!r}")
    wanted = {f"{slice_s:g}" for slice_s in slices_s}
    known = [f"{slice_s:g}" for slice_s in SLICES_S]
    if not wanted or not wanted <= set(known):
        given = ", ".join(f"{slice_s:g}" for slice_s in slices_s) or "none"
        raise UsageError(f"slices are some of {', '.join(known)} s, got {given}")
    columns = []
    for column, name in enumerate(FEATURE_NAMES):
        slice_s, _, state = name.partition("/")
        small = state in _SMALL.get(slice_s, ())
        in_vector = small if vector == "small" else not state.startswith(_COM)
        if f"{float(slice_s):g}" in wanted and in_vector:
            columns.append(column)
    if not columns:
        raise UsageError(
            f"the small vector has features at {', '.join(_SMALL)} s only; name one of these slices"
        )
    return np.array(columns, dtype=np.intp)
