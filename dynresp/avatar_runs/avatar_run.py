"""What an avatar did on a motion graph, and the result folder that is written of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.world_setup import standing_objects
from dynresp.locomotion.graph.graph_file import graph_identity
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.composition import Composition
from dynresp.motion.builtin import PREFIX
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.response.response_quality import joint_speed_steps
from dynresp.results.result_folder import PLAN, RESULT, WRITTEN, claim, clear
from dynresp.results.result_json import versions, write_json
from dynresp.results.story_files import Writer, story_writers, write_files
from dynresp.support.progress import Progress, no_progress
from dynresp.view.story import Block, GroundPath, MovingSphere, Story, StoryEvent, StoryPhase

VIDEO = "video.mp4"
FILES = ("motion.npz", "motion.bvh", "recording.html", "filmstrip.png", PLAN, VIDEO)
"""What is written of every run besides `result.json`."""

# A stance of a walk lasts half a second: below this frame rate hardly any has two steps [1/s].
_MIN_SLIDE_FPS = 10.0
_VIDEO_PX, _VIDEO_FPS = (640, 480), 30.0


@dataclass(frozen=True, eq=False)
class AvatarRun:
    """What an avatar did.

    Attributes:
        graph: The motion graph that it walked through.
        character: Its body.
        title: First line of the pictures.
        subtitle: Second line.
        motion: Its motion.
        jumps_s: Times of its jumps in the graph [s]; None if they are not known.
        sliding: The motion before its feet were fitted; None if it is not known.
        blocks: Boxes around it.
        paths: Lines drawn on the ground.
        bounds: Where it had to stay, (x, y, x, y) of two corners [m]; None for everywhere.
        spheres: Balls.
        events: Named moments.
        phases: What drove the avatar when.
        arrived: Whether it reached its goal or the end of its path.
        about: Further content of `result.json`.
        writers: What writes further files, by file name.
    """

    graph: MotionGraph
    character: Character
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
    def of(
        cls, composition: Composition, graph: MotionGraph, character: Character, **rest: Any
    ) -> AvatarRun:
        """The run of a walk that was composed as a whole; `rest` are further attributes."""
        motion = composition.motion
        jumps_s = (composition.jumps / graph.config.fps).tolist()
        sliding = replace(motion, poses=composition.unfitted)
        return cls(graph, character, motion=motion, jumps_s=jumps_s, sliding=sliding, **rest)

    def save(
        self,
        folder: Path | str,
        progress: Progress = no_progress,
        video: bool = True,
        *,
        overwrite: bool = False,
    ) -> dict[str, Any]:
        """Write the result folder.

        Args:
            folder: Where to; made if it is missing. Files that an earlier result wrote there, and
                this one does not, are removed.
            progress: Called with the stage, how many steps are done, and of how many.
            video: Whether a video is drawn.
            overwrite: Whether files that no earlier result names as its own may be replaced.

        Returns:
            The content of `result.json`. Its `files` says of each file whether it was written, and
            if not, why.

        Raises:
            UsageError: A file of somebody else would be replaced; nothing was written.
            DynrespError: `result.json` cannot be written.
        """
        folder = Path(folder)
        names = [name for name in FILES if video or name != VIDEO] + list(self.writers)
        own = claim(folder, RESULT, names, overwrite=overwrite)
        story = self._story()

        def plan(path: Path) -> None:
            from dynresp.view.ground_plan import write_ground_plan

            jumps_s = [at for at in self.jumps_s or () if at <= story.duration]
            write_ground_plan(story, path, jumps_s)

        writers = {
            **story_writers(story, self.character, _VIDEO_PX, _VIDEO_FPS, progress),
            PLAN: plan,
            **self.writers,
        }
        files = write_files(folder, names, writers, progress)
        written = [name for name, what in files.items() if what == WRITTEN]
        not_removed = clear(folder, own - {RESULT, *written})
        files |= {name: what for name, what in not_removed.items() if name not in files}
        content = {
            "title": self.title,
            "graph": graph_summary(self.graph),
            "happened": run_metrics(self),
            **self.about,
            "files": files,
            "versions": versions(),
        }
        write_json(content, folder / RESULT)
        return content

    def _story(self) -> Story:
        """What the pictures show."""
        standing, bars = standing_objects(self.graph.database.world, len(self.motion))
        return Story(
            motion=self.motion,
            spheres=self.spheres,
            events=self.events,
            phases=self.phases,
            blocks=[*self.blocks, *standing],
            capsules=bars,
            paths=self.paths,
            bounds=self.bounds,
            title=self.title,
            subtitle=self.subtitle,
        )


def graph_summary(graph: MotionGraph) -> dict[str, Any]:
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


def run_metrics(run: AvatarRun) -> dict[str, Any]:
    """What `result.json` says of a run in numbers.

    Foot slide is given of the motion and, if it is known, of the motion before feet were fitted.
    """
    motion = run.motion
    track = motion.root_positions[:, :2]
    distance = float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum())
    steps = joint_speed_steps(motion)
    metrics: dict[str, Any] = {
        "seconds": motion.duration,
        "way_m": distance,
        "speed_m_s": distance / motion.duration if motion.duration > 0 else 0.0,
        "jumps": None if run.jumps_s is None else len(run.jumps_s),
        "joint_speed_step_99_rad_s": float(np.percentile(steps, 99.0)) if steps.size else 0.0,
        "foot_skate_m": foot_slide(motion, run.character),
    }
    if run.sliding is not None:
        metrics["foot_skate_as_blended_m"] = foot_slide(run.sliding, run.character)
    return metrics


def foot_slide(motion: Motion, character: Character) -> dict[str, float] | None:
    """How far feet slide in a stance [m]: `median`, `percentile_95`, `worst`; 0 without a stance.

    None if the motion has less than 10 frames a second: too few to find stances.
    """
    if motion.fps < _MIN_SLIDE_FPS:
        return None
    slides = stance_slides(motion, character) or [0.0]
    return {
        "median": float(np.median(slides)),
        "percentile_95": float(np.percentile(slides, 95.0)),
        "worst": float(np.max(slides)),
    }
