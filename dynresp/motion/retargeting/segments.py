"""Which joint of a source skeleton moves which body of the character.

Names decide first, since nearly every source uses one of a few naming customs; where they mean
nothing, the skeleton's build decides. Trunk, head and toes, whose number of joints differs between
sources, follow from the tree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.motion import FEET
from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.retargeting.joint_names import LIMB_JOINTS, head_joint, limb_joints, words_of
from dynresp.motion.retargeting.joint_tree import children_of, find_limbs, longest_branch, reaches
from dynresp.support.errors import MotionError

_CHAINS = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
# Bones shorter than this [m] have no reliable direction.
_SHORTEST_BONE = 0.02
# The character's abdomen covers 25 to 62 % of the path from the hips to the base of the head
# (models/ragdoll.xml); the joint at its middle moves it.
_ABDOMEN_MIDDLE = 0.43


@dataclass(frozen=True)
class Segments:
    """Joint indices of a skeleton, by their place in the body.

    Attributes:
        pelvis: The joint from which both legs branch off.
        abdomen: The joint that moves the middle of the trunk, or None where the trunk has no
            joint there.
        chest: The joint from which both arms branch off, or the one below it if that is the neck.
        head: The joint that moves the head.
        limbs: For "left" and "right", the joints "hip", "knee", "ankle", "toe", "shoulder",
            "elbow" and "wrist"; "toe" is the ankle itself where nothing follows it.
    """

    pelvis: int
    abdomen: int | None
    chest: int
    head: int
    limbs: dict[str, dict[str, int]]


def find_segments(skeleton: SkeletonMotion) -> Segments:
    """Find the joints of a person's skeleton.

    Raises:
        MotionError: Some joint is missing; the message names the joints that the skeleton has.
    """
    try:
        limbs = _by_name(skeleton)
    except MotionError:
        found = find_limbs(skeleton)
        if found is None:
            raise
        limbs = _by_side(found)
    for limb in limbs.values():
        limb["toe"] = _toe(skeleton, limb["ankle"])
    pelvis = _common_ancestor(skeleton, limbs["left"]["hip"], limbs["right"]["hip"])
    fork = _common_ancestor(skeleton, limbs["left"]["shoulder"], limbs["right"]["shoulder"])
    chest = fork
    if "neck" in words_of(skeleton.names[fork]) and skeleton.parents[fork] >= 0:
        # Collar bones below the neck do not turn with it in a person.
        chest = int(skeleton.parents[fork])
    head = head_joint(skeleton.names)
    if head is None:
        head = _top(skeleton, fork, [limb["shoulder"] for limb in limbs.values()])
    return Segments(pelvis, _abdomen(skeleton, pelvis, chest, head), chest, head, limbs)


def _by_name(skeleton: SkeletonMotion) -> dict[str, dict[str, int]]:
    """The limbs' joints by their names.

    Raises:
        MotionError: A joint is missing, or is not below the right parent.
    """
    found = limb_joints(skeleton.names)
    children = children_of(skeleton.parents)
    for side in FEET:
        elbow = found.get((side, "elbow"))
        if elbow is not None and (side, "wrist") not in found and children[elbow]:
            found[side, "wrist"] = children[elbow][0]
        for joint, words in LIMB_JOINTS.items():
            if (side, joint) not in found:
                raise MotionError(
                    f"{skeleton.name!r}: no joint found for the {side} {joint}; looked for "
                    f"{', '.join(words)} with a side, and for limbs by their build, among: "
                    f"{', '.join(skeleton.names)}"
                )
    limbs = _by_side(found)
    for side, limb in limbs.items():
        _check_chain(skeleton, side, limb)
    return limbs


def _by_side(found: dict[tuple[str, str], int]) -> dict[str, dict[str, int]]:
    return {side: {joint: found[side, joint] for joint in LIMB_JOINTS} for side in FEET}


def _toe(skeleton: SkeletonMotion, ankle: int) -> int:
    """Where the foot points: the joint called toe, else the end that is farthest."""
    children = children_of(skeleton.parents)[ankle]
    named = [c for c in children if {"toe", "toes", "ball"} & set(words_of(skeleton.names[c]))]
    return max(
        named or children, key=lambda c: float(np.linalg.norm(skeleton.offsets[c])), default=ankle
    )


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
    rest = skeleton.rest_positions()
    for upper, lower in _CHAINS:
        a, b = limb[upper], limb[lower]
        if a not in _ancestors(skeleton.parents, b)[1:]:
            raise MotionError(
                f"{skeleton.name!r}: took {skeleton.names[a]!r} for the {side} {upper} and "
                f"{skeleton.names[b]!r} for the {lower}, but the second is not below the "
                "first"
            )
        length = float(np.linalg.norm(rest[b] - rest[a]))
        if length < _SHORTEST_BONE:
            raise MotionError(
                f"{skeleton.name!r}: the bone from {skeleton.names[a]!r} to {skeleton.names[b]!r} "
                f"is {length:.3f} m long, too short for the {side} {upper} to {lower} of a person"
            )


def _top(skeleton: SkeletonMotion, fork: int, shoulders: list[int]) -> int:
    """The last joint above the shoulders that something follows; the fork itself if none does."""
    children = children_of(skeleton.parents)
    reach = reaches(skeleton.parents, skeleton.offsets)
    arms = {joint for shoulder in shoulders for joint in _ancestors(skeleton.parents, shoulder)}
    rest = [child for child in children[fork] if child not in arms]
    if not rest:
        return fork
    chain = longest_branch(children, reach, max(rest, key=lambda child: float(reach[child])))
    return chain[-2] if len(chain) > 1 else chain[-1]


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
