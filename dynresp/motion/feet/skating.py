"""How far standing feet slide over the ground.

A foot stands on the corners of its sole that touch, and on all points between them. From one frame
to the next it slides as far as that one of these points that moves least. A foot that rolls over
its heel or its ball does not slide, and one that pivots on its sole does not, either: the point
about which it turns stays.
"""

from __future__ import annotations

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.ground import sole_points
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.runs import runs

TOUCH = 0.005
"""A corner touches that is at most this much higher than the sole's lowest [m]: shoes are soft, and
measurements not exact."""


def foot_slides(character: Character, states: BodyStates) -> FloatArray:
    """How far each foot slides from each frame to the next, if it stands.

    Args:
        character: The character.
        states: Its bodies over some frames.

    Returns:
        (frames - 1, 2) [m]: left, right.
    """
    from dynresp.motion.feet.skating_kernel import slides_kernel

    columns = []
    for side in FEET:
        foot = character.body(f"{side}_foot")
        corners = states.positions[:, foot, None] + rotations.rotate(
            states.quaternions[:, foot, None], sole_points(character, side)
        )
        columns.append(slides_kernel(corners, TOUCH))
    return np.stack(columns, axis=1)


def stance_slides(motion: Motion, character: Character) -> list[float]:
    """How far each foot slides in each of its stances [m].

    Summed over the steps between frames in both of which the foot stands (`motion.contacts`); first
    the left foot's stances, then the right one's. A single frame is not a stance.
    """
    slides = foot_slides(character, character.kinematics(motion.poses))
    sums: list[float] = []
    for slide, contact in zip(slides.T, motion.contacts.T, strict=True):
        standing = contact[:-1] & contact[1:]
        sums += [float(slide[start:stop].sum()) for start, stop in runs(standing)]
    return sums
