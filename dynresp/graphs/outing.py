"""An avatar's way through a graph, written for people to see and for programs to go on with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.experiments.folder import RESULT, WRITTEN, clear_response
from dynresp.experiments.result import versions, write_json
from dynresp.experiments.story_files import Progress, Writer, story_writers, write_files
from dynresp.graphs.worlds import standing_about
from dynresp.locomotion.composing import Composition
from dynresp.locomotion.graph import MotionGraph
from dynresp.locomotion.graph_file import graph_identity
from dynresp.motion.builtin import PREFIX
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.skating import foot_skates
from dynresp.response.quality import joint_speed_steps
from dynresp.view.story import Block, GroundPath, Story

PLAN = "plan.png"
FILES = ("motion.npz", "motion.bvh", "recording.html", "filmstrip.png", PLAN, "video.mp4")
"""What is written of an outing besides `result.json`."""

_VIDEO_PX, _VIDEO_FPS = (640, 480), 30.0


@dataclass(frozen=True)
class Outing:
    """What an avatar did.

    Attributes:
        title: First line of the pictures.
        subtitle: Second line.
        composition: Its motion.
        blocks: What stood about.
        paths: What was drawn on the ground.
        about: Further content of `result.json`.
        writers: What writes further files, by name.
    """

    title: str
    subtitle: str
    composition: Composition
    blocks: Sequence[Block] = ()
    paths: Sequence[GroundPath] = ()
    about: dict[str, Any] | None = None
    writers: dict[str, Writer] | None = None


def write_outing(
    folder: Path,
    graph: MotionGraph,
    outing: Outing,
    character: Character,
    progress: Progress,
    video: bool = True,
) -> dict[str, Any]:
    """Write an outing to a folder.

    Args:
        folder: Where to; made if it is missing. What an earlier run left there under the same names
            is removed where it is not written anew.
        graph: What it went through.
        outing: What the avatar did.
        character: Whose body it has.
        progress: Told the stage, how many are done, and of how many.
        video: Whether a video is drawn.

    Returns:
        The content of `result.json`; under `files` it says what was written, and why not.

    Raises:
        DynrespError: `result.json` cannot be written.
    """
    composition = outing.composition
    standing, bars = standing_about(graph.database.world, len(composition.motion))
    story = Story(
        motion=composition.motion,
        blocks=[*outing.blocks, *standing],
        capsules=bars,
        paths=outing.paths,
        title=outing.title,
        subtitle=outing.subtitle,
    )
    jumped_s = composition.jumps / graph.config.fps

    def plan(path: Path) -> None:
        from dynresp.view.plan_view import write_plan

        write_plan(story, path, jumped_s[jumped_s <= story.duration].tolist())

    writers = {
        **story_writers(story, character, _VIDEO_PX, _VIDEO_FPS, progress),
        PLAN: plan,
        **(outing.writers or {}),
    }
    names = [name for name in FILES if video or name != "video.mp4"]
    names += list(outing.writers or {})
    files = write_files(folder, names, writers, progress)
    there = [name for name, what in files.items() if what == WRITTEN]
    left = clear_response(folder, [RESULT, *there])
    files |= {name: what for name, what in left.items() if name not in files}
    content = {
        "title": outing.title,
        "graph": about_graph(graph),
        "happened": figures(graph, composition, character),
        **(outing.about or {}),
        "files": files,
        "versions": versions(),
    }
    write_json(content, folder / RESULT)
    return content


def about_graph(graph: MotionGraph) -> dict[str, Any]:
    """What `result.json` says of a graph."""
    clips = graph.database.clips
    return {
        "identity": graph_identity(graph),
        "fps": graph.config.fps,
        "frames": len(graph.database),
        "clips": len(clips),
        "built_in_clips": sum(clip.name.startswith(PREFIX) for clip in clips),
        "coordinates": graph.config.coordinates.value,
        "credits": list(graph.database.credits),
    }


def figures(graph: MotionGraph, composition: Composition, character: Character) -> dict[str, Any]:
    """What came of a walk, in numbers; slides before and after the feet were fitted."""
    motion = composition.motion
    track = motion.root_positions[:, :2]
    way = float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum())
    sliding = Motion(composition.sliding, motion.fps, motion.name, motion.contacts)
    steps = joint_speed_steps(motion)
    said: dict[str, Any] = {
        "seconds": motion.duration,
        "way_m": way,
        "speed_m_s": way / motion.duration if motion.duration > 0 else 0.0,
        "jumps": len(composition.jumps),
        "joint_speed_step_99_rad_s": float(np.percentile(steps, 99.0)) if steps.size else 0.0,
    }
    for name, played in (("as_blended", sliding), ("fitted", motion)):
        slips = foot_skates(played, character)
        said[f"foot_skate_{name}_m"] = {
            "stances": len(slips),
            "median": float(np.median(slips)) if len(slips) else 0.0,
            "percentile_95": float(np.percentile(slips, 95.0)) if len(slips) else 0.0,
            "worst": float(np.max(slips)) if len(slips) else 0.0,
        }
    return said
