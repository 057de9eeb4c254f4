"""A walk that follows a person in a video (Lee et al. 2002, section 5.3)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.avatar_runs.visible_cluster_file import VideoModel
from dynresp.avatar_runs.world_setup import TERRAIN, play_in_world
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import wrapped
from dynresp.locomotion.vision.segmentation import EMPTY_ROOM_S, Picture
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.locomotion.vision.video_following import FollowStep, follow
from dynresp.motion.character import Character
from dynresp.results.result_folder import WATCHING
from dynresp.support.errors import DynrespError, MotionFileError, UsageError
from dynresp.support.extras import require
from dynresp.support.progress import Progress
from dynresp.view.video_control_view import (
    ActionTimeline,
    VideoControlStory,
    VideoMoment,
    letter,
    write_video_control,
)

# Shortest video after the empty room [s].
_MIN_S = 0.5
# A file may hold this many pictures fewer than it says: some files count pictures that cannot be
# shown.
_TOLERATED = 5
# A slower mean speed counts as standing [m/s], a slower turn as none [deg/s].
_STANDING_M_S, _STRAIGHT_DEG_S = 0.25, 10.0
# Moments kept for the picture: from this many to twice as many.
_KEPT = 32


@dataclass(frozen=True)
class VideoSettings:
    """A video, and how long to follow it.

    Attributes:
        name: Name of the video, for people.
        fps: Pictures a second.
        seconds: Longest time to follow [s].
        length: Number of pictures; None if it is not known.
        seed: Seed of where the avatar begins, and of what it does while nobody is visible.
        stop: Whether to stop; called before each picture, once there is something to follow.
        ended: Called when no more pictures are awaited.
    """

    name: str
    fps: float
    seconds: float
    length: int | None
    seed: int
    stop: Callable[[], bool]
    ended: Callable[[], None]


@dataclass(frozen=True)
class Pace:
    """How fast the computer chose.

    Attributes:
        choices: Number of choices.
        choices_per_s: Choices per second of computing; a second of video needs ten.
        share_of_real_time: Computing time per second of video [s].
        slowest_choice_s: The longest time between two choices [s].
    """

    choices: int
    choices_per_s: float
    share_of_real_time: float
    slowest_choice_s: float


def check_watchable(graph: MotionGraph) -> None:
    """Refuse a graph that cannot follow a video.

    Raises:
        UsageError: Its steps fit on blocks only.
    """
    if graph.database.world == TERRAIN:
        raise UsageError(
            "the graph holds steps over rough terrain, which need blocks to step on, and a video "
            "shows none; build another graph, or use `dynresp graph sketch`"
        )


def video_run(
    graph: MotionGraph,
    character: Character,
    model: VideoModel,
    pictures: Iterable[Picture],
    settings: VideoSettings,
    fps: float,
    progress: Progress,
    remark: Callable[[str], None],
) -> tuple[AvatarRun, Pace]:
    """Follow a person in a video; `dynresp graph watch` does this.

    Args:
        graph: The motion graph.
        character: The avatar's body.
        model: What was learnt of the graph.
        pictures: Pictures of the video; the first second shows the empty room.
        settings: The video, and how long to follow it.
        fps: Frame rate of the motion [1/s].
        progress: Called with the stage, how many pictures are done, and of how many.
        remark: Called with a message if the video ends early.

    Raises:
        MotionFileError: The video is too short.
        MotionError: Its pictures are not all of one size.
        DynrespError: No person is ever seen.
    """
    rng = np.random.default_rng(settings.seed)
    start = int(rng.choice(graph.frames))
    _compile(model, start)
    control = VideoControl(model.forest, model.table, model.recogniser)
    reel = _Reel(pictures, settings, progress)
    steps: list[FollowStep] = []
    slowest = 0.0
    begun = before = time.perf_counter()
    for step in follow(reel, settings.fps, control, start, rng):
        reel.keep(step)
        # Masks are large; the reel keeps those that are shown.
        steps.append(FollowStep(step.time_s, step.frames, step.cluster, step.person_cluster, None))
        now = time.perf_counter()
        slowest = max(slowest, now - before - reel.waited_since())
        before = now
    worked = time.perf_counter() - begun - reel.waited_s
    missing = _missing(settings, reel.count)
    _check_length(settings, reel.count, missing)
    if missing:
        remark(f"{settings.name}: {missing}")
    if not any(step.person_cluster is not None for step in steps):
        raise DynrespError(
            f"no person is seen in {settings.name}, {steps[-1].time_s:.1f} s; the first second "
            "must show the empty room, the camera must not move, and the whole person must be in "
            "the picture, in clothes unlike the room"
        )
    pace = Pace(
        len(steps), len(steps) / worked, worked / (reel.count / settings.fps), max(slowest, 0.0)
    )
    return _run(graph, character, model, start, steps, reel, settings, fps), pace


def _compile(model: VideoModel, start: int) -> None:
    """Choose once without a picture, so that compiling does not delay the first real choice."""
    trial = VideoControl(model.forest, model.table, model.recogniser)
    trial.see(model.table.rows[start, 0])
    trial.choose(start)


def _missing(settings: VideoSettings, count: int) -> str:
    """What to say of a file that ends early; empty for others."""
    length = settings.length
    if length is None or count + _TOLERATED >= min(length, _max_pictures(settings)):
        return ""
    return (
        f"{count} of the {length} pictures that the file says it has can be read; it may be "
        "damaged or cut short"
    )


def _max_pictures(settings: VideoSettings) -> int:
    """Most pictures that are followed."""
    return round(settings.seconds * settings.fps)


def _check_length(settings: VideoSettings, count: int, missing: str) -> None:
    """Refuse a video that ends before there is anything to follow.

    Raises:
        MotionFileError: It is too short.
    """
    seconds = count / settings.fps
    if seconds < EMPTY_ROOM_S + _MIN_S:
        # Rounded down, so that a length that is too short never reads as long enough.
        found = "1 picture" if count == 1 else f"{math.floor(100 * seconds + 1e-6) / 100:.2f} s"
        raise MotionFileError(
            f"{settings.name}: {found} of video; the first {EMPTY_ROOM_S:g} s show the empty room, "
            f"so expected at least {EMPTY_ROOM_S + _MIN_S:g} s"
            + (f"; {missing}" if missing else "")
        )


class _Reel:
    """Hands out the pictures, and keeps some of them for the result.

    Attributes:
        count: Pictures so far.
        waited_s: Time spent waiting for them [s].
        moments: Some moments in which a person was seen, evenly spread.
    """

    def __init__(
        self, pictures: Iterable[Picture], settings: VideoSettings, progress: Progress
    ) -> None:
        self.count = 0
        self.waited_s = 0.0
        self.moments: list[VideoMoment] = []
        self._pictures = iter(pictures)
        self._settings, self._progress = settings, progress
        self._last: Picture | None = None
        self._reported = 0.0
        self._every, self._steps = 2, 0

    def __iter__(self) -> Iterator[Picture]:
        yield from self._until_the_end()
        self._settings.ended()

    def _until_the_end(self) -> Iterator[Picture]:
        settings = self._settings
        room = "learning the empty room; nobody may be in the picture"
        last = _max_pictures(settings)
        length = last if settings.length is None else min(last, settings.length)
        while self.count < last:
            if self.count > (EMPTY_ROOM_S + _MIN_S) * settings.fps and settings.stop():
                return
            begun = time.perf_counter()
            self._last = next(self._pictures, None)
            self.waited_s += time.perf_counter() - begun
            if self._last is None:
                return
            self.count += 1
            passed = self.count / settings.fps
            if passed <= EMPTY_ROOM_S:
                self._progress(room, self.count, round(EMPTY_ROOM_S * settings.fps))
            else:
                self._progress(f"watching {settings.name}", self.count, length)
            yield self._last

    def waited_since(self) -> float:
        """Time spent waiting since the last call [s]."""
        waited, self._reported = self.waited_s - self._reported, self.waited_s
        return waited

    def keep(self, step: FollowStep) -> None:
        """Keep the moment of every second choice (later: fourth ...) in which a person is seen."""
        require("cv2")
        import cv2

        self._steps += 1
        if step.mask is None or step.person_cluster is None or self._steps % self._every:
            return
        assert self._last is not None
        height, width = step.mask.shape
        small = cv2.resize(self._last, (width, height), interpolation=cv2.INTER_AREA)
        self.moments.append(VideoMoment(step.time_s, np.asarray(small, dtype=np.uint8), step.mask))
        if len(self.moments) >= 2 * _KEPT:
            self.moments = self.moments[::2]
            self._every *= 2


def _run(
    graph: MotionGraph,
    character: Character,
    model: VideoModel,
    start: int,
    steps: Sequence[FollowStep],
    reel: _Reel,
    settings: VideoSettings,
    fps: float,
) -> AvatarRun:
    """The run of what was followed."""
    path = np.concatenate([[start], *(step.frames for step in steps)]).astype(np.int32)
    composition = play_in_world(graph, character, path, fps)
    clusters = model.forest.clusters
    played = np.cumsum([len(step.frames) for step in steps])
    times = [step.time_s for step in steps]
    person = [step.person_cluster for step in steps]
    chosen = [step.cluster for step in steps]
    avatar = [int(clusters.labels[path[number]]) for number in played]
    seen = [(a, b) for a, b in zip(person, avatar, strict=True) if a is not None]
    together = float(np.mean([a == b for a, b in seen]))
    words = [describe_frames(graph, clusters.labels == k) for k in range(len(clusters))]
    examples = graph.database.poses[clusters.examples]
    watched = VideoControlStory(
        motion=composition.motion,
        moments=reel.moments,
        line=ActionTimeline(times, person, chosen, avatar),
        poses=examples,
        words=words,
    )
    title = "An avatar that follows a video"
    subtitle = (
        f"{settings.name[-60:]}, {times[-1]:.1f} s; the avatar does what the person does "
        f"{together:.0%} of the time, seed {settings.seed}"
    )

    def picture(out: Path) -> None:
        write_video_control(watched, out, title, subtitle)

    database = graph.database
    about = [
        {
            "name": letter(k),
            "what": words[k],
            "example": {
                "motion": database.clips[database.clip_of[frame]].name,
                "frame": int(frame) - database.clips[database.clip_of[frame]].start,
            },
            "frames": int(np.sum(clusters.labels == k)),
        }
        for k, frame in enumerate(clusters.examples)
    ]
    return AvatarRun.of(
        composition,
        graph,
        character,
        title=title,
        subtitle=subtitle,
        about={
            "seed": settings.seed,
            "video": {"name": settings.name, "fps": settings.fps, "pictures": reel.count},
            "first_seen_s": next(t for t, k in zip(times, person, strict=True) if k is not None),
            "avatar_as_seen_share": together,
            "actions": about,
            "person": _stretches(times, person),
            "chosen": _stretches(times, chosen),
            "avatar": _stretches(times, avatar),
        },
        writers={WATCHING: picture},
    )


def describe_frames(graph: MotionGraph, chosen: np.ndarray) -> str:
    """The mean movement in some frames of the database, in words.

    Args:
        graph: The graph of the database.
        chosen: (n,) bool, which frames.
    """
    database = graph.database
    planar, fps = database.planar, database.fps
    frames = np.flatnonzero(chosen & (database.successors >= 0))
    if len(frames) == 0:
        return "a moment"
    nexts = database.successors[frames]
    moved = (planar[nexts, :2] - planar[frames, :2]) * fps
    cosine, sine = np.cos(planar[frames, 3]), np.sin(planar[frames, 3])
    ahead = float(np.mean(cosine * moved[:, 0] + sine * moved[:, 1]))
    left = float(np.mean(cosine * moved[:, 1] - sine * moved[:, 0]))
    speed = float(np.hypot(ahead, left))
    if speed < _STANDING_M_S:
        typical = float(np.median(np.hypot(*moved.T)))
        text = "stays in place" if typical < _STANDING_M_S else "goes to and fro"
    elif abs(left) > abs(ahead):
        text = f"goes {'left' if left > 0 else 'right'} at {speed:.1f} m/s"
    else:
        text = f"goes {'ahead' if ahead > 0 else 'back'} at {speed:.1f} m/s"
    turn = float(np.degrees(np.mean(wrapped(planar[nexts, 3] - planar[frames, 3]))) * fps)
    if abs(turn) < _STRAIGHT_DEG_S:
        return text
    return f"{text}, turns {'left' if turn > 0 else 'right'} at {abs(turn):.0f} deg/s"


def _stretches(times: Sequence[float], numbers: Sequence[int | None]) -> list[dict[str, Any]]:
    """Which action from when to when, for `result.json`."""
    out, begin = [], 0.0
    rows = zip(times, numbers, strict=True)
    for number, group in groupby(rows, key=lambda row: row[1]):
        end = [row[0] for row in group][-1]
        what = None if number is None else letter(number)
        out.append({"from_s": round(begin, 6), "to_s": round(end, 6), "action": what})
        begin = end
    return out
