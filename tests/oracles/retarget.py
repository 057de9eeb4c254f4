"""People as other programs rig them: our motions put on skeletons of other sources.

Each source has its own names, number of joints, proportions, rest pose, axes and order of angles,
and the same person moves in all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.rotations import FloatArray

# World axes (forward, left, up) in the order in which they become a file's x, y, z.
_FILE_AXES = {"y": [1, 2, 0], "z": [0, 1, 2]}
_UP = np.array([0.0, 0.0, 1.0])
_TOE, _TOE_END = np.array([0.14, 0.0, -0.05]), np.array([0.2, 0.0, -0.05])
_LIMB = ("collar", "shoulder", "elbow", "wrist", "hipjoint", "hip", "knee", "ankle", "toe")


@dataclass(frozen=True)
class Source:
    """How a source rigs people.

    Attributes:
        middle: Names of the joints hips, spine ..., neck, head, in that order.
        limbs: Names of the limbs' joints with {} for the side; those left out are not there.
        sides: The words for left and right.
        rest: "down", "t", "a", "along" (every bone along one axis), "mirrored" (the same, but
            backward on the right), "lying" or "turned".
        up: The file's axis that points up.
        unit: Metres per unit of the file.
        order: Order of the rotation channels.
        sizes: By how much thighs, shanks, upper arms and forearms differ from the character's.
        extra: Joints that carry no segment: name, and the name of the joint they hang from.
    """

    middle: tuple[str, ...]
    limbs: dict[str, str]
    sides: tuple[str, str] = ("Left", "Right")
    rest: str = "t"
    up: str = "y"
    unit: float = 0.01
    order: str = "ZXY"
    sizes: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    extra: tuple[tuple[str, str], ...] = ()
    scale: float = field(default=1.0)

    def limb(self, joint: str, side: str) -> str:
        """Name of a limb's joint."""
        return self.limbs[joint].format(self.sides[0 if side == "left" else 1])


def put_on(source: Source, motion: Motion, character: Character) -> SkeletonMotion:
    """A motion of ours on a skeleton of another source; Z up, metres."""
    states = character.kinematics(motion.poses)
    stand = character.kinematics(character.rest_pose).positions[0]
    names: list[str] = []
    parents: list[int] = []
    places: list[FloatArray] = []
    bodies: list[int] = []

    def add(name: str, parent: str | None, place: FloatArray, body: str) -> None:
        parents.append(-1 if parent is None else names.index(parent))
        names.append(name)
        places.append(np.asarray(place, dtype=np.float64))
        bodies.append(character.body(body))

    at = {name: stand[character.body(name)] for name in character.body_names}
    hips, *spine, neck, head = source.middle
    add(hips, None, at["pelvis"], "pelvis")
    below = hips
    levels = np.linspace(0.0, 1.0, len(spine)) if len(spine) > 1 else [1.0]
    for name, level in zip(spine, levels, strict=True):
        place = at["abdomen"] + level * (at["chest"] - at["abdomen"])
        add(name, below, place, "chest" if level == 1.0 else "abdomen")
        below = name
    add(neck, below, at["head"], "chest")
    add(head, neck, at["head"] + 0.08 * _UP, "head")
    add(f"{head}_end", head, at["head"] + 0.25 * _UP, "head")
    thigh, shank, upper, fore = source.sizes
    for side, sign in (("left", 1.0), ("right", -1.0)):
        part = {x: source.limb(x, side) for x in _LIMB if x in source.limbs}
        shoulder = at[f"{side}_upper_arm"]
        elbow = shoulder + upper * (at[f"{side}_forearm"] - shoulder)
        wrist = elbow + np.array([0.0, 0.0, -0.255 * fore])
        top = below
        if "collar" in part:
            add(part["collar"], below, at["chest"] + [0.0, 0.04 * sign, 0.12], "chest")
            top = part["collar"]
        add(part["shoulder"], top, shoulder, f"{side}_upper_arm")
        add(part["elbow"], part["shoulder"], elbow, f"{side}_forearm")
        add(part["wrist"], part["elbow"], wrist, f"{side}_forearm")
        add(f"{part['wrist']}_end", part["wrist"], wrist + 0.6 * (wrist - elbow), f"{side}_forearm")
        hip = at[f"{side}_thigh"]
        knee = hip + thigh * (at[f"{side}_shank"] - hip)
        ankle = knee + shank * (at[f"{side}_foot"] - at[f"{side}_shank"])
        top = hips
        if "hipjoint" in part:
            add(part["hipjoint"], hips, at["pelvis"], "pelvis")
            top = part["hipjoint"]
        add(part["hip"], top, hip, f"{side}_thigh")
        add(part["knee"], part["hip"], knee, f"{side}_shank")
        add(part["ankle"], part["knee"], ankle, f"{side}_foot")
        toe = part.get("toe", f"{part['ankle']}_end")
        add(toe, part["ankle"], ankle + _TOE, f"{side}_foot")
        if "toe" in part:
            add(f"{toe}_end", toe, ankle + _TOE_END, f"{side}_foot")
    for name, parent in source.extra:
        index = names.index(parent)
        add(name, parent, places[index] + 0.01, character.body_names[bodies[index]])

    offsets = np.array([
        np.zeros(3) if p < 0 else places[i] - places[p] for i, p in enumerate(parents)
    ])  # fmt: skip
    root = motion.root_positions * (thigh + shank) / 2.0 * source.scale
    skeleton = SkeletonMotion(
        tuple(names), np.array(parents), offsets * source.scale, root,
        states.quaternions[:, bodies], motion.fps, motion.name,
    )  # fmt: skip
    return skeleton.with_rest(_rest(source, skeleton))


