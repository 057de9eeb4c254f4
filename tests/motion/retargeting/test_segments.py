from dataclasses import replace

import numpy as np
import pytest

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.retargeting.joint_names import head_joint, limb_joints
from dynresp.motion.retargeting.segments import find_segments
from dynresp.support.errors import MotionError
from tests.oracles.retarget import SOURCES, put_on

SIDES = ("left", "right")


def person(character: Character, source: str = "lafan1") -> SkeletonMotion:
    return put_on(SOURCES[source], load_builtin("walk", character), character)


def renamed(skeleton: SkeletonMotion, **new: str) -> SkeletonMotion:
    return replace(skeleton, names=tuple(new.get(name, name) for name in skeleton.names))


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("LeftUpLeg", ("left", "hip")),
        ("mixamorig:RightUpLeg", ("right", "hip")),
        ("mixamorigRightUpLeg", ("right", "hip")),
        ("Character1_LeftLeg", ("left", "knee")),
        ("Bip01 L Thigh", ("left", "hip")),
        ("Bip001 R UpperArm", ("right", "shoulder")),
        ("L_Hip", ("left", "hip")),
        ("l_talocrural", ("left", "ankle")),
        ("lThighBend", ("left", "hip")),
        ("rShldr", ("right", "shoulder")),
        ("lfemur", ("left", "hip")),
        ("rradius", ("right", "elbow")),
        ("LUArm", ("left", "shoulder")),
        ("RFArm", ("right", "elbow")),
        ("upper_arm.L", ("left", "shoulder")),
        ("forearm.R", ("right", "elbow")),
        ("DEF-shin.L", ("left", "knee")),
        ("upperarm_l", ("left", "shoulder")),
        ("UpperLeg_R", ("right", "hip")),
        ("LeftLowLeg", ("left", "knee")),
        ("leftforearm", ("left", "elbow")),
        ("J_Bip_L_LowerLeg", ("left", "knee")),
        ("Model:Solving:RightHand", ("right", "wrist")),
        ("jointLeftHipJoint", ("left", "hip")),
        ("Hips", None),
        ("hip", None),
        ("lowerback", None),
        ("Spine1", None),
        ("LeftHandThumb1", None),
        ("LeftFoot_end", None),
        ("thigh_twist_01_l", None),
        ("upperarm_twist_l", None),
        ("LeftUpLegDummy", None),
        ("LeftToeBase", None),
        ("clavicle_l", None),
    ],
)
def test_meaning_of_a_name(name: str, meaning: tuple[str, str] | None) -> None:
    assert limb_joints([name]) == ({} if meaning is None else {meaning: 0})


def test_surest_name_counts() -> None:
    # A collar bone beside an arm; a helper that only carries the hip; targets of an animator's rig.
    names = [
        "LHipJoint",
        "LeftShoulder",
        "LeftArm",
        "LeftUpLeg",
        "ik_foot_l",
        "foot_l",
        "foot_l.001",
    ]
    assert limb_joints(names) == {
        ("left", "shoulder"): 2, ("left", "hip"): 3, ("left", "ankle"): 5,
    }  # fmt: skip
    assert head_joint(["Neck", "Head", "HeadTop_End", "Head_end"]) == 1
    assert head_joint(["chest", "neck", "neck_end"]) == 1
    assert head_joint(["Bip01 Head", "LeftEye"]) == 0
    assert head_joint(["spine.006", "forehead.L"]) is None


@pytest.mark.parametrize("name", SOURCES)
def test_joints_of_every_source(character: Character, name: str) -> None:
    source = SOURCES[name]
    skeleton = person(character, name)
    found = find_segments(skeleton)
    for side in SIDES:
        for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"):
            assert skeleton.names[found.limbs[side][joint]] == source.limb(joint, side)
        toe = source.limb("toe" if "toe" in source.limbs else "ankle", side)
        assert skeleton.names[found.limbs[side]["toe"]].startswith(toe)
    assert skeleton.names[found.pelvis] == source.middle[0]
    assert skeleton.names[found.chest] == source.middle[-3]
    assert skeleton.names[found.head] == source.middle[-1]


