"""Limb, side and joint from the names of a skeleton's joints.

Every program has its own custom (LeftUpLeg, thigh.L, L_Hip, lThigh, UpperLeg_L, Bip01 L Thigh,
lfemur, mixamorig:LeftUpLeg), but all of them put a word for the side beside one of few words for
the joint. Names are split into words, and those are looked up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from dynresp.motion.motion import FEET

LIMB_JOINTS = {
    "hip": ("femur", "upleg", "upperleg", "legupper", "thigh", "hip"),
    "knee": ("tibia", "shin", "calf", "shank", "lowerleg", "lowleg", "leglower", "knee", "leg"),
    "ankle": ("ankle", "talocrural", "foot"),
    "shoulder": (
        *("humerus", "upperarm", "uparm", "uarm", "armupper", "shldr", "arm"),
        *("glenohumeral", "shoulder"),
    ),
    "elbow": ("radius", "forearm", "lowerarm", "lowarm", "farm", "armlower", "elbow"),
    "wrist": ("wrist", "radiocarpal", "hand"),
}
"""For each joint of a limb the words in use for it, the most certain first: "shoulder" is the
upper arm in some sources and the collar bone in others, which then have an "arm" as well."""

HEAD = ("head", "skull", "skullbase", "neck")
"""Words for the joint that moves the head, the most certain first."""

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")
_SIDES = {**{side: side for side in FEET}, **{side[0]: side for side in FEET}}
# What may follow the joint's word and means nothing: numbers, and these.
_TAIL = {"bend", "bone", "joint", "jnt"}
_PARTS = {
    word: (joint, rank)
    for joint, words in LIMB_JOINTS.items()
    for rank, word in enumerate(words)
}  # fmt: skip
# Side and joint in one word, as in lfemur, leftarm, LUArm or handl.
_SIDED_PARTS = {
    joined: (side, word)
    for short, side in _SIDES.items()
    for word in _PARTS
    for joined in (short + word, word + short)
}


def words_of(name: str) -> list[str]:
    """The words of a joint's name in lower case, without a namespace ("mixamorig:")."""
    return [word.lower() for word in _WORDS.findall(re.split(r"[:|]", name)[-1])]


def limb_joints(names: Sequence[str]) -> dict[tuple[str, str], int]:
    """Which joint each name means.

    Args:
        names: Names of all joints, parents before children.

    Returns:
        Index for each (side, joint) that some name means, such as ("left", "knee"). Of several
        names that mean the same the one with the most certain word, then the one with the fewest
        other words, then the first.
    """
    found: dict[tuple[str, str], tuple[int, int, int]] = {}
    for index, name in enumerate(names):
        meaning = _meaning(words_of(name))
        if meaning is not None:
            side, word, others = meaning
            joint, rank = _PARTS[word]
            best = found.get((side, joint))
            found[side, joint] = min((rank, others, index), best or (rank, others, index))
    return {key: index for key, (_, _, index) in found.items()}


def head_joint(names: Sequence[str]) -> int | None:
    """The joint that moves the head, by its name."""
    ends = {i: _untailed(words_of(name)) for i, name in enumerate(names)}
    for word in HEAD:
        for index, words in ends.items():
            if any("".join(words[start:]) == word for start in range(len(words))):
                return index
    return None


def _untailed(words: list[str]) -> list[str]:
    while words and (words[-1].isdigit() or words[-1] in _TAIL):
        words = words[:-1]
    return words


def _meaning(words: list[str]) -> tuple[str, str, int] | None:
    """Side, word for the joint, and how many other words a name has; None if it is of no limb.

    The joint's words end the name but for the side, so that joints below it (LeftHandThumb1,
    thigh_twist_01_l, LeftFoot_end) do not count as it.
    """
    marks = [i for i, word in enumerate(words) if word in _SIDES]
    if len(marks) == 1:
        rest = _untailed(words[: marks[0]] + words[marks[0] + 1 :])
        for start in range(len(rest)):
            word = "".join(rest[start:])
            if word in _PARTS:
                return _SIDES[words[marks[0]]], word, start
        return None
    rest = _untailed(words)
    for start in range(len(rest)):
        joined = "".join(rest[start:])
        if joined in _SIDED_PARTS:
            return (*_SIDED_PARTS[joined], start)
    return None
