"""What `result.json` says about one response.

Times count from the start of `motion.npz` unless their name says otherwise. Nothing in it depends
on when or where it was made, so that the same experiment gives the same bytes.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from dynresp.experiments.response_story import ResponseStory
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.drawn_hits import Hit
from dynresp.response.response import CARRY_ON, Response
from dynresp.response.response_quality import Quality

OUTCOMES = ("reaction", "carry on", "miss", "diverged")
"""What can come of a hit: a recorded reaction takes over, the base motion goes on (no reaction),
nothing was hit, or the simulation diverged."""


def outcome(response: Response) -> str:
    """One of `OUTCOMES`."""
    if response.diverged is not None:
        return "diverged"
    if response.contact is None:
        return "miss"
    return "carry on" if response.choice == CARRY_ON else "reaction"


def describe_response(
    response: Response, shown: ResponseStory, library: ReactionLibrary
) -> dict[str, Any]:
    """What came of a hit: contact, choice, alignment, mismatches.

    Args:
        response: The response.
        shown: What `motion.npz` shows of it.
        library: The reactions that were compared.
    """
    fps = response.motion.fps
    record: dict[str, Any] = {"outcome": outcome(response)}
    if response.contact is not None:
        contact = response.contact
        record["contact"] = {
            "time_s": (response.start - shown.first) / fps + contact.time_s,
            "body": contact.body,
            "force_n": contact.force,
            "point_m": list(contact.point),
        }
    if response.diverged is not None:
        frame = response.start + response.diverged.frame - shown.first
        record["diverged"] = {"time_s": frame / fps, "warning": response.diverged.warning}
    if response.exit is None or response.end is None or response.contact_frame is None:
        return record
    record["speed_change_m_s"] = response.speed_change
    record["graze"] = response.graze
    record["choice"] = response.choice
    record["error_m"] = response.error
    record["alignment"] = {
        "exit_after_contact_s": (response.exit - response.contact_frame) / fps,
        "exit_frame": response.exit - shown.first,
        "exit_time_s": (response.exit - shown.first) / fps,
        "blend_end_frame": response.end - shown.first,
        "blend_end_time_s": (response.end - shown.first) / fps,
        "entry_frame": response.entry,
        "entry_time_in_clip_s": (response.entry or 0) / fps,
    }
    clip = next((item for item in library.reactions if item.name == response.choice), None)
    if clip is not None and not clip.builtin:
        in_file = clip.start_s + (response.entry or 0) / fps
        record["alignment"]["entry_time_in_file_s"] = in_file
    ranked = sorted(response.errors.items(), key=lambda item: (item[1], item[0]))
    record["errors_m"] = dict(ranked)
    return record


def describe(
    hit: Hit,
    response: Response,
    quality: Quality | None,
    shown: ResponseStory,
    library: ReactionLibrary,
) -> dict[str, Any]:
    """The part of `result.json` about one hit."""
    motion = shown.story.motion
    return {
        "hit": hit.number,
        "impact": hit.values,
        "happened": describe_response(response, shown, library),
        "quality": None if quality is None else asdict(quality),
        "motion": {
            "frames": len(motion),
            "fps": motion.fps,
            "duration_s": motion.duration,
            "starts_in_base_at_s": shown.first / motion.fps,
        },
    }
