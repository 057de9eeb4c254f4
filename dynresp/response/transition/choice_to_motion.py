"""From a choice to its motion: the rest of the simulation, the blend, and the reaction after it."""

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

# Sine of the angle to the ground from which on the line from ankle to hip is that of a leg to stand
# on.
_STEEP = 0.5
# A foot whose stillest point goes faster is dragged on purpose: it is not held still [m/s].
_DRAGGED = 0.25


@dataclass(frozen=True)
class Ending:
    """What comes after the exit.

    Attributes:
        poses: (frames, 59) from the exit on: the blend, whose first pose is the simulated one,
            and the motion entered, to its end; feet that stand in the blend do not slide.
        left: (59,) where the simulation was one frame after the exit.
        joined: (59,) where the motion entered was one frame before the blend's end, lowered as it
            is at the end for feet to reach the ground.
    """

    poses: FloatArray
    left: FloatArray
    joined: FloatArray


def finish(
    simulation: Simulation, choices: Mapping[int, Choice], transition: TransitionConfig
) -> dict[int, Trace]:
    """Take simulations back and run them on until their blends end, tracking what was chosen.

    Args:
        simulation: Where they were looked ahead; all have been hit.
        choices: What was chosen for each.
        transition: With a second pass they are taken back to the contact, else to the exit.

    Returns:
        For each its whole trace.
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
        # As far as the servos read ahead.
        stop = exit_frame + length + simulation.read_ahead
        until = np.minimum(np.arange(back, stop), len(base) - 1)
        targets[i] = blended_targets(
            base[until], choice.motion.poses, choice.entry, lead, lead + length
        )
        frames[i] = back
        groups.setdefault(lead + length, []).append(i)
    for steps, rows in groups.items():
        traces = simulation.follow(
            rows, [frames[i] for i in rows], [targets[i] for i in rows], steps
        )
        final.update(zip(rows, traces, strict=True))
    return final


def ending(
    character: Character, config: ResponseConfig, simulated: FloatArray, choice: Choice
) -> Ending:
    """Blend a simulation onto what was chosen, and let that go on.

    Args:
        character: The character.
        config: Length of the blend, and how long a base motion is shown to go on.
        simulated: (blend + 1, 59) from the exit on.
        choice: What was chosen.
    """
    fps = choice.motion.fps
    length = config.transition.blend_frames(fps)
    left = len(choice.motion) - choice.entry
    if choice.name == CARRY_ON:
        left = min(left, length + 1 + round(config.carry_on_s * fps))
    # Where a motion ends before the blend does, its last pose holds.
    at = choice.entry + np.arange(max(left, length + 2))
    entered = choice.motion.poses[np.minimum(at, len(choice.motion) - 1)]
    placed = place_on(entered, 0, simulated[0])
    # Halfway between two poses that stand, legs can reach below the floor.
    blend = raise_above(character, blend_onto(simulated, placed[: length + 1]), fps)
    poses = np.concatenate([blend, placed[length + 1 :]])
    going_on = choice.name == CARRY_ON
    fitted = _fitted(character, fps, simulated, placed, poses, going_on)
    joined = placed[length - 1].copy()
    # The root may be lowered by now, and stay so for a while.
    joined[2] += fitted[length, 2] - placed[length, 2]
    return Ending(fitted, simulated[1], joined)


def _fitted(
    character: Character,
    fps: float,
    simulated: FloatArray,
    placed: FloatArray,
    poses: FloatArray,
    going_on: bool,
) -> FloatArray:
    """A blend, and what follows it, whose feet do not slide on account of the blend.

    Args:
        character: The character.
        fps: Frame rate [1/s].
        simulated: (blend + 1, 59) from the exit on.
        placed: (frames, 59) the motion entered, from the exit on.
        poses: (frames, 59) the blend of the two, and then the motion entered.
        going_on: Whether that goes on after the last frame, so that nothing may be corrected there.
    """
    length = len(simulated) - 1
    before, entered, blended = (_standing(character, x, fps) for x in (simulated, placed, poses))
    contacts = _stances(before, entered, blended, entered & ~_dragged(character, placed, fps))
    if going_on:
        contacts[-fading_frames(fps) :] = False
    source = np.concatenate([simulated[:1], placed[1:]])
    composed = ComposedMotion(poses, source, contacts, [1], fps, length / fps, fitted=poses[:1])
    # A leg that is bent may reach below the floor in one who falls.
    return raise_above(character, fit_feet(character, composed), fps)


def _stances(before: Flags, entered: Flags, blended: Flags, still: Flags) -> Flags:
    """When feet are to stand from the exit on (frames, 2).

    Args:
        before: Whether they stand in the simulation, from the exit to the blend's end.
        entered: Whether they stand in the motion entered.
        blended: Whether they stand in the blend of the two, and then in the motion entered.
        still: Whether they stand in the motion entered and are not dragged.
    """
    entered, blended = entered.copy(), blended.copy()
    entered[0] = blended[0] = before[0]
    # A foot that stands at the exit goes on standing for as long as either says so. One that does
    # not stands as soon as both do: the motion entered may have it on the ground where the
    # simulation still has it in the air.
    goes_on = np.logical_and.accumulate(entered) | np.logical_and.accumulate(blended)
    stances: Flags = goes_on | (entered & blended)
    # After the blend those that go on do so to their end. The recording's own are held as well:
    # else a correction that fades would drag them.
    length = len(before) - 1
    stances[length:] = np.logical_and.accumulate(stances[length:]) | still[length:]
    return stances


def _dragged(character: Character, poses: FloatArray, fps: float) -> Flags:
    """Which feet slide faster over the ground than any that is to stand (frames, 2)."""
    slides = foot_slides(character, character.kinematics(poses)) * fps > _DRAGGED
    beside = np.zeros((1, len(FEET)), dtype=bool)
    dragged: Flags = np.concatenate([slides, beside]) | np.concatenate([beside, slides])
    return dragged


def _standing(character: Character, poses: FloatArray, fps: float) -> Flags:
    """Which feet stand, and may carry, in poses (frames, 59): (frames, 2).

    The legs of one who has fallen do not carry.
    """
    states = character.kinematics(poses)
    steep = []
    for side in FEET:
        hip, ankle = (states.positions[:, character.body(f"{side}_{x}")] for x in ("thigh", "foot"))
        way = hip - ankle
        steep.append(way[:, 2] >= _STEEP * np.linalg.norm(way, axis=1))
    flags: Flags = foot_contacts(character, states, fps) & np.stack(steep, axis=1)
    return flags
