"""Body velocities, against MuJoCo's own."""

import mujoco
import numpy as np
import pytest

from dynresp.errors import MotionError
from dynresp.motion.body_velocities import body_velocities
from dynresp.motion.character import Character
from dynresp.motion.rotations import normalize


def test_they_are_mujocos(character: Character) -> None:
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(20, 59))
    poses[:, 3:] = normalize(poses[:, 3:].reshape(20, 14, 4)).reshape(20, 56)
    rates = rng.normal(scale=3.0, size=(20, 45))
    ours = body_velocities(character, character.kinematics(poses), rates)
    data = mujoco.MjData(character.model)
    both = np.empty(6)
    for frame in range(20):
        data.qpos, data.qvel = poses[frame], rates[frame]
        mujoco.mj_forward(character.model, data)
        for body in range(14):
            # Angular first, then linear of the centre of mass, in axes of the world.
            kind = mujoco.mjtObj.mjOBJ_BODY
            mujoco.mj_objectVelocity(character.model, data, kind, body + 1, both, 0)
            np.testing.assert_allclose(ours.angular[frame, body], both[:3], atol=1e-9)
            np.testing.assert_allclose(ours.centers[frame, body], both[3:], atol=1e-9)


def test_another_number_of_frames_is_refused(character: Character) -> None:
    states = character.kinematics(character.rest_pose)
    with pytest.raises(MotionError, match=r"\(1, 45\), got \(2, 45\)"):
        body_velocities(character, states, np.zeros((2, 45)))