def _rest(source: Source, skeleton: SkeletonMotion) -> FloatArray:
    """How each joint is turned, away from standing with hanging arms, in the source's rest pose."""
    turns = rotations.identity(len(skeleton.names))
    if source.rest in ("t", "a", "lying", "turned"):
        angle = np.pi / 4.0 if source.rest == "a" else np.pi / 2.0
        for side, sign in (("left", 1.0), ("right", -1.0)):
            for joint in ("shoulder", "elbow", "wrist"):
                index = skeleton.names.index(source.limb(joint, side))
                turns[index] = rotations.about_axis((1.0, 0.0, 0.0), sign * angle)
    if source.rest == "lying":
        turns = rotations.multiply(rotations.about_axis((0.0, 1.0, 0.0), -np.pi / 2.0), turns)
    if source.rest == "turned":
        turns = rotations.multiply(rotations.from_yaw(-np.pi / 2.0), turns)
    if source.rest in ("along", "mirrored"):
        rng = np.random.default_rng(7)
        # The last child that is no helper: the spine, not the hip joints.
        children = {int(p): i for i, p in reversed(list(enumerate(skeleton.parents)))}
        for joint in range(len(turns)):
            bone = skeleton.offsets[children[joint]] if joint in children else np.array([0, 0, 1.0])
            right = source.rest == "mirrored" and source.sides[1] in skeleton.names[joint]
            target = np.array([0.0, -1.0 if right else 1.0, 0.0])
            turns[joint] = rotations.multiply(
                rotations.about_axis(target, rng.uniform(-np.pi, np.pi)),
                rotations.between_vectors(bone, target),
            )
    return turns


