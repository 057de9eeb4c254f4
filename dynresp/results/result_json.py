"""What `result.json` says about one response.

Times count from the start of `motion.npz` unless their name says otherwise. Nothing in it depends
on when or where it was made, so that the same experiment gives the same bytes.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from dynresp import __version__
from dynresp.experiments.drawn_hits import Hit
from dynresp.experiments.response_story import Shown
from dynresp.response.response import CARRY_ON, Response
from dynresp.response.response_quality import Quality
from dynresp.support.errors import DynrespError
from dynresp.support.files import replacing

_DIGITS = 6

OUTCOMES = ("reaction", "carry on", "miss", "diverged")
"""What can come of a hit: a recorded reaction takes over, the base motion is carried on, nothing
was hit, or the simulation blew up."""


def outcome(response: Response) -> str:
    """One of `OUTCOMES`."""
    if response.diverged is not None:
        return "diverged"
    if response.contact is None:
        return "miss"
    return "carry on" if response.choice == CARRY_ON else "reaction"


def versions() -> dict[str, str]:
    """Versions of what computes a response."""
    return {
        "dynresp": __version__,
        "mujoco": str(mujoco.__version__),
        "numpy": str(np.__version__),
    }


def happened(response: Response, shown: Shown) -> dict[str, Any]:
    """What came of a hit: contact, choice, alignment, errors."""
    fps = response.motion.fps
    said: dict[str, Any] = {"outcome": outcome(response)}
    if response.contact is not None:
        contact = response.contact
        said["contact"] = {
            "time_s": (response.start - shown.first) / fps + contact.time_s,
            "body": contact.body,
            "force_n": contact.force,
            "point_m": list(contact.point),
        }
    if response.diverged is not None:
        frame = response.start + response.diverged.frame - shown.first
        said["diverged"] = {"time_s": frame / fps, "warning": response.diverged.warning}
    if response.exit is None or response.end is None or response.contact_frame is None:
        return said
    said["speed_change_m_s"] = response.speed_change
    said["graze"] = response.graze
    said["choice"] = response.choice
    said["error_m"] = response.error
    said["alignment"] = {
        "exit_after_contact_s": (response.exit - response.contact_frame) / fps,
        "exit_frame": response.exit - shown.first,
        "exit_time_s": (response.exit - shown.first) / fps,
        "blend_end_frame": response.end - shown.first,
        "blend_end_time_s": (response.end - shown.first) / fps,
        "entry_frame": response.entry,
        "entry_time_in_clip_s": (response.entry or 0) / fps,
    }
    ranked = sorted(response.errors.items(), key=lambda item: (item[1], item[0]))
    said["errors_m"] = dict(ranked)
    return said


def describe(hit: Hit, response: Response, quality: Quality | None, shown: Shown) -> dict[str, Any]:
    """The part of `result.json` that is about one hit."""
    motion = shown.story.motion
    return {
        "hit": hit.number,
        "impact": hit.asked,
        "happened": happened(response, shown),
        "quality": None if quality is None else asdict(quality),
        "motion": {
            "frames": len(motion),
            "fps": motion.fps,
            "duration_s": motion.duration,
            "starts_in_base_at_s": shown.first / motion.fps,
        },
    }


def write_json(content: dict[str, Any], path: Path) -> None:
    """Write an object as JSON, whole or not at all.

    Raises:
        DynrespError: The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(to_json(content) + "\n", encoding="utf-8")


def to_json(content: dict[str, Any]) -> str:
    """An object as JSON: floats to six decimals, null for those that are not finite."""
    text = json.dumps(_plain(content), indent=2, allow_nan=False, ensure_ascii=False)
    # Names of files need not be UTF-8, which JSON is.
    return text.encode(errors="replace").decode()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    raise DynrespError(f"a {type(value).__name__} has no place in a result: {value!r}")