def test_arms_that_hang_from_the_neck(character: Character) -> None:
    skeleton = person(character)
    parents = skeleton.parents.copy()
    neck = skeleton.names.index("Neck")
    for name in ("LeftShoulder", "RightShoulder"):
        parents[skeleton.names.index(name)] = neck
    found = find_segments(replace(skeleton, parents=parents))
    assert skeleton.names[found.chest] == "Spine2"
    assert skeleton.names[found.head] == "Head"


class TestWithoutNames:
    @pytest.fixture
    def nameless(self, character: Character) -> SkeletonMotion:
        skeleton = person(character)
        return replace(skeleton, names=tuple(f"j{i}" for i in range(len(skeleton.names))))

    def test_equals_what_names_say(self, character: Character, nameless: SkeletonMotion) -> None:
        assert find_segments(nameless) == find_segments(person(character))

    def test_of_a_person_who_faces_away(
        self, character: Character, nameless: SkeletonMotion
    ) -> None:
        walk = load_builtin("walk", character).moved(2.6, (1.0, -4.0, 0.0))
        turned = put_on(SOURCES["lafan1"], walk, character)
        found = find_segments(replace(turned, names=nameless.names))
        assert found == find_segments(nameless)

    def test_of_a_person_without_toes(self, character: Character, nameless: SkeletonMotion) -> None:
        skeleton = person(character)
        keep = [i for i, name in enumerate(skeleton.names) if "Toe" not in name]
        stump = SkeletonMotion(
            tuple(nameless.names[i] for i in keep),
            np.array([keep.index(p) if p >= 0 else -1 for p in skeleton.parents[keep]]),
            skeleton.offsets[keep],
            skeleton.root_positions,
            skeleton.rotations[:, keep],
            skeleton.fps,
            "stump",
        )
        found, named = find_segments(stump), find_segments(skeleton)
        for side in SIDES:
            assert stump.names[found.limbs[side]["hip"]] == f"j{named.limbs[side]['hip']}"
            assert found.limbs[side]["toe"] == found.limbs[side]["ankle"]

    def test_when_only_some_names_are_odd(self, character: Character) -> None:
        skeleton = person(character)
        odd = renamed(skeleton, LeftLeg="crus sinister", RightLeg="crus dexter")
        assert find_segments(odd) == find_segments(skeleton)

    def test_when_names_contradict_the_tree(self, character: Character) -> None:
        skeleton = person(character)
        swapped = renamed(skeleton, LeftForeArm="LeftHand", LeftHand="LeftForeArm")
        assert find_segments(swapped) == find_segments(skeleton)


class TestRefuses:
    def test_what_has_no_two_legs(self, character: Character) -> None:
        skeleton = person(character)
        keep = [i for i, name in enumerate(skeleton.names) if "RightUpLeg" not in name]
        keep = [i for i in keep if skeleton.parents[i] in (-1, *keep)]
        keep = [i for i in keep if skeleton.parents[i] in (-1, *keep)]
        keep = [i for i in keep if skeleton.parents[i] in (-1, *keep)]
        keep = [i for i in keep if skeleton.parents[i] in (-1, *keep)]
        lame = SkeletonMotion(
            tuple(skeleton.names[i] for i in keep),
            np.array([keep.index(p) if p >= 0 else -1 for p in skeleton.parents[keep]]),
            skeleton.offsets[keep],
            skeleton.root_positions,
            skeleton.rotations[:, keep],
            skeleton.fps,
            "lame",
        )
        with pytest.raises(MotionError, match=r"'lame': no joint found for the right hip.*LeftLeg"):
            find_segments(lame)

    def test_a_bone_of_no_length(self, character: Character) -> None:
        skeleton = person(character)
        offsets = skeleton.offsets.copy()
        offsets[skeleton.names.index("LeftLeg")] = 0.0
        with pytest.raises(MotionError, match=r"'LeftUpLeg' to 'LeftLeg' is 0\.000 m long"):
            find_segments(replace(skeleton, offsets=offsets))

    def test_a_worm(self) -> None:
        names = tuple(f"ring{i}" for i in range(9))
        worm = SkeletonMotion(
            names, np.arange(-1, 8), np.tile([0.1, 0.0, 0.0], (9, 1)), np.zeros((2, 3)),
            np.tile([1.0, 0.0, 0.0, 0.0], (2, 9, 1)), 30.0, "worm",
        )  # fmt: skip
        with pytest.raises(MotionError, match="ring0, ring1"):
            find_segments(worm)
