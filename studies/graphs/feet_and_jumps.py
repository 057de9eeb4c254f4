"""How far feet slide, and how speeds change at jumps, before and after fitting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import place_poses
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError
from studies.graphs.graph_study import FLAT, of_graphs
from studies.graphs.speed_steps import COLUMNS, UNITS, at_jumps, source_limits, source_limits_at
from studies.study import Study, Target, Value

SLIDE_M = 0.01
"""A foot that slides less than this in a stance counts as standing [m]."""
CUT, BLENDED, FITTED = STAGES = ("cut", "blended", "fitted")
SHOWN_FPS = 30.0
"""Frame rate of the motions that are written."""
_STRETCH = 25_000


def measure(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    """Measure stances and jumps of a random walk.

    Args:
        graph: The graph.
        character: The character.
        count: Frames, 3 at least.
        seed: Of the walk.

    Raises:
        UsageError: The walk is too short to hold a stance and a jump.
    """
    path = random_walk(graph, count, np.random.default_rng(seed))
    own, shown = (_Stages.of(graph, character, path, fps) for fps in (graph.config.fps, SHOWN_FPS))
    slides, steps = own.slides, own.steps
    if not (own.whole and shown.whole):
        raise UsageError(f"{count} frames hold no stance or no jump; give a larger --count")
    limits = source_limits(graph)
    shown_limits = source_limits_at(graph, character, SHOWN_FPS)
    below = np.mean(shown.steps[FITTED] <= shown_limits, axis=0)
    return {
        "frames": count,
        "jumps": len(steps[FITTED]) // 2,
        "stances": len(slides[FITTED]),
        **_of_slides(slides),
        **_of_steps(steps, limits),
        "at_30_fps_slide_fitted_under_1_cm": float(np.mean(shown.slides[FITTED] < SLIDE_M)),
        **{
            f"at_30_fps_{name}_step_fitted_below": float(share)
            for name, share in zip(COLUMNS, below, strict=True)
        },
    }


@dataclass(frozen=True, eq=False)
class _Stages:
    """Of a walk, by stage: slides of the feet in stances [m], and speed steps at jumps."""

    slides: dict[str, FloatArray]
    steps: dict[str, FloatArray]

    @property
    def whole(self) -> bool:
        """Whether there is a stance and a jump."""
        return all(len(rows.get(FITTED, ())) for rows in (self.slides, self.steps))

    @classmethod
    def of(cls, graph: MotionGraph, character: Character, path: IntArray, fps: float) -> _Stages:
        """Compose a walk at a frame rate and measure it; `cut` only at the graph's rate."""
        slides: dict[str, list[float]] = {stage: [] for stage in STAGES}
        steps: dict[str, list[FloatArray]] = {stage: [] for stage in STAGES}
        rate = fps / graph.config.fps
        for at in range(0, len(path) - 2, _STRETCH):
            made = compose(graph, character, path[at : at + _STRETCH], fps=fps)
            stages = {BLENDED: made.unfitted, FITTED: made.motion.poses}
            if rate == 1.0:
                stages[CUT] = place_poses(graph.database.poses[made.frames], made.placements)
            for stage, poses in stages.items():
                motion = Motion(poses, fps, stage, made.motion.contacts)
                slides[stage] += stance_slides(motion, character)
                steps[stage].append(at_jumps(motion, made.jumps, rate))
        return cls(
            {stage: np.array(values) for stage, values in slides.items() if values},
            {stage: np.concatenate(rows) for stage, rows in steps.items() if rows},
        )


def _of_slides(slides: dict[str, FloatArray]) -> dict[str, Value]:
    """Shares and sizes of slides, by stage."""
    figures: dict[str, Value] = {}
    for stage in (BLENDED, FITTED):
        values = slides[stage]
        figures[f"slide_{stage}_under_1_cm"] = float(np.mean(values < SLIDE_M))
        figures[f"slide_{stage}_median_mm"] = 1e3 * float(np.median(values))
        figures[f"slide_{stage}_p99_mm"] = 1e3 * float(np.percentile(values, 99.0))
        figures[f"slide_{stage}_largest_mm"] = 1e3 * float(values.max())
    return figures


def _of_steps(steps: dict[str, FloatArray], limits: FloatArray) -> dict[str, Value]:
    """Limits, and for each stage the share below and the 99.9th percentile."""
    figures: dict[str, Value] = {}
    for k, (name, unit) in enumerate(zip(COLUMNS, UNITS, strict=True)):
        figures[f"{name}_step_recorded_p99.9_{unit}"] = float(limits[k])
        for stage in STAGES:
            own = steps[stage][:, k]
            figures[f"{name}_step_{stage}_below"] = float(np.mean(own <= limits[k]))
            figures[f"{name}_step_{stage}_p99.9_{unit}"] = float(np.percentile(own, 99.9))
    return figures


STUDY = Study(
    "feet-and-jumps",
    "how far feet slide in a stance, and how speeds change at jumps, before and after fitting",
    "1 min",
    of_graphs(measure, FLAT, 50_000, 400),
    (
        Target("slide_fitted_under_1_cm", "all", at_least=1.0),
        *(Target(f"{name}_step_fitted_below", "all", at_least=1.0) for name in COLUMNS),
        Target("at_30_fps_slide_fitted_under_1_cm", "all", at_least=1.0),
        *(Target(f"at_30_fps_{name}_step_fitted_below", "all", at_least=1.0) for name in COLUMNS),
    ),
    notes=(
        "slide: how far a foot slides in a stance, blended but not fitted, and fitted.",
        "step: change of speed from frame to frame at the frames that a jump leaves and enters; "
        "cut is without any blend; below is the share below the 99.9th percentile of the recorded "
        "motion, played at the same rate: the graph's, and the 30 fps of motions that are written.",
    ),
)
