import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import Character, as_poses
from dynresp.motion.ground import clearances
from dynresp.support import paths
from dynresp.support.errors import MotionError, UnknownNameError
from tests.motion.samples import random_poses
from tests.oracles import kinematics as slow
from tests.oracles.quaternions import matrix

MODEL = paths.models_folder() / "ragdoll.xml"


class TestNames:
    def test_bodies_and_joints(self, character: Character) -> None:
        assert len(character.body_names) == 14
        assert character.body_names[0] == "pelvis"
        assert len(character.joint_names) == 13
        for i, name in enumerate(character.joint_names):
            assert character.joint(name) == i
            assert character.model.jnt_bodyid[i + 1] == i + 2  # joint i moves body i + 1
        assert all(character.parents[i] < i for i in range(14))

    def test_mirror_pairs(self, character: Character) -> None:
        limbs = ("upper_arm", "forearm", "thigh", "shank", "foot")
        assert character.mirror_pairs() == tuple((f"left_{x}", f"right_{x}") for x in limbs)
        both_ways = character.mirror_bodies[character.mirror_bodies]
        np.testing.assert_array_equal(both_ways, np.arange(14))

    def test_unknown_names_are_told_with_the_valid_ones(self, character: Character) -> None:
        with pytest.raises(UnknownNameError, match=r"unknown body 'left_thig'.*left_thigh"):
            character.body("left_thig")
        with pytest.raises(UnknownNameError, match="left_knee"):
            character.joint("knee")

    def test_arrays_are_read_only(self, character: Character) -> None:
        for array in (character.masses, character.rest_pose, character.offsets, character.parents):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


class TestIdentity:
    def write(self, folder: Path, old: str, new: str) -> Path:
        text = MODEL.read_text()
        assert old in text
        file = folder / "model.xml"
        file.write_text(text.replace(old, new))
        return file

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ('mass="5.0662"', 'mass="5.0663"'),
            ('pos="0 0 0.2188"', 'pos="0 0 0.2187"'),
            ('size="0.098"', 'size="0.099"'),
        ],
    )
    def test_changes_with_the_character(
        self, character: Character, tmp_path: Path, old: str, new: str
    ) -> None:
        other = Character(self.write(tmp_path, old, new))
        assert other.identity != character.identity
        assert Character().identity == character.identity

    def test_does_not_hang_on_the_last_digit(self, character: Character, tmp_path: Path) -> None:
        file = self.write(tmp_path, 'pos="0 0 0.2188"', 'pos="0 0 0.21880000000000002"')
        assert Character(file).identity == character.identity

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ('<joint name="neck" range="0 75"/>', "", "13 ball joints"),
            ('<joint name="neck" range="0 75"/>', '<joint name="neck" type="hinge"/>', "13 ball"),
            ('name="neck" range', 'name="neck" pos="0 0 0.1" range', "at its origin"),
            ('name="head" pos="0 0 0.2188"', 'name="head" pos="0 0 0.2" euler="0 9 0"', "aligned"),
            ("</mujoco>", "", "not a MuJoCo model"),
        ],
    )
    def test_other_layouts_are_refused(
        self, tmp_path: Path, old: str, new: str, message: str
    ) -> None:
        with pytest.raises(MotionError, match=message):
            Character(self.write(tmp_path, old, new))


