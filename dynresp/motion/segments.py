"""Which joint of somebody else's skeleton moves which body of the character.

Names first, since nearly every source uses one of a few naming customs; the tree then settles
trunk and head, whose number of joints differs from source to source.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.errors import MotionError
from dynresp.motion.motion import FEET
from dynresp.motion.readers.skeleton import SkeletonMotion

# For each limb's joints, the names in use without their side, the surer first. "shoulder" is the
# upper arm in some sources and the collar bone in others, which then also have an "arm".
_LIMB_NAMES = {
    "hip": ("femur", "upleg", "upperleg", "thigh", "hip"),
    "knee": ("tibia", "shin", "calf", "shank", "lowerleg", "lowleg", "knee", "leg"),
    "ankle": ("ankle", "foot"),
    "shoulder": ("humerus", "upperarm", "uparm", "arm", "shoulder"),
    "elbow": ("radius", "forearm", "lowerarm", "lowarm", "elbow"),
    "wrist": ("wrist", "hand"),
}
_CHAINS = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
_HEAD_NAMES = ("head", "skull", "neck1", "neck")
# The part of the way from the hips to the base of the head that the character's abdomen covers
# ends at 62 % and begins at 25 % (models/ragdoll.xml); its middle tells the joint that moves it.
_ABDOMEN_MIDDLE = 0.43


@dataclass(frozen=True)
class Segments:
    """Joint indices of a skeleton, by their place in the body.

    Attributes:
        pelvis: The joint from which both legs branch off.
        abdomen: The joint that moves the middle of the trunk, or None where the trunk has no
            joint there.
        chest: The joint from which both arms branch off.
        head: The joint that moves the head.
        limbs: For "left" and "right", the joints "hip", "knee", "ankle", "toe", "shoulder",
            "elbow" and "wrist".
    """

    pelvis: int
    abdomen: int | None
    chest: int
    head: int
    limbs: dict[str, dict[str, int]]


def find_segments(skeleton: SkeletonMotion) -> Segments:
    """Find the joints of a person's skeleton.

    Raises:
        MotionError: Some joint is not there; the message names the joints that are.
    """
    plain = {_plain(name): i for i, name in reversed(list(enumerate(skeleton.names)))}
    limbs: dict[str, dict[str, int]] = {}
    for side in FEET:
        limbs[side] = {}
        for joint, names in _LIMB_NAMES.items():
            found = next((plain[s] for n in names for s in _sided(side, n) if s in plain), None)
            if found is None and joint == "wrist":
                found = _first_child(skeleton, limbs[side]["elbow"])
            if found is None:
                raise MotionError(
                    f"{skeleton.name!r}: no joint found for the {side} {joint}; looked for "
                    f"{', '.join(names)} with a side, among: {', '.join(skeleton.names)}"
                )
            limbs[side][joint] = found
        toe = _first_child(skeleton, limbs[side]["ankle"])
        limbs[side]["toe"] = limbs[side]["ankle"] if toe is None else toe
        _check_chain(skeleton, side, limbs[side])
    pelvis = _common_ancestor(skeleton, limbs["left"]["hip"], limbs["right"]["hip"])
    chest = _common_ancestor(skeleton, limbs["left"]["shoulder"], limbs["right"]["shoulder"])
    head = next((plain[n] for n in _HEAD_NAMES if n in plain), chest)
    return Segments(pelvis, _abdomen(skeleton, pelvis, chest, head), chest, head, limbs)


def _plain(name: str) -> str:
    """A name without prefix ("mixamorig:"), case, blanks and marks."""
    return re.sub(r"[^a-z0-9]", "", re.split(r"[:|]", name.lower())[-1])


def _sided(side: str, name: str) -> list[str]:
    letter = side[0]
    ends = (side, letter)
    return [f"{end}{name}" for end in ends] + [f"{name}{end}" for end in ends] + [
        f"bip01{letter}{name}", f"{letter}{name}1"]  # fmt: skip


def _first_child(skeleton: SkeletonMotion, joint: int) -> int | None:
    children = np.flatnonzero(skeleton.parents == joint)
    return int(children[0]) if len(children) else None


def _ancestors(parents: npt.NDArray[np.int64], joint: int) -> list[int]:
    """The joint, its parent, and so on up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(int(parents[chain[-1]]))
    return chain


def _common_ancestor(skeleton: SkeletonMotion, a: int, b: int) -> int:
    above = set(_ancestors(skeleton.parents, b))
    return next(joint for joint in _ancestors(skeleton.parents, a) if joint in above)


def _check_chain(skeleton: SkeletonMotion, side: str, limb: dict[str, int]) -> None:
    for upper, lower in _CHAINS:
        if limb[upper] not in _ancestors(skeleton.parents, limb[lower])[1:]:
            raise MotionError(
                f"{skeleton.name!r}: took {skeleton.names[limb[upper]]!r} for the {side} {upper} "
                f"and {skeleton.names[limb[lower]]!r} for the {lower}, but the second does not "
                "hang from the first"
            )


def _abdomen(skeleton: SkeletonMotion, pelvis: int, chest: int, head: int) -> int | None:
    """The trunk's joint whose bone covers the middle of the abdomen, if it has one."""
    chain = _ancestors(skeleton.parents, head)
    if pelvis not in chain or chest not in chain:
        return None
    chain = chain[: chain.index(pelvis) + 1][::-1]
    lengths = np.linalg.norm(skeleton.offsets[chain[1:]], axis=1)
    starts = np.concatenate([[0.0], np.cumsum(lengths)]) / max(float(lengths.sum()), 1e-9)
    trunk = chain[: chain.index(chest) + 1]
    below = [joint for joint, start in zip(trunk, starts, strict=False) if start <= _ABDOMEN_MIDDLE]
    return None if below[-1] == pelvis else below[-1]
