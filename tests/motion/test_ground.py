import mujoco
import numpy as np
import pytest

from dynresp.motion import ground, rotations
from dynresp.motion.character import ROOT, Character
from dynresp.motion.ground import clearances, foot_contacts, sole_points
from dynresp.support import paths
from tests.motion.samples import random_poses
from tests.oracles import kinematics as slow


class TestClearances:
    def test_equal_mujocos_distances_to_a_plane(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        spec = mujoco.MjSpec.from_file(str(paths.models_folder() / "ragdoll.xml"))
        spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
        model = spec.compile()
        data = mujoco.MjData(model)
        floor = model.geom("floor").id
        poses = random_poses(rng, 20)
        poses[:, 2] += 3.0
        found = clearances(character, character.kinematics(poses))
        for k, pose in enumerate(poses):
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            lowest = np.full(14, np.inf)
            for geom in range(model.ngeom):
                if geom != floor:
                    body = model.geom_bodyid[geom] - 1
                    distance = mujoco.mj_geomDistance(model, data, floor, geom, 100.0, None)
                    lowest[body] = min(lowest[body], distance)
            np.testing.assert_allclose(found[k], lowest, atol=1e-9)

    def test_equal_the_lowest_of_many_surface_points(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        poses = random_poses(rng, 3)
        found = clearances(character, character.kinematics(poses))
        for k, pose in enumerate(poses):
            sampled = slow.lowest_points(character, pose)
            # Points on the surface are never lower than its lowest, and some come close.
            assert (found[k] <= sampled + 1e-12).all()
            np.testing.assert_allclose(found[k], sampled, atol=1e-4)


class TestSolePoints:
    def test_lie_at_the_bottom_of_the_foot(self, character: Character) -> None:
        for side in ("left", "right"):
            points = sole_points(character, side)
            assert points.shape == (4, 3)
            np.testing.assert_allclose(points[:, 2], -0.07, atol=1e-12)
            assert (points[:2, 0] < 0).all()
            assert (points[2:, 0] > 0.1).all()


class TestFootContacts:
    FPS = 60.0

    def contacts(self, character: Character, poses: np.ndarray) -> np.ndarray:
        return foot_contacts(character, character.kinematics(poses), self.FPS)

    def standing(self, character: Character, frames: int) -> np.ndarray:
        return np.tile(character.rest_pose, (frames, 1))

    def lift(self, character: Character, poses: np.ndarray, side: str, frames: slice) -> None:
        """Raise one foot by 15 cm or more, by bending hip and knee."""
        for name, angle in (("hip", -0.9), ("knee", 1.6)):
            column = 7 + 4 * character.joint(f"{side}_{name}")
            poses[frames, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), angle)

    def test_standing_still(self, character: Character) -> None:
        assert self.contacts(character, self.standing(character, 10)).all()
        assert self.contacts(character, self.standing(character, 1)).all()

    def test_a_step(self, character: Character) -> None:
        poses = self.standing(character, 60)
        self.lift(character, poses, "right", slice(20, 40))
        found = self.contacts(character, poses)
        assert found[:, 0].all()
        # Central differences see the jump one frame away from it on either side.
        np.testing.assert_array_equal(np.flatnonzero(~found[:, 1]), np.arange(19, 41))

    def test_a_foot_that_slides_does_not_stand(
        self, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        poses = self.standing(character, 30)
        poses[:, ROOT] += np.linspace(0.0, 29 / self.FPS, 30)[:, None] * [0.6, 0.0, 0.0]
        assert not self.contacts(character, poses).any()
        monkeypatch.setattr(ground, "CONTACT_SPEED", 0.65)
        assert self.contacts(character, poses).all()

    def test_a_foot_in_the_air_does_not_stand(
        self, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        poses = self.standing(character, 30)
        poses[:, 2] += 0.05
        assert not self.contacts(character, poses).any()
        monkeypatch.setattr(ground, "CONTACT_HEIGHT", 0.06)
        assert self.contacts(character, poses).all()

    def test_a_heel_or_a_ball_is_enough(self, character: Character) -> None:
        poses = self.standing(character, 10)
        column = 7 + 4 * character.joint("left_ankle")
        for tilt in (-0.5, 0.5):
            poses[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), tilt)
            assert self.contacts(character, poses).all()

    @pytest.mark.parametrize(("length", "kept"), [(2, False), (3, False), (4, True), (8, True)])
    def test_short_hops_and_short_touches_are_noise(
        self, character: Character, length: int, kept: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ground, "CONTACT_SPEED", 1e3)  # heights alone
        hop = self.standing(character, 40)
        hop[10 : 10 + length, 2] += 0.2
        assert (~self.contacts(character, hop)).any() == kept
        touch = self.standing(character, 40)
        touch[:, 2] += 0.2
        touch[10 : 10 + length, 2] -= 0.2
        assert self.contacts(character, touch).any() == kept

    def test_short_contacts_at_the_ends_stay(
        self, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ground, "CONTACT_SPEED", 1e3)
        poses = self.standing(character, 40)
        poses[1:-1, 2] += 0.2
        found = self.contacts(character, poses)
        np.testing.assert_array_equal(np.flatnonzero(found[:, 0]), [0, 39])