class TestKinematics:
    def test_equals_mujoco(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 50)
        states = character.kinematics(poses)
        for k, pose in enumerate(poses):
            positions, quaternions, centers = slow.mujoco_frames(character, pose)
            np.testing.assert_allclose(states.positions[k], positions, atol=1e-12)
            np.testing.assert_allclose(states.centers[k], centers, atol=1e-12)
            apart = 1.0 - np.abs(np.sum(states.quaternions[k] * quaternions, axis=-1))
            np.testing.assert_allclose(apart, 0.0, atol=1e-12)

    def test_equals_slow_twin(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 3)
        states = character.kinematics(poses)
        for k, pose in enumerate(poses):
            origins, matrices, centers = slow.body_frames(character, pose)
            np.testing.assert_allclose(states.positions[k], origins, atol=1e-12)
            np.testing.assert_allclose(states.centers[k], centers, atol=1e-12)
            for body in range(14):
                np.testing.assert_allclose(
                    matrix(states.quaternions[k, body]), matrices[body], atol=1e-12
                )

    def test_one_pose_counts_as_one_frame(self, character: Character) -> None:
        states = character.kinematics(character.rest_pose)
        assert states.positions.shape == (1, 14, 3)
        assert dataclasses.is_dataclass(states)

    def test_local_rotations_undo_it(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 20)
        local = character.local_rotations(character.kinematics(poses).quaternions)
        np.testing.assert_allclose(local.reshape(20, -1), poses[:, 3:], atol=1e-14)

    @pytest.mark.parametrize("shape", [(58,), (3, 60), (2, 3, 59)])
    def test_wrong_shapes(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(MotionError, match=r"\(frames, 59\)"):
            as_poses(np.zeros(shape))


class TestMirror:
    def test_twice_is_nothing(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 20)
        np.testing.assert_array_equal(character.mirror(character.mirror(poses)), poses)

    def test_is_a_reflection(self, character: Character, rng: np.random.Generator) -> None:
        poses = random_poses(rng, 20)
        there = character.kinematics(poses)
        here = character.kinematics(character.mirror(poses))
        swap = character.mirror_bodies
        reflected = there.positions[:, swap] @ slow.REFLECTION
        np.testing.assert_allclose(here.positions, reflected, atol=1e-12)
        np.testing.assert_allclose(
            here.centers, there.centers[:, swap] @ slow.REFLECTION, atol=1e-12
        )
        for body in range(14):
            expected = slow.REFLECTION @ matrix(there.quaternions[0, swap[body]]) @ slow.REFLECTION
            np.testing.assert_allclose(matrix(here.quaternions[0, body]), expected, atol=1e-12)

    def test_rest_pose_is_symmetric(self, character: Character) -> None:
        mirrored = character.mirror(character.rest_pose)[0]
        np.testing.assert_array_equal(mirrored, character.rest_pose)


# De Leva (1996), J. Biomechanics 29(9), table 4, males: mass [% of body mass], length [mm],
# centre of mass [% of length from the proximal or upper end], radii of gyration [% of length]
# about the sagittal, transverse and longitudinal axis. The head reaches from the vertex to
# mid-gonion, the shank to the lateral malleolus.
DE_LEVA = {
    "head": (6.94, 203.3, 59.76, (36.2, 37.6, 31.2)),
    "upper trunk": (15.96, 170.7, 29.99, (71.6, 45.4, 65.9)),
    "middle trunk": (16.33, 215.5, 45.02, (48.2, 38.3, 46.8)),
    "lower trunk": (11.17, 145.7, 61.15, (61.5, 55.1, 58.7)),
    "upper arm": (2.71, 281.7, 57.72, (28.5, 26.9, 15.8)),
    "forearm": (1.62, 268.9, 45.74, (27.6, 26.5, 12.1)),
    "hand": (0.61, 86.2, 79.00, (62.8, 51.3, 40.1)),
    "thigh": (14.16, 422.2, 40.95, (32.9, 32.9, 14.9)),
    "shank": (4.33, 434.0, 44.59, (25.5, 24.9, 10.3)),
    "foot": (1.37, 258.1, 44.15, (25.7, 24.5, 12.4)),
}
BODY_MASS = 73.0
# Bodies that are one segment of the table, and how their frame's Z [m] runs along it: from the
# segment's lower end upward in the trunk, from its upper end downward in the limbs.
UPWARD = {"pelvis": "lower trunk", "abdomen": "middle trunk", "chest": "upper trunk"}
DOWNWARD = {"upper_arm": "upper arm", "thigh": "thigh", "shank": "shank"}


def segment(name: str) -> tuple[float, float, float, np.ndarray]:
    """Mass [kg], length [m], distance of the centre from the upper end [m], moments [kg m2]."""
    percent, length, center, radii = DE_LEVA[name]
    mass, metres = BODY_MASS * percent / 100.0, length / 1000.0
    return mass, metres, metres * center / 100.0, mass * (metres * np.array(radii) / 100.0) ** 2


class TestAnthropometry:
    """The numbers of the model come from the table; 0.6 units of their last digit are rounding."""

    def inertial(self, character: Character, body: str) -> tuple[float, np.ndarray, np.ndarray]:
        index = character.body(body) + 1
        model = character.model
        np.testing.assert_allclose(model.body_iquat[index], [1.0, 0.0, 0.0, 0.0], atol=1e-12)
        return float(model.body_mass[index]), model.body_ipos[index], model.body_inertia[index]

    @pytest.mark.parametrize("body", UPWARD)
    def test_trunk(self, character: Character, body: str) -> None:
        mass, length, center, moments = segment(UPWARD[body])
        found_mass, found_center, found_moments = self.inertial(character, body)
        assert found_mass == pytest.approx(mass, abs=6e-5)
        np.testing.assert_allclose(found_center, [0.0, 0.0, length - center], atol=6e-5)
        np.testing.assert_allclose(found_moments, moments, atol=6e-6)

    @pytest.mark.parametrize("side", ["left", "right"])
    @pytest.mark.parametrize("limb", DOWNWARD)
    def test_limbs(self, character: Character, side: str, limb: str) -> None:
        mass, _, center, moments = segment(DOWNWARD[limb])
        found_mass, found_center, found_moments = self.inertial(character, f"{side}_{limb}")
        assert found_mass == pytest.approx(mass, abs=6e-5)
        np.testing.assert_allclose(found_center, [0.0, 0.0, -center], atol=6e-5)
        np.testing.assert_allclose(found_moments, moments, atol=6e-6)

    def test_head(self, character: Character) -> None:
        mass, _, center, moments = segment("head")
        found_mass, found_center, found_moments = self.inertial(character, "head")
        assert found_mass == pytest.approx(mass, abs=6e-5)
        np.testing.assert_allclose(found_moments, moments, atol=6e-6)
        # The vertex is where the head's geom ends.
        geom = character.model.geom("head")
        vertex = geom.pos[2] + geom.size[0] + geom.size[1]
        assert vertex - found_center[2] == pytest.approx(center, abs=1e-4)

    @pytest.mark.parametrize("side", ["left", "right"])
    def test_forearm_and_hand_are_one_body(self, character: Character, side: str) -> None:
        arm_mass, arm_length, arm_center, arm_moments = segment("forearm")
        hand_mass, _, hand_center, hand_moments = segment("hand")
        mass = arm_mass + hand_mass
        center = (arm_mass * arm_center + hand_mass * (arm_length + hand_center)) / mass
        moments = arm_moments + hand_moments
        across = arm_mass * (center - arm_center) ** 2
        across += hand_mass * (arm_length + hand_center - center) ** 2
        moments[:2] += across  # parallel axes, beside the long one
        found_mass, found_center, found_moments = self.inertial(character, f"{side}_forearm")
        assert found_mass == pytest.approx(mass, abs=6e-5)
        np.testing.assert_allclose(found_center, [0.0, 0.0, -center], atol=6e-5)
        np.testing.assert_allclose(found_moments, moments, atol=6e-6)

    @pytest.mark.parametrize("side", ["left", "right"])
    def test_foot(self, character: Character, side: str) -> None:
        mass, _, center, moments = segment("foot")
        found_mass, found_center, found_moments = self.inertial(character, f"{side}_foot")
        assert found_mass == pytest.approx(mass, abs=6e-5)
        # The foot's long axis is x; sagittal and transverse are across it.
        np.testing.assert_allclose(sorted(found_moments), sorted(moments), atol=6e-6)
        assert found_moments[0] == min(found_moments)
        sole = character.model.geom(f"{side}_sole")
        heel = sole.pos[0] - sole.size[0]
        assert found_center[0] - heel == pytest.approx(center, abs=1e-4)

    @pytest.mark.parametrize(
        ("body", "child", "segment_name"),
        [
            ("abdomen", "chest", "middle trunk"),
            ("pelvis", "abdomen", "lower trunk"),
            ("left_upper_arm", "left_forearm", "upper arm"),
            ("right_thigh", "right_shank", "thigh"),
        ],
    )
    def test_lengths(self, character: Character, body: str, child: str, segment_name: str) -> None:
        assert character.body_names[character.parents[character.body(child)]] == body
        length = np.linalg.norm(character.offsets[character.body(child)])
        assert length == pytest.approx(segment(segment_name)[1], abs=1e-9)

    def test_whole_body(self, character: Character) -> None:
        assert character.masses.sum() == pytest.approx(BODY_MASS, rel=1e-3)
        top = character.kinematics(character.rest_pose).positions[0, character.body("head"), 2]
        geom = character.model.geom("head")
        assert top + geom.pos[2] + geom.size.sum() == pytest.approx(1.741, abs=0.003)


class TestRestPose:
    def test_stands_at_height_zero_on_flat_soles(self, character: Character) -> None:
        states = character.kinematics(character.rest_pose)
        heights = clearances(character, states)[0]
        feet = [character.body("left_foot"), character.body("right_foot")]
        np.testing.assert_allclose(heights[feet], 0.0, atol=1e-9)
        assert np.delete(heights, feet).min() > 0.05
        for foot in feet:
            np.testing.assert_allclose(states.quaternions[0, foot], rotations.identity())

    def test_faces_x_with_the_left_to_y(self, character: Character) -> None:
        at = dict(zip(character.body_names, character.offsets, strict=True))
        assert at["left_thigh"][1] > 0 > at["right_thigh"][1]
        assert character.model.geom("left_toe").pos[0] > character.model.geom("left_sole").pos[0]

    def test_touches_nothing_of_itself(self, character: Character) -> None:
        data = mujoco.MjData(character.model)
        data.qpos[:] = character.rest_pose
        mujoco.mj_forward(character.model, data)
        assert data.ncon == 0
