"""The landscape in which a response was aligned (Zordan et al. 2007, colour plate 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.response.look_ahead import base_poses
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.search.full_search import search
from dynresp.response.search.full_search_choice import entry_range
from dynresp.response.windows.windows import ReactionTrack, library_windows, trace_windows
from dynresp.support.errors import MotionError


@dataclass(frozen=True)
class AlignmentSurface:
    """Window errors of what was chosen, for all exits and entries.

    Attributes:
        errors: (exits, entries) [m].
        exits_s: (exits,) after contact [s].
        entries_s: (entries,) in the reaction's clip, or in the base motion [s].
    """

    errors: npt.NDArray[np.float32]
    exits_s: FloatArray
    entries_s: FloatArray


def alignment_surface(
    response: Response, character: Character, config: ResponseConfig
) -> AlignmentSurface:
    """Search everything that the choice of a response could have been aligned to.

    Args:
        response: It; one with a choice.
        character: Its character.
        config: Its settings.

    Raises:
        MotionError: Nothing was chosen.
    """
    seen, entered, entry = response.look_ahead_states, response.entered_motion, response.entry
    if seen is None or entered is None or entry is None or response.choice is None:
        raise MotionError("nothing was chosen, so there is nothing to align")
    assert response.contact_frame is not None
    window, fps = config.window, config.physics.fps
    if response.choice == CARRY_ON:
        # By the clock, and somewhat before and after.
        slack = round(config.carry_on_slack_s * fps)
        first = float(response.contact_frame + window.exit_frames[0] - slack)
        frames = len(window.exit_frames) + 2 * slack + window.window_frames - 1
        near = response.contact_frame + window.exit_frames[0] - slack + np.arange(frames)
        poses = base_poses([entered], near[None])[0]
        bounds = None
    else:
        first = entry - int(entry)
        poses = entered.poses
        bounds = entry_range(len(poses), config)
    states = character.kinematics(poses)
    track = ReactionTrack(response.choice, states.centers, states.quaternions, bounds)
    cut = trace_windows(seen.centers, seen.quaternions, window)
    found = search(cut, library_windows([track], window)).surface(response.choice)
    entries_s = np.asarray((found.entry_frames + first) / fps, np.float64)
    return AlignmentSurface(
        found.errors, np.asarray(found.exit_frames / fps, np.float64), entries_s
    )
