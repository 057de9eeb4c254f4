"""Slow, readable twins of the character's kinematics: one pose, one body at a time, by matrices."""

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from tests.oracles import quaternions

Array = npt.NDArray[np.float64]

REFLECTION = np.diag([1.0, -1.0, 1.0])
"""The mirror y = 0."""


def body_frames(character: Character, pose: Array) -> tuple[Array, Array, Array]:
    """Origins (14, 3), rotation matrices (14, 3, 3) and centres of mass (14, 3) by recursion."""
    model = character.model
    origins, matrices = np.zeros((14, 3)), np.zeros((14, 3, 3))
    for body in range(14):
        turn = quaternions.matrix(pose[3 + 4 * body : 7 + 4 * body])
        parent = int(character.parents[body])
        if parent < 0:
            origins[body], matrices[body] = pose[:3], turn
        else:
            origins[body] = origins[parent] + matrices[parent] @ model.body_pos[body + 1]
            matrices[body] = matrices[parent] @ turn
    centers = [origins[b] + matrices[b] @ model.body_ipos[b + 1] for b in range(14)]
    return origins, matrices, np.array(centers)


def surface_points(character: Character, geom: int, rings: int = 120) -> Array:
    """Points all over a box or a capsule, in the frame of its body, (points, 3)."""
    model = character.model
    size = model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        points = corners * size
    else:
        polar = np.linspace(0.0, np.pi, rings)[:, None]
        around = np.linspace(0.0, 2.0 * np.pi, 2 * rings)[None, :]
        ball = np.stack(
            [
                np.sin(polar) * np.cos(around),
                np.sin(polar) * np.sin(around),
                np.cos(polar) * np.ones_like(around),
            ],
            axis=-1,
        ).reshape(-1, 3)
        end = np.array([0.0, 0.0, size[1]])
        points = np.concatenate([size[0] * ball + end, size[0] * ball - end])
    turn = quaternions.matrix(model.geom_quat[geom])
    return model.geom_pos[geom] + points @ turn.T


def lowest_points(character: Character, pose: Array) -> Array:
    """Height of the lowest of many points on each body's surface [m], (14,)."""
    origins, matrices, _ = body_frames(character, pose)
    lowest = np.full(14, np.inf)
    for geom in range(character.model.ngeom):
        body = int(character.model.geom_bodyid[geom]) - 1
        points = origins[body] + surface_points(character, geom) @ matrices[body].T
        lowest[body] = min(lowest[body], points[:, 2].min())
    return lowest


def mujoco_frames(character: Character, pose: Array) -> tuple[Array, Array, Array]:
    """Origins, quaternions and centres of mass by MuJoCo itself."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(character.model, data)
    return data.xpos[1:].copy(), data.xquat[1:].copy(), data.xipos[1:].copy()
