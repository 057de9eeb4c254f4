"""An avatar's way through a graph, written for people to see and for programs to go on with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.world_setup import standing_about
from dynresp.locomotion.graph.graph_file import graph_identity
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import Composition
from dynresp.motion.builtin import PREFIX
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.response.response_quality import joint_speed_steps
from dynresp.results.result_folder import PLAN, RESULT, WRITTEN, clear_response
from dynresp.results.result_json import versions, write_json
from dynresp.results.story_files import Writer, story_writers, write_files
from dynresp.support.progress import Progress
from dynresp.view.story import Block, GroundPath, MovingSphere, Story, StoryEvent, StoryPhase

FILES = ("motion.npz", "motion.bvh", "recording.html", "filmstrip.png", PLAN, "video.mp4")
"""What is written of an outing besides `result.json`."""

# A stance of a walk lasts half a second: with fewer frames a second hardly any has two steps [1/s].
_SKATE_FPS = 10.0
_VIDEO_PX, _VIDEO_FPS = (640, 480), 30.0


@dataclass(frozen=True, eq=False)
class Outing:
    """What an avatar did.

    Attributes:
        title: First line of the pictures.
        subtitle: Second line.
        motion: Its motion.
        jumps_s: When it jumped in the graph [s]; None where that is not known.
        sliding: The motion before its feet were fitted; None where that is not known.
        blocks: What stood about.
        paths: What was drawn on the ground.
        bounds: How far it could go, (x, y, x, y) of two corners [m]; None where there is no bound.
        spheres: Balls.
        events: Moments with names.
        phases: What drove the avatar when.
        arrived: Whether it came as far as asked.
        about: Further content of `result.json`.
        writers: What writes further files, by name.
    """

    title: str
    subtitle: str
    motion: Motion
    jumps_s: Sequence[float] | None
    sliding: Motion | None = None
    blocks: Sequence[Block] = ()
    paths: Sequence[GroundPath] = ()
    bounds: tuple[float, float, float, float] | None = None
    spheres: Sequence[MovingSphere] = ()
    events: Sequence[StoryEvent] = ()
    phases: Sequence[StoryPhase] = ()
    arrived: bool = True
    about: dict[str, Any] = field(default_factory=dict)
    writers: dict[str, Writer] = field(default_factory=dict)

    @classmethod
    def of(cls, composition: Composition, graph: MotionGraph, **rest: Any) -> Outing:
        """The outing of a walk that was composed as a whole; the rest as the class takes it."""
        motion = composition.motion
        jumps_s = (composition.jumps / graph.config.fps).tolist()
        sliding = replace(motion, poses=composition.unfitted)
        return cls(motion=motion, jumps_s=jumps_s, sliding=sliding, **rest)


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
    standing, bars = standing_about(graph.database.world, len(outing.motion))
    story = Story(
        motion=outing.motion,
        spheres=outing.spheres,
        events=outing.events,
        phases=outing.phases,
        blocks=[*outing.blocks, *standing],
        capsules=bars,
        paths=outing.paths,
        bounds=outing.bounds,
        title=outing.title,
        subtitle=outing.subtitle,
    )

    def plan(path: Path) -> None:
        from dynresp.view.ground_plan import write_ground_plan

        write_ground_plan(story, path, [at for at in outing.jumps_s or () if at <= story.duration])

    writers = {
        **story_writers(story, character, _VIDEO_PX, _VIDEO_FPS, progress),
        PLAN: plan,
        **outing.writers,
    }
    names = [name for name in FILES if video or name != "video.mp4"]
    names += list(outing.writers)
    files = write_files(folder, names, writers, progress)
    there = [name for name, what in files.items() if what == WRITTEN]
    left = clear_response(folder, [RESULT, *there])
    files |= {name: what for name, what in left.items() if name not in files}
    content = {
        "title": outing.title,
        "graph": about_graph(graph),
        "happened": figures(outing, character),
        **outing.about,
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


def figures(outing: Outing, character: Character) -> dict[str, Any]:
    """What came of an outing, in numbers; slides as blended, if known, and with feet fitted."""
    motion = outing.motion
    track = motion.root_positions[:, :2]
    way = float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum())
    steps = joint_speed_steps(motion)
    said: dict[str, Any] = {
        "seconds": motion.duration,
        "way_m": way,
        "speed_m_s": way / motion.duration if motion.duration > 0 else 0.0,
        "jumps": None if outing.jumps_s is None else len(outing.jumps_s),
        "joint_speed_step_99_rad_s": float(np.percentile(steps, 99.0)) if steps.size else 0.0,
        "foot_skate_m": skate(motion, character),
    }
    if outing.sliding is not None:
        said["foot_skate_as_blended_m"] = skate(outing.sliding, character)
    return said


def skate(motion: Motion, character: Character) -> dict[str, float] | None:
    """How far feet slide a stance [m]: `median`, `percentile_95`, `worst`; 0 without a stance.

    None of a motion with too few frames a second to tell.
    """
    if motion.fps < _SKATE_FPS:
        return None
    slips = stance_slides(motion, character) or [0.0]
    return {
        "median": float(np.median(slips)),
        "percentile_95": float(np.percentile(slips, 95.0)),
        "worst": float(np.max(slips)),
    }
