"""Silhouettes pixel by pixel: is its centre inside the shadow of a ball, a capsule or a box?"""

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from dynresp.motion import rotations
from dynresp.motion.character import Character

FloatArray = npt.NDArray[np.float64]


def silhouette(
    pose: FloatArray,
    character: Character,
    right: FloatArray,
    up: FloatArray,
    size: int,
    pixel: float,
) -> npt.NDArray[np.bool_]:
    """(size, size) the picture of parallel rays, the pelvis in its middle, the top row first."""
    offsets = (np.arange(size) - 0.5 * (size - 1)) * pixel
    inside = np.zeros((size, size), dtype=bool)
    states = character.kinematics(pose)
    model = character.model
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom]) - 1
        extent = model.geom_size[geom]
        is_box = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
        is_capsule = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
        if is_box:
            signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
            points = signs * extent
        else:
            half = extent[1] if is_capsule else 0.0
            points = np.array([[0.0, 0.0, half], [0.0, 0.0, -half]])
        points = model.geom_pos[geom] + rotations.rotate(model.geom_quat[geom], points)
        points = rotations.rotate(states.quaternions[0, body], points)
        points = points + states.positions[0, body] - states.positions[0, 0]
        flat = points @ np.stack([right, up], axis=1)
        for row in range(size):
            for column in range(size):
                at = np.array([offsets[column], -offsets[row]])
                if is_box:
                    sides = ConvexHull(flat).equations
                    inside[row, column] |= bool((sides[:, :2] @ at + sides[:, 2] <= 0).all())
                else:
                    along = flat[1] - flat[0]
                    share = np.dot(at - flat[0], along) / max(np.dot(along, along), 1e-12)
                    nearest = flat[0] + np.clip(share, 0.0, 1.0) * along
                    inside[row, column] |= bool(np.linalg.norm(at - nearest) <= extent[0])
    return inside
