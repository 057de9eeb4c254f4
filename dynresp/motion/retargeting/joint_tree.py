"""Limbs of a skeleton whose joints' names mean nothing: from its branches and bone lengths.

A limb is a branch with an equal one on the other side; its two longest consecutive bones are thigh
and shank, or upper arm and forearm. People's legs are longer than their arms, their feet point
forward, and with forward known, left and right are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.readers.skeleton import SkeletonMotion
from dynresp.motion.rotations import FloatArray

# Two limbs are a pair if their bones differ by no more than this part.
_ALIKE = 0.12
# Shortest thigh with shank, or upper arm with forearm [m]: no finger, and no toddler's arm.
_SHORTEST = 0.2
# A foot whose toes are nearer to the ankle than this [m], seen from above, does not say where
# forward is.
_FOOT = 0.03
_SAMPLES = 200


@dataclass(frozen=True)
class _Limb:
    """Joints at the ends of a limb's two long bones, and their lengths [m]."""

    joints: tuple[int, int, int]
    tip: int
    lengths: tuple[float, float]


def children_of(parents: npt.NDArray[np.int64]) -> list[list[int]]:
    """For each joint its child joints."""
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    return children


def reaches(parents: npt.NDArray[np.int64], offsets: FloatArray) -> FloatArray:
    """From each joint the longest path along bones to an end, its own bone included, (joints,)."""
    lengths = np.linalg.norm(offsets, axis=1)
    below = np.zeros(len(parents))
    for joint in range(len(parents) - 1, 0, -1):
        parent = parents[joint]
        below[parent] = max(below[parent], lengths[joint] + below[joint])
    return np.asarray(below + lengths)


def longest_branch(children: list[list[int]], reach: FloatArray, joint: int) -> list[int]:
    """The joint and those after it on the longest path to an end."""
    chain = [joint]
    while children[chain[-1]]:
        chain.append(max(children[chain[-1]], key=lambda child: float(reach[child])))
    return chain


def find_limbs(skeleton: SkeletonMotion) -> dict[tuple[str, str], int] | None:
    """Find both arms and legs without looking at names.

    Returns:
        Index for each (side, joint) with the joints hip, knee, ankle, shoulder, elbow and wrist;
        None if the skeleton does not have two pairs of limbs, or left and right are not clear.
    """
    pairs = sorted(_pairs(skeleton), key=lambda pair: -sum(pair[0].lengths))
    if not pairs:
        return None
    legs, others = pairs[0], pairs[1:]
    in_legs = {joint for leg in legs for joint in leg.joints}
    arms = next((pair for pair in others if not in_legs & {*pair[0].joints, *pair[1].joints}), None)
    if arms is None:
        return None
    frames = np.linspace(0, skeleton.frames - 1, min(_SAMPLES, skeleton.frames)).astype(int)
    points = skeleton.joint_positions()[frames]
    across = points[:, legs[0].joints[0]] - points[:, legs[1].joints[0]]
    forward = _forward(points, legs)
    # How far the first leg is to the left of the second, summed over the frames.
    leftness = float(np.sum(forward[:, 0] * across[:, 1] - forward[:, 1] * across[:, 0]))
    shoulders = points[:, arms[0].joints[0]] - points[:, arms[1].joints[0]]
    same_side = float(np.sum(shoulders * across))
    if abs(leftness) < 1e-6 or abs(same_side) < 1e-6:
        return None
    if leftness < 0.0:
        legs = (legs[1], legs[0])
    if (leftness < 0.0) != (same_side < 0.0):
        arms = (arms[1], arms[0])
    limbs: dict[tuple[str, str], int] = {}
    for side, leg, arm in zip(("left", "right"), legs, arms, strict=True):
        limbs |= {(side, j): i for j, i in zip(("hip", "knee", "ankle"), leg.joints, strict=True)}
        limbs |= {
            (side, j): i for j, i in zip(("shoulder", "elbow", "wrist"), arm.joints, strict=True)
        }
    return limbs


def _pairs(skeleton: SkeletonMotion) -> list[tuple[_Limb, _Limb]]:
    """All pairs of like limbs that branch off one joint."""
    children = children_of(skeleton.parents)
    reach = reaches(skeleton.parents, skeleton.offsets)
    pairs = []
    for branches in children:
        limbs = [_limb(skeleton, longest_branch(children, reach, joint)) for joint in branches]
        for i, a in enumerate(limbs):
            for b in limbs[i + 1 :]:
                if a is not None and b is not None and _alike(a, b):
                    pairs.append((a, b))
    return pairs


def _limb(skeleton: SkeletonMotion, chain: list[int]) -> _Limb | None:
    """The limb of a chain of joints, if it is long enough for one."""
    lengths = np.linalg.norm(skeleton.offsets[chain[1:]], axis=1)
    if len(lengths) < 2:
        return None
    first = int(np.argmax(lengths[:-1] + lengths[1:]))
    two = (float(lengths[first]), float(lengths[first + 1]))
    if sum(two) < _SHORTEST or min(two) < 0.3 * max(two):
        return None
    a, b, c = chain[first : first + 3]
    return _Limb((a, b, c), chain[min(first + 3, len(chain) - 1)], two)


def _alike(a: _Limb, b: _Limb) -> bool:
    return all(abs(x - y) <= _ALIKE * max(x, y) for x, y in zip(a.lengths, b.lengths, strict=True))


def _forward(points: FloatArray, legs: tuple[_Limb, _Limb]) -> FloatArray:
    """Direction of the feet, or of the knees without toes, on the ground, (frames, 2) [m]."""
    toes = [(points[:, leg.tip] - points[:, leg.joints[2]])[:, :2] for leg in legs]
    forward = np.sum(toes, axis=0)
    if np.median(np.linalg.norm(forward, axis=1)) > 2.0 * _FOOT:
        return np.asarray(forward)
    knees = [
        points[:, knee] - 0.5 * (points[:, hip] + points[:, ankle])
        for hip, knee, ankle in (leg.joints for leg in legs)
    ]
    return np.asarray(np.sum(knees, axis=0)[:, :2])
