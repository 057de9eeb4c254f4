"""From a choice to its motion: the rest of the simulation, the blend, and the reaction after it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.floor import raise_above
from dynresp.motion.rotations import FloatArray
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Trace
from dynresp.response.choice import Choice
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.transition import (
    TransitionConfig,
    blend_onto,
    blended_targets,
    place_on,
)


@dataclass(frozen=True)
class Ending:
    """What comes after the exit.

    Attributes:
        poses: (frames, 59) from the exit on: the blend, whose first pose is the simulated one,
            and the motion entered, to its end.
        left: (59,) where the simulation was one frame after the exit.
        joined: (59,) where the motion entered was one frame before the blend's end.
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
    return Ending(poses, simulated[1], placed[length - 1])
