"""The character in its scene: joint stops, limits, and collisions of its bodies."""

import mujoco
import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.builtin import builtin_names, load_builtin
from dynresp.motion.character import Character
from dynresp.physics.scene import IMPACTOR_PREFIX, PREFIX, ImpactorKind, PhysicsConfig, Scene
from tests.physics.conftest import SceneMaker
from tests.physics.samples import about_y, turned, walking


@pytest.fixture(params=list(ImpactorKind), ids=lambda kind: kind.value)
def scene(request: pytest.FixtureRequest, scene_of: SceneMaker) -> Scene:
    return scene_of(request.param)


class TestLayout:
    """What other modules rely on."""

    def test_the_character_comes_first(self, scene: Scene, character: Character) -> None:
        model = scene.model
        for i, name in enumerate(character.body_names):
            assert model.body(PREFIX + name).id == i + 1
        np.testing.assert_array_equal(model.body_mass[1:15], character.masses)
        extra = 0 if scene.kind is ImpactorKind.NONE else 7
        assert (model.nq, model.nv) == (59 + extra, 45 + extra - bool(extra))
        assert model.nu == 52

    def test_a_frame_is_a_whole_number_of_steps(self, scene: Scene) -> None:
        config = scene.config
        assert scene.model.opt.timestep * config.substeps * config.fps == pytest.approx(1.0)
        assert PhysicsConfig(fps=60.0, substeps=4).timestep == pytest.approx(1.0 / 240.0)

    def test_the_hold_is_a_weld_on_the_pelvis(self, scene: Scene) -> None:
        model = scene.model
        assert model.body("hold").mocapid[0] == scene.hold_mocap
        weld = model.equality(scene.hold_weld)
        assert int(weld.type[0]) == int(mujoco.mjtEq.mjEQ_WELD)
        ends = {model.body(int(weld.obj1id[0])).name, model.body(int(weld.obj2id[0])).name}
        assert ends == {"hold", f"{PREFIX}pelvis"}

    def test_one_contact_sensor_for_each_body(self, scene: Scene, character: Character) -> None:
        names = [scene.model.sensor(i).name for i in range(scene.model.nsensor)]
        impactor = scene.kind is not ImpactorKind.NONE
        assert names == [f"hit/{body}" for body in character.body_names if impactor]

    def test_mass_of_the_arm_that_strikes_is_an_arms(self, scene_of: SceneMaker) -> None:
        mass = scene_of(ImpactorKind.STRIKER).model.body(f"{IMPACTOR_PREFIX}striker").mass[0]
        assert 2.0 <= mass <= 6.0


def _passive_torque(model: mujoco.MjModel, pose: np.ndarray, joint: str) -> np.ndarray:
    """Torque (3,) of limits and stops on a joint, in the air, at rest, without servo torque."""
    data = mujoco.MjData(model)
    data.qpos[:59] = pose
    data.qpos[2] += 10.0
    data.ctrl[:] = pose[7:]
    data.eq_active[:] = 0
    mujoco.mj_forward(model, data)
    column = model.joint(PREFIX + joint).dofadr[0]
    torque: np.ndarray = data.qfrc_constraint[column : column + 3]
    return torque


