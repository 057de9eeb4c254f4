"""Heights of bodies above the floor, and foot contacts.

The floor is the plane z = 0.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.rotations import FloatArray
from dynresp.support.runs import runs

CONTACT_HEIGHT = 0.045
"""A foot stands if some corner of its sole is at most this high [m] ..."""
CONTACT_SPEED = 0.55
"""... and that corner moves at most this fast [m/s]."""
CONTACT_GAP_S = 0.07
"""Contacts, and gaps between them, that are shorter than this are noise [s]."""


def clearances(character: Character, states: BodyStates) -> FloatArray:
    """Height above the floor of the lowest point of each body's geoms.

    Args:
        character: The character.
        states: Its bodies over some frames.

    Returns:
        (frames, 14) [m]; negative where a body is in the ground.
    """
    model = character.model
    lowest = np.full(states.positions.shape[:2], np.inf)
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom]) - 1
        quaternion = states.quaternions[:, body]
        center = states.positions[:, body] + rotations.rotate(quaternion, model.geom_pos[geom])
        axes = rotations.multiply(quaternion, model.geom_quat[geom])
        height = center[:, 2] - _half_extent(model, geom, axes)
        lowest[:, body] = np.minimum(lowest[:, body], height)
    return lowest


def _half_extent(model: mujoco.MjModel, geom: int, axes: FloatArray) -> FloatArray:
    """How far a geom reaches below its centre, for orientations (frames, 4)."""
    size = model.geom_size[geom]
    kind = model.geom_type[geom]
    # Third row of the rotation matrix: the vertical in the geom's own frame.
    up = rotations.rotate(rotations.conjugate(axes), np.array([0.0, 0.0, 1.0]))
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.full(len(axes), size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.asarray(size[0] + size[1] * np.abs(up[:, 2]))
    return np.abs(up) @ size


def sole_points(character: Character, side: str) -> FloatArray:
    """Corners of a foot's sole, in the foot's own frame.

    Args:
        character: The character.
        side: "left" or "right".

    Returns:
        (4, 3) [m]: the heel's two corners, then the ball's.
    """
    geom = character.model.geom(f"{side}_sole")
    half, center = geom.size, geom.pos
    corners = [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    return np.array([center + half * np.array([x, y, -1.0]) for x, y in corners])


def foot_contacts(character: Character, states: BodyStates, fps: float) -> npt.NDArray[np.bool_]:
    """Which feet stand: some corner of the sole is low and slow.

    Args:
        character: The character.
        states: Its bodies over some frames.
        fps: Frame rate [1/s].

    Returns:
        (frames, 2): left, right.
    """
    columns = []
    for side in ("left", "right"):
        foot = character.body(f"{side}_foot")
        points = states.positions[:, foot, None] + rotations.rotate(
            states.quaternions[:, foot, None], sole_points(character, side)
        )
        if len(points) > 1:
            speed = np.linalg.norm(np.gradient(points, 1.0 / fps, axis=0), axis=-1)
        else:
            speed = np.zeros(points.shape[:2])
        standing = ((points[..., 2] <= CONTACT_HEIGHT) & (speed <= CONTACT_SPEED)).any(axis=1)
        shortest = max(1, round(CONTACT_GAP_S * fps))
        columns.append(_without_short_runs(standing, shortest))
    return np.stack(columns, axis=1)


def _without_short_runs(flags: npt.NDArray[np.bool_], shortest: int) -> npt.NDArray[np.bool_]:
    """Close gaps, then drop contacts, of fewer than `shortest` frames and not at the ends."""
    out = flags.copy()
    for value in (False, True):
        for start, stop in runs(out == value):
            if start > 0 and stop < len(out) and stop - start < shortest:
                out[start:stop] = not value
    return out
