"""Facts about a motion and the file that it comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import default_character
from dynresp.motion.ground import clearances
from dynresp.motion.load import LoadOptions
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.readers import read_motion_file
from dynresp.motion.retargeting.retarget import t_pose_frames
from dynresp.motion.retargeting.segments import find_segments
from dynresp.support.runs import runs


def motion_facts(motion: Motion, file: Path | None, options: LoadOptions) -> dict[str, Any]:
    """Facts about a motion.

    Args:
        motion: As retargeted to the character.
        file: Its file; None for a built-in motion.
        options: With which the file was read.

    Returns:
        A dictionary that `json` can write. Lengths in metres; `file` is None for a built-in motion
        and for dynresp's own format.
    """
    character = default_character()
    states = character.kinematics(motion.poses)
    lowest = clearances(character, states).min(axis=0)
    feet = [character.body(f"{side}_foot") for side in FEET]
    root = motion.root_positions
    distance = float(np.linalg.norm(np.diff(root[:, :2], axis=0), axis=1).sum())
    return {
        "name": motion.name,
        "frames": len(motion),
        "fps": motion.fps,
        "duration_s": motion.duration,
        "file": _file_facts(file, options),
        "distance_m": distance,
        "pelvis_height_m": [float(root[:, 2].min()), float(root[:, 2].max())],
        "standing": [float(share) for share in motion.contacts.mean(axis=0)],
        "t_poses_s": _ranges(t_pose_frames(character, motion), motion.fps),
        "lowest_foot_m": float(lowest[feet].min()),
        "lowest_body_m": float(np.delete(lowest, feet).min()),
        "labels": [[label.name, label.start, label.stop] for label in motion.labels],
    }


def _file_facts(file: Path | None, options: LoadOptions) -> dict[str, Any] | None:
    """Joints, unit, up axis and leg length of a file; None for dynresp's own format."""
    if file is None or file.suffix.lower() == ".npz":
        return None
    found = read_motion_file(
        file, asf_path=options.asf, unit=options.unit, up=options.up, fps=options.fps
    )
    limb = find_segments(found).limbs["left"]
    rest = found.rest_positions()
    leg = sum(
        float(np.linalg.norm(rest[limb[a]] - rest[limb[b]]))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    return {"joints": len(found.names), "unit_m": found.unit_m, "up": found.up, "leg_m": leg}


def _ranges(flags: npt.NDArray[np.bool_], fps: float) -> list[list[float]]:
    """Spans of time [s] in which a flag is set, from its first frame to its last one's end."""
    return [[start / fps, stop / fps] for start, stop in runs(flags)]
