"""Turns a choice into motion: the rest of the simulation, the blend, and what follows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.feet.foot_fitting import ComposedMotion, fading_frames, fit_feet
from dynresp.motion.feet.skating import foot_slides
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import FEET
from dynresp.motion.retargeting.floor import raise_above
from dynresp.motion.rotations import FloatArray
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Trace
from dynresp.response.choice import Choice
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.transition.transition import (
    TransitionConfig,
    blend_onto,
    blended_targets,
    place_on,
)

Flags: TypeAlias = npt.NDArray[np.bool_]

# A leg can carry if the line from ankle to hip rises from the ground by an angle with at least this
# sine (30 degrees).
_MIN_LEG_SINE = 0.5
# A foot whose stillest point moves faster than this [m/s] is dragged on purpose, so it is not held
# still.
_DRAG_SPEED = 0.25


@dataclass(frozen=True)
class MotionAfterExit:
    """The motion from the exit on.

    Attributes:
        poses: (frames, 59) the blend, whose first pose is the simulated one, and then the motion
            entered (the reaction, or the base motion) to its end. Feet that stand in the blend do
            not slide.
        simulated_after_exit: (59,) the simulated pose one frame after the exit.
        placed_before_end: (59,) the pose of the motion entered one frame before the blend's end.
            It is lowered as much as the pose at the end is for feet to reach the ground.
    """

    poses: FloatArray
    simulated_after_exit: FloatArray
    placed_before_end: FloatArray


def simulate_to_blend_end(
    simulation: Simulation, choices: Mapping[int, Choice], transition: TransitionConfig
) -> dict[int, Trace]:
    """Take simulations back and run them until their blends end; the servos track the choices.

    Args:
        simulation: The simulation that has looked ahead; all its characters have been hit.
        choices: The choice for each row of the simulation.
        transition: With `second_pass` the simulations go back to the contact, else to the exit.

    Returns:
        The whole trace of each row.
    """
    length = transition.blend_frames(simulation.fps)
    final: dict[int, Trace] = {}
    groups: dict[int, list[int]] = {}
    targets: dict[int, FloatArray] = {}
    frames: dict[int, int] = {}
    for i, choice in choices.items():
        contact = simulation.contact(i)
        assert contact is not None
        exit_frame = contact.frame + choice.exit
        back = contact.frame if transition.second_pass else exit_frame
        lead = exit_frame - back
        base = simulation.setups[i].base
        # Including the frames that the servos read ahead.
        stop = exit_frame + length + simulation.read_ahead
        base_frames = np.minimum(np.arange(back, stop), len(base) - 1)
        targets[i] = blended_targets(
            base[base_frames], choice.motion.poses, choice.entry, lead, lead + length
        )
        frames[i] = back
        groups.setdefault(lead + length, []).append(i)
    for steps, rows in groups.items():
        traces = simulation.follow(
            rows, [frames[i] for i in rows], [targets[i] for i in rows], steps
        )
        final.update(zip(rows, traces, strict=True))
    return final


def blend_into_choice(
    character: Character, config: ResponseConfig, simulated: FloatArray, choice: Choice
) -> MotionAfterExit:
    """Blend a simulation onto the motion that was chosen, and append the rest of that motion.

    Args:
        character: The character.
        config: Length of the blend, and how long the base motion goes on (`carry_on_s`).
        simulated: (blend + 1, 59) the simulated poses from the exit on.
        choice: The choice.
    """
    fps = choice.motion.fps
    length = config.transition.blend_frames(fps)
    count = len(choice.motion) - choice.entry
    if choice.name == CARRY_ON:
        count = min(count, length + 1 + round(config.carry_on_s * fps))
    # If a motion ends before the blend does, its last pose holds.
    frames = choice.entry + np.arange(max(count, length + 2))
    entered = choice.motion.poses[np.minimum(frames, len(choice.motion) - 1)]
    placed = place_on(entered, 0, simulated[0])
    # Between two standing poses legs can reach below the floor.
    blend = raise_above(character, blend_onto(simulated, placed[: length + 1]), fps)
    poses = np.concatenate([blend, placed[length + 1 :]])
    continues = choice.name == CARRY_ON
    fitted = _fit_feet(character, fps, simulated, placed, poses, continues)
    placed_before_end = placed[length - 1].copy()
    # Fitting the feet may have lowered the root at the blend's end, and keeps it so for a while.
    placed_before_end[2] += fitted[length, 2] - placed[length, 2]
    return MotionAfterExit(fitted, simulated[1], placed_before_end)


def _fit_feet(
    character: Character,
    fps: float,
    simulated: FloatArray,
    placed: FloatArray,
    poses: FloatArray,
    continues: bool,
) -> FloatArray:
    """Correct a blend and what follows it, so that the blend makes no foot slide.

    Args:
        character: The character.
        fps: Frame rate [1/s].
        simulated: (blend + 1, 59) the simulated poses from the exit on.
        placed: (frames, 59) the motion entered, placed, from the exit on.
        poses: (frames, 59) the blend of the two, and then the motion entered.
        continues: Whether the motion goes on after the last frame; then its last frames are not
            corrected.
    """
    length = len(simulated) - 1
    before, entered, blended = (
        _standing_feet(character, x, fps) for x in (simulated, placed, poses)
    )
    still = entered & ~_dragged_feet(character, placed, fps)
    contacts = _stances(before, entered, blended, still)
    if continues:
        contacts[-fading_frames(fps) :] = False
    source = np.concatenate([simulated[:1], placed[1:]])
    composed = ComposedMotion(poses, source, contacts, [1], fps, length / fps, fitted=poses[:1])
    # When a character falls, a bent leg may reach below the floor.
    return raise_above(character, fit_feet(character, composed), fps)


def _stances(before: Flags, entered: Flags, blended: Flags, still: Flags) -> Flags:
    """In which frames each foot must stand, from the exit on (frames, 2).

    Args:
        before: (blend + 1, 2) whether it stands in the simulation.
        entered: (frames, 2) whether it stands in the motion entered.
        blended: (frames, 2) whether it stands in the blend, and then in the motion entered.
        still: (frames, 2) whether it stands in the motion entered and is not dragged.
    """
    entered, blended = entered.copy(), blended.copy()
    entered[0] = blended[0] = before[0]
    # A foot that stands at the exit keeps standing as long as one of the two says so. A foot that
    # does not stand at the exit stands as soon as both say so: the motion entered may have it on
    # the ground while the simulation still has it in the air.
    goes_on = np.logical_and.accumulate(entered) | np.logical_and.accumulate(blended)
    stances: Flags = goes_on | (entered & blended)
    # After the blend such a stance lasts to its end. Stances of the recording are held, too;
    # otherwise a correction that fades out would drag those feet.
    length = len(before) - 1
    stances[length:] = np.logical_and.accumulate(stances[length:]) | still[length:]
    return stances


def _dragged_feet(character: Character, poses: FloatArray, fps: float) -> Flags:
    """Which feet slide over the ground faster than `_DRAG_SPEED` (frames, 2)."""
    slides = foot_slides(character, character.kinematics(poses)) * fps > _DRAG_SPEED
    none = np.zeros((1, len(FEET)), dtype=bool)
    dragged: Flags = np.concatenate([slides, none]) | np.concatenate([none, slides])
    return dragged


def _standing_feet(character: Character, poses: FloatArray, fps: float) -> Flags:
    """Which feet stand and can carry the body, in poses (frames, 59): (frames, 2).

    The legs of a character that has fallen cannot.
    """
    states = character.kinematics(poses)
    steep = []
    for side in FEET:
        hip, ankle = (states.positions[:, character.body(f"{side}_{x}")] for x in ("thigh", "foot"))
        leg = hip - ankle
        steep.append(leg[:, 2] >= _MIN_LEG_SINE * np.linalg.norm(leg, axis=1))
    flags: Flags = foot_contacts(character, states, fps) & np.stack(steep, axis=1)
    return flags