def write_source(source: Source, skeleton: SkeletonMotion, path: Path) -> Path:
    """Write a skeleton's motion as a BVH file with the source's axes, unit and angles."""
    axes = _FILE_AXES[source.up]
    parents = skeleton.parents
    local = skeleton.rotations.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            back = rotations.conjugate(skeleton.rotations[:, parent])
            local[:, joint] = rotations.multiply(back, skeleton.rotations[:, joint])
    local = local[:, :, [0, *(1 + axis for axis in axes)]]
    offsets = skeleton.offsets[:, axes] / source.unit
    children = [np.flatnonzero(parents == joint).tolist() for joint in range(len(parents))]
    lines = ["HIERARCHY"]
    order: list[int] = []

    def write(joint: int, depth: int) -> None:
        tab = "\t" * depth
        ends = skeleton.names[joint].endswith("_end") and not children[joint]
        kind = "End Site" if ends else ("JOINT " if depth else "ROOT ") + skeleton.names[joint]
        lines.extend([f"{tab}{kind}", tab + "{"])
        lines.append(f"{tab}\tOFFSET " + " ".join(f"{x:.6f}" for x in offsets[joint]))
        if not ends:
            order.append(joint)
            moves = "" if depth else "Xposition Yposition Zposition "
            angles = " ".join(f"{axis}rotation" for axis in source.order)
            lines.append(f"{tab}\tCHANNELS {3 if depth else 6} {moves}{angles}")
        for child in children[joint]:
            write(child, depth + 1)
        if not children[joint] and not ends:
            lines.extend([f"{tab}\tEnd Site", tab + "\t{", tab + "\t\tOFFSET 0 0 0", tab + "\t}"])
        lines.append(tab + "}")

    write(0, 0)
    lines += ["MOTION", f"Frames: {skeleton.frames}", f"Frame Time: {1.0 / skeleton.fps:.7f}"]
    columns = [skeleton.root_positions[:, axes] / source.unit]
    for joint in order:
        turn = Rotation.from_quat(local[:, joint], scalar_first=True)
        columns.append(turn.as_euler(source.order, degrees=True))
    table = np.concatenate(columns, axis=1)
    lines += [" ".join(f"{x:.5f}" for x in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
    return path


def _names(pattern: str) -> dict[str, str]:
    """Limb joints from "joint=name ..."."""
    return dict(item.split("=") for item in pattern.split())


def _middle(text: str) -> tuple[str, ...]:
    return tuple(text.split())


SOURCES = {
    "cmu in bvh": Source(
        _middle("Hips LowerBack Spine Spine1 Neck1 Head"),
        _names(
            "collar={}Shoulder shoulder={}Arm elbow={}ForeArm wrist={}Hand hipjoint={}HipJoint "
            "hip={}UpLeg knee={}Leg ankle={}Foot toe={}ToeBase"
        ),
        unit=0.056444, sizes=(0.95, 1.02, 1.05, 0.97),
    ),
    "mixamo": Source(
        _middle(
            "mixamorig:Hips mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2 mixamorig:Neck "
            "mixamorig:Head"
        ),
        _names(
            "collar=mixamorig:{}Shoulder shoulder=mixamorig:{}Arm elbow=mixamorig:{}ForeArm "
            "wrist=mixamorig:{}Hand hip=mixamorig:{}UpLeg knee=mixamorig:{}Leg "
            "ankle=mixamorig:{}Foot toe=mixamorig:{}ToeBase"
        ),
        order="XYZ", sizes=(1.03, 0.98, 1.0, 1.0),
        extra=(("mixamorig:LeftHandThumb1", "mixamorig:LeftHand"),
               ("mixamorig:LeftEye", "mixamorig:Head")),
    ),
    "lafan1": Source(
        _middle("Hips Spine Spine1 Spine2 Neck Head"),
        _names(
            "collar={}Shoulder shoulder={}Arm elbow={}ForeArm wrist={}Hand hip={}UpLeg knee={}Leg "
            "ankle={}Foot toe={}Toe"
        ),
        rest="along", order="ZYX",
    ),
    "100style": Source(
        _middle("Hips Chest Chest2 Chest3 Chest4 Neck Head"),
        _names(
            "collar={}Collar shoulder={}Shoulder elbow={}Elbow wrist={}Wrist hip={}Hip knee={}Knee "
            "ankle={}Ankle toe={}Toe"
        ),
        order="YXZ",
    ),
    "smpl": Source(
        _middle("Pelvis Spine1 Spine2 Spine3 Neck Head"),
        _names(
            "collar={}_Collar shoulder={}_Shoulder elbow={}_Elbow wrist={}_Wrist hip={}_Hip "
            "knee={}_Knee ankle={}_Ankle toe={}_Foot"
        ),
        sides=("L", "R"), unit=1.0, scale=1.08,
    ),
    "bandai namco": Source(
        _middle("Hips Spine Chest Neck Head"),
        _names(
            "collar=Shoulder_{} shoulder=UpperArm_{} elbow=LowerArm_{} wrist=Hand_{} "
            "hip=UpperLeg_{} knee=LowerLeg_{} ankle=Foot_{} toe=Toes_{}"
        ),
        sides=("L", "R"), rest="mirrored",
    ),
    "rokoko": Source(
        _middle("Hips Spine1 Spine2 Spine3 Spine4 Neck Head"),
        _names(
            "collar={}Shoulder shoulder={}Arm elbow={}ForeArm wrist={}Hand hip={}Thigh knee={}Shin "
            "ankle={}Foot toe={}Toe"
        ),
        rest="turned",
    ),
    "unity": Source(
        _middle("Hips Spine Chest UpperChest Neck Head"),
        _names(
            "collar={}Shoulder shoulder={}UpperArm elbow={}LowerArm wrist={}Hand hip={}UpperLeg "
            "knee={}LowerLeg ankle={}Foot toe={}Toes"
        ),
        unit=1.0, order="ZXY",
    ),
    "rigify": Source(
        _middle("spine spine.001 spine.002 spine.003 spine.004 spine.006"),
        _names(
            "collar=shoulder.{} shoulder=upper_arm.{} elbow=forearm.{} wrist=hand.{} hip=thigh.{} "
            "knee=shin.{} ankle=foot.{} toe=toe.{}"
        ),
        sides=("L", "R"), rest="a", up="z", unit=1.0, order="XYZ",
        extra=(("pelvis.L", "spine"), ("heel.02.L", "foot.L")),
    ),
    "biped": Source(
        _middle("Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Neck Bip01_Head"),
        _names(
            "collar=Bip01_{}_Clavicle shoulder=Bip01_{}_UpperArm elbow=Bip01_{}_Forearm "
            "wrist=Bip01_{}_Hand hip=Bip01_{}_Thigh knee=Bip01_{}_Calf ankle=Bip01_{}_Foot "
            "toe=Bip01_{}_Toe0"
        ),
        sides=("L", "R"), rest="a", unit=0.0254,
    ),
    "unreal": Source(
        _middle("pelvis spine_01 spine_02 spine_03 neck_01 head"),
        _names(
            "collar=clavicle_{} shoulder=upperarm_{} elbow=lowerarm_{} wrist=hand_{} hip=thigh_{} "
            "knee=calf_{} ankle=foot_{} toe=ball_{}"
        ),
        sides=("l", "r"), rest="lying", up="z",
        extra=(("thigh_twist_01_l", "thigh_l"), ("ik_foot_l", "pelvis"), ("ik_hand_l", "pelvis")),
    ),
    "vicon": Source(
        _middle("Solving:Hips Solving:Spine Solving:Spine1 Solving:Neck Solving:Head"),
        _names(
            "collar=Solving:{}Shoulder shoulder=Solving:{}Arm elbow=Solving:{}ForeArm "
            "wrist=Solving:{}Hand hip=Solving:{}UpLeg knee=Solving:{}Leg ankle=Solving:{}Foot "
            "toe=Solving:{}ToeBase"
        ),
        unit=0.001, up="z",
    ),
    "motive": Source(
        _middle("Hip Ab Chest Neck Head"),
        _names(
            "collar={}Shoulder shoulder={}UArm elbow={}FArm wrist={}Hand hip={}Thigh knee={}Shin "
            "ankle={}Foot toe={}Toe"
        ),
        sides=("L", "R"), unit=1.0,
    ),
    "poser": Source(
        _middle("hip abdomen chest neck head"),
        _names(
            "collar={}Collar shoulder={}Shldr elbow={}ForeArm wrist={}Hand hipjoint={}Buttock "
            "hip={}Thigh knee={}Shin ankle={}Foot"
        ),
        sides=("l", "r"), unit=0.0254,
    ),
    "vrm": Source(
        _middle("J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_Neck J_Bip_C_Head"),
        _names(
            "collar=J_Bip_{}_Shoulder shoulder=J_Bip_{}_UpperArm elbow=J_Bip_{}_LowerArm "
            "wrist=J_Bip_{}_Hand hip=J_Bip_{}_UpperLeg knee=J_Bip_{}_LowerLeg ankle=J_Bip_{}_Foot "
            "toe=J_Bip_{}_ToeBase"
        ),
        sides=("L", "R"), unit=1.0,
    ),
    "lower case, arms down": Source(
        _middle("model_hips model_spine model_neck model_head"),
        _names(
            "shoulder=model_{}arm elbow=model_{}forearm wrist=model_{}hand hip=model_{}upleg "
            "knee=model_{}leg ankle=model_{}foot"
        ),
        sides=("left", "right"), rest="down",
    ),
    "nameless": Source(
        _middle("joint0 joint1 joint2 joint3 joint4"),
        _names(
            "collar=joint1{}0 shoulder=joint1{}1 elbow=joint1{}2 wrist=joint1{}3 hip=joint2{}1 "
            "knee=joint2{}2 ankle=joint2{}3 toe=joint2{}4"
        ),
        sides=("A", "B"), rest="mirrored",
    ),
}  # fmt: skip
"""By name, rigs as each program makes them; the last says nothing by its names."""