class TestStops:
    """Knees and elbows bend in one direction; forearms turn freely."""

    # The wrong direction about +Y: a knee's shank forward, an elbow's forearm backward.
    @pytest.mark.parametrize(("joint", "wrong"), [("knee", -1.0), ("elbow", 1.0)])
    @pytest.mark.parametrize("side", ["left", "right"])
    def test_bending_in_the_wrong_direction_is_resisted(
        self, character: Character, scene_of: SceneMaker, side: str, joint: str, wrong: float
    ) -> None:
        model, name = scene_of(ImpactorKind.NONE).model, f"{side}_{joint}"
        resisted = []
        for degrees in (20.0, 10.0, 2.0, -20.0, -90.0):
            vector = about_y(np.array([wrong * np.radians(degrees)]))
            pose = turned(character, {name: vector}, 1)[0]
            resisted.append(-wrong * _passive_torque(model, pose, name)[1])
        assert resisted[0] > resisted[1] > 5.0
        assert resisted[0] > 30.0
        np.testing.assert_allclose(resisted[2:], 0.0, atol=1e-6)

    @pytest.mark.parametrize("side", ["left", "right"])
    @pytest.mark.parametrize("bend", [0.0, -60.0])
    def test_the_forearm_twists_freely(
        self, character: Character, scene_of: SceneMaker, side: str, bend: float
    ) -> None:
        model, name = scene_of(ImpactorKind.NONE).model, f"{side}_elbow"
        bent = rotations.about_axis((0.0, 1.0, 0.0), np.radians(bend))
        for degrees in (-80.0, -30.0, 30.0, 80.0):
            twist = rotations.about_axis((0.0, 0.0, 1.0), np.radians(degrees))
            pose = character.rest_pose.copy()
            column = 7 + 4 * character.joint(name)
            pose[column : column + 4] = rotations.multiply(bent, twist)
            assert np.abs(_passive_torque(model, pose, name)).max() < 1e-6

    def test_the_rest_pose_is_free_of_stops(
        self, character: Character, scene_of: SceneMaker
    ) -> None:
        model = scene_of(ImpactorKind.NONE).model
        for name in character.joint_names:
            assert not _passive_torque(model, character.rest_pose, name).any()

    @pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.6, 0.8)])
    def test_each_joint_stops_at_its_range(
        self, character: Character, scene_of: SceneMaker, axis: tuple[float, float, float]
    ) -> None:
        """It is pushed back 3 degrees beyond its range, and not within it.

        About axes that bring no body into another.
        """
        model = scene_of(ImpactorKind.NONE).model
        for name in character.joint_names:
            limit = float(model.joint(PREFIX + name).range[1])
            if axis[1] and not name.endswith(("neck", "back", "ankle")):
                continue
            pushed = []
            for angle in (limit + 0.05, limit - 0.05):
                pose = turned(character, {name: angle * np.array([axis])}, 1)[0]
                pushed.append(float(_passive_torque(model, pose, name) @ np.array(axis)))
            assert pushed[0] < -0.1, name
            if not name.endswith("ankle"):  # a foot turned that far in meets the other
                assert pushed[1] == pytest.approx(0.0, abs=1e-6), name


def _touching(model: mujoco.MjModel, poses: np.ndarray, lift: float) -> list[set[tuple[str, str]]]:
    """Pairs of the character's bodies that touch each other, for each pose."""
    data, touching = mujoco.MjData(model), []
    for pose in poses:
        data.qpos[:59] = pose
        data.qpos[2] += lift
        mujoco.mj_forward(model, data)
        pairs = set()
        for contact in data.contact:
            names = sorted(model.body(model.geom_bodyid[geom]).name for geom in contact.geom)
            pairs.add((names[0], names[1]))
        touching.append(pairs)
    return touching


class TestSelfCollision:
    """Limbs do not pass through each other, and everyday poses touch nothing."""

    def test_the_rest_pose_touches_only_the_floor(
        self, character: Character, scene_of: SceneMaker
    ) -> None:
        model = scene_of(ImpactorKind.NONE).model
        (pairs,) = _touching(model, character.rest_pose[None], 0.0)
        assert pairs <= {(f"{PREFIX}left_foot", "world"), (f"{PREFIX}right_foot", "world")}
        (pairs,) = _touching(model, character.rest_pose[None], 1.0)
        assert not pairs

    def test_a_walk_touches_nothing(self, character: Character, scene_of: SceneMaker) -> None:
        model = scene_of(ImpactorKind.NONE).model
        assert not any(_touching(model, walking(character, 1.5).poses, 1.0))

    @pytest.mark.parametrize("name", builtin_names())
    def test_built_in_motions_hardly_touch_themselves(
        self, character: Character, scene_of: SceneMaker, name: str
    ) -> None:
        motion = load_builtin(name, character)
        touching = _touching(scene_of(ImpactorKind.NONE).model, motion.poses[::4], 3.0)
        share = sum(bool(pairs) for pairs in touching) / len(touching)
        # In falls, rolls and guards of the head the arms touch the body.
        at_ease = motion.labels[0].name in ("walk", "idle")
        assert share <= (0.0 if at_ease else 0.6), sorted(set().union(*touching))

    @pytest.mark.parametrize(
        ("joints", "meet"),
        [
            ({"left_shoulder": (-0.3, 0.0, 0.0)}, {"left_forearm", "left_thigh"}),
            ({"left_hip": (-0.3, 0.0, 0.0)}, {"left_shank", "right_shank"}),
        ],
    )
    def test_limbs_meet_the_body(
        self,
        character: Character,
        scene_of: SceneMaker,
        joints: dict[str, tuple[float, float, float]],
        meet: set[str],
    ) -> None:
        vectors = {name: np.array([value]) for name, value in joints.items()}
        pose = turned(character, vectors, 1)
        (pairs,) = _touching(scene_of(ImpactorKind.NONE).model, pose, 1.0)
        assert tuple(sorted(PREFIX + body for body in meet)) in pairs
