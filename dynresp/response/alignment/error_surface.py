"""Mismatches of a response's choice for all exits and entries (as Zordan et al. 2007, plate 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment import Aligner
from dynresp.response.look_ahead import base_poses
from dynresp.response.response import (
    CARRY_ON,
    CARRY_ON_SLACK_S,
    Response,
    ResponseConfig,
)
from dynresp.response.search.full_search_choice import entry_range
from dynresp.response.windows.windows import ReactionTrack
from dynresp.support.errors import MotionError


@dataclass(frozen=True)
class AlignmentSurface:
    """Mismatches (window errors) of what was chosen, for all exits and entries.

    Attributes:
        errors: (exits, entries) [m].
        exits_s: (exits,) after contact [s].
        entries_s: (entries,) time in the reaction's clip, or in the base motion [s].
    """

    errors: FloatArray
    exits_s: FloatArray
    entries_s: FloatArray


def alignment_surface(
    response: Response, character: Character, config: ResponseConfig
) -> AlignmentSurface:
    """Compute the mismatch at all exits and entries that the alignment could have taken.

    Args:
        response: A response with a choice.
        character: Its character.
        config: Its settings.

    Raises:
        MotionError: Nothing was chosen.
    """
    seen, entered, entry = response.look_ahead_states, response.entered_motion, response.entry
    if seen is None or entered is None or entry is None or response.choice is None:
        raise MotionError(
            "nothing was chosen, so there is nothing to align; expected a response to a hit"
        )
    assert response.contact_frame is not None
    window, fps = config.window, config.physics.fps
    if response.choice == CARRY_ON:
        # Where the base motion would be at each exit, and some frames before and after.
        slack = round(CARRY_ON_SLACK_S * fps)
        first = float(response.contact_frame + window.exit_frames[0] - slack)
        frames = len(window.exit_frames) + 2 * slack + window.window_frames - 1
        base_frames = response.contact_frame + window.exit_frames[0] - slack + np.arange(frames)
        poses = base_poses([entered], base_frames[None])[0]
        bounds = None
    else:
        first = entry - int(entry)
        poses = entered.poses
        bounds = entry_range(len(poses), config)
    states = character.kinematics(poses)
    track = ReactionTrack(response.choice, states.centers, states.quaternions, bounds)
    exits = np.array(window.exit_frames, np.float64)
    earliest, stop = track.entry_range or (0, len(poses) - window.window_frames + 1)
    entries = np.arange(earliest, stop, window.entry_step, dtype=np.float64)
    # The full search would compile a kernel for this that the response itself did not need.
    errors = Aligner([track], window).errors(
        seen.centers, seen.quaternions, response.choice, exits[:, None], entries
    )
    return AlignmentSurface(errors, exits / fps, (entries + first) / fps)
