"""An outing that follows somebody in a video (Lee et al. 2002, section 5.3)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.avatar_run import Outing
from dynresp.avatar_runs.visible_cluster_file import Sight
from dynresp.avatar_runs.world_setup import TERRAIN, play_in_world
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import wrapped
from dynresp.locomotion.vision.segmentation import Picture, SegmentationConfig
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.locomotion.vision.video_following import Followed, follow
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

# A video must go on for so long after the empty room [s].
_LEAST_S = 0.5
# So many pictures fewer than a file says are no damage: some count what cannot be shown.
_FEW = 5
# Mean speeds below count as standing [m/s].
_STANDING = 0.25
# Turns below count as none [deg/s].
_STRAIGHT = 10.0
# So many moments are kept for the picture, or up to twice as many.
_KEPT = 32


@dataclass(frozen=True)
class VideoAsked:
    """What is to be watched.

    Attributes:
        name: Of the video, for people.
        fps: Pictures a second.
        seconds: Watch at most so long [s].
        length: Pictures it has; None where that is not known.
        seed: Of where the avatar begins, and of what it does while it sees nobody.
        stop: Whether to stop; asked before each picture, once there is something to follow.
        ended: Told when no more pictures are waited for.
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
    """How fast was chosen.

    Attributes:
        choices: How many.
        choices_per_s: For each second of computing; ten are due in a second of video.
        share_of_real_time: Computing time for a second of video [s].
        slowest_choice_s: The longest time from a choice to the next [s].
    """

    choices: int
    choices_per_s: float
    share_of_real_time: float
    slowest_choice_s: float


def check_watchable(graph: MotionGraph) -> None:
    """Refuse a graph that cannot be gone through by video.

    Raises:
        UsageError: It is of steps that fit onto blocks only.
    """
    if graph.database.world == TERRAIN:
        raise UsageError(
            "the graph holds steps over rough terrain, each of which needs its blocks, and a video "
            "does not show them; build another graph, or use `dynresp graph sketch`"
        )


def watch_outing(
    graph: MotionGraph,
    character: Character,
    sight: Sight,
    pictures: Iterable[Picture],
    asked: VideoAsked,
    fps: float,
    progress: Progress,
    remark: Callable[[str], None],
) -> tuple[Outing, Pace]:
    """Follow somebody.

    Args:
        graph: What is walked through.
        character: Whose body the avatar has.
        sight: Of the graph.
        pictures: Of the video; the first second shows the room alone.
        asked: What is watched.
        fps: Frame rate of the motion [1/s].
        progress: Told how far it has come.
        remark: Told of a video that ends before it should.

    Raises:
        MotionFileError: The video is too short.
        MotionError: Its pictures are not all of one size.
        DynrespError: Nobody is ever seen.
    """
    rng = np.random.default_rng(asked.seed)
    start = int(rng.choice(graph.frames))
    _compiled(sight, start)
    control = VideoControl(sight.forest, sight.table, sight.recogniser)
    reel = _Reel(pictures, asked, progress)
    steps: list[Followed] = []
    slowest = 0.0
    begun = before = time.perf_counter()
    for step in follow(reel, asked.fps, control, start, rng):
        reel.keep(step)
        # Masks are large, and those that are shown are kept by the reel.
        steps.append(Followed(step.time_s, step.frames, step.cluster, step.told, None))
        now = time.perf_counter()
        slowest = max(slowest, now - before - reel.waited_since())
        before = now
    worked = time.perf_counter() - begun - reel.waited_s
    missing = _missing(asked, reel.count)
    _check_length(asked, reel.count, missing)
    if missing:
        remark(f"{asked.name}: {missing}")
    if not any(step.told is not None for step in steps):
        raise DynrespError(
            f"nobody is seen in {asked.name}, {steps[-1].time_s:.1f} s; the first second has to "
            "show the room alone, the camera must stand still, and whole people be seen in clothes "
            "unlike the room"
        )
    pace = Pace(
        len(steps), len(steps) / worked, worked / (reel.count / asked.fps), max(slowest, 0.0)
    )
    return _outing(graph, character, sight, start, steps, reel, asked, fps), pace


def _compiled(sight: Sight, start: int) -> None:
    """Choose once for nobody: what is compiled on first use would keep the person waiting."""
    trial = VideoControl(sight.forest, sight.table, sight.recogniser)
    trial.see(sight.table.rows[start, 0])
    trial.choose(start)


def _missing(asked: VideoAsked, count: int) -> str:
    """What is to be said of a file that ends before it should; nothing of others."""
    if asked.length is None or count + _FEW >= min(asked.length, _most(asked)):
        return ""
    return (
        f"{count} of the {asked.length} pictures that the file says it has can be read; it may be "
        "damaged or cut short"
    )


def _most(asked: VideoAsked) -> int:
    """Pictures that are watched at most."""
    return round(asked.seconds * asked.fps)


def _check_length(asked: VideoAsked, count: int, missing: str) -> None:
    """Refuse a video that is over before there is anything to follow.

    Raises:
        MotionFileError: It is too short.
    """
    empty = SegmentationConfig().empty_s
    seconds = count / asked.fps
    if seconds < empty + _LEAST_S:
        # Rounded down, so that what is too short never reads as long enough.
        said = "1 picture" if count == 1 else f"{math.floor(100 * seconds + 1e-6) / 100:.2f} s"
        raise MotionFileError(
            f"{asked.name}: {said} of video; the first {empty:g} s show the room alone, "
            f"so expected at least {empty + _LEAST_S:g} s" + (f"; {missing}" if missing else "")
        )


class _Reel:
    """The pictures on their way, and some moments that are kept.

    Attributes:
        count: Pictures that have come.
        waited_s: How long was waited for them [s].
        moments: Some moments in which somebody was seen, evenly spread.
    """

    def __init__(self, pictures: Iterable[Picture], asked: VideoAsked, progress: Progress) -> None:
        self.count = 0
        self.waited_s = 0.0
        self.moments: list[VideoMoment] = []
        self._pictures = iter(pictures)
        self._asked, self._progress = asked, progress
        self._last: Picture | None = None
        self._reported = 0.0
        # The silhouette is of every second frame of usual videos; so are the moments.
        self._every, self._steps = 2, 0

    def __iter__(self) -> Iterator[Picture]:
        yield from self._until_the_end()
        self._asked.ended()

    def _until_the_end(self) -> Iterator[Picture]:
        asked = self._asked
        empty_s = SegmentationConfig().empty_s
        room = "learning the empty room, nobody may be in the picture"
        most = _most(asked)
        length = most if asked.length is None else min(most, asked.length)
        while self.count < most:
            if self.count > (empty_s + _LEAST_S) * asked.fps and asked.stop():
                return
            begun = time.perf_counter()
            self._last = next(self._pictures, None)
            self.waited_s += time.perf_counter() - begun
            if self._last is None:
                return
            self.count += 1
            passed = self.count / asked.fps
            if passed <= empty_s:
                self._progress(room, self.count, round(empty_s * asked.fps))
            else:
                self._progress(f"watching {asked.name}", self.count, length)
            yield self._last

    def waited_since(self) -> float:
        """How long was waited since this was asked last [s]."""
        since, self._reported = self.waited_s - self._reported, self.waited_s
        return since

    def keep(self, step: Followed) -> None:
        """Keep the moment of a choice, where somebody is seen and it is its turn."""
        require("cv2")
        import cv2

        self._steps += 1
        if step.mask is None or step.told is None or self._steps % self._every:
            return
        assert self._last is not None
        height, width = step.mask.shape
        small = cv2.resize(self._last, (width, height), interpolation=cv2.INTER_AREA)
        self.moments.append(VideoMoment(step.time_s, np.asarray(small, dtype=np.uint8), step.mask))
        if len(self.moments) >= 2 * _KEPT:
            self.moments = self.moments[::2]
            self._every *= 2


def _outing(
    graph: MotionGraph,
    character: Character,
    sight: Sight,
    start: int,
    steps: Sequence[Followed],
    reel: _Reel,
    asked: VideoAsked,
    fps: float,
) -> Outing:
    """What was watched as an outing."""
    path = np.concatenate([[start], *(step.frames for step in steps)]).astype(np.int32)
    composition = play_in_world(graph, character, path, fps)
    clusters = sight.forest.clusters
    played = np.cumsum([len(step.frames) for step in steps])
    times = [step.time_s for step in steps]
    told = [step.told for step in steps]
    chosen = [step.cluster for step in steps]
    avatar = [int(clusters.labels[path[number]]) for number in played]
    seen = [(a, b) for a, b in zip(told, avatar, strict=True) if a is not None]
    together = float(np.mean([a == b for a, b in seen]))
    words = [in_words(graph, clusters.labels == k) for k in range(len(clusters))]
    examples = graph.database.poses[clusters.examples]
    watched = VideoControlStory(
        motion=composition.motion,
        moments=reel.moments,
        line=ActionTimeline(times, told, chosen, avatar),
        poses=examples,
        words=words,
    )
    title = "An avatar that follows a video"
    subtitle = (
        f"{asked.name[-60:]}, {times[-1]:.1f} s; the avatar does what the person is seen to do for "
        f"{together:.0%} of the time, seed {asked.seed}"
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
    return Outing.of(
        composition,
        graph,
        title=title,
        subtitle=subtitle,
        about={
            "seed": asked.seed,
            "video": {"name": asked.name, "fps": asked.fps, "pictures": reel.count},
            "first_seen_s": next(t for t, k in zip(times, told, strict=True) if k is not None),
            "avatar_as_seen_share": together,
            "actions": about,
            "person": _stretches(times, told),
            "chosen": _stretches(times, chosen),
            "avatar": _stretches(times, avatar),
        },
        writers={WATCHING: picture},
    )


def in_words(graph: MotionGraph, own: np.ndarray) -> str:
    """How somebody moves on the whole in some frames of the database.

    Args:
        graph: Whose frames.
        own: (n,) whether a frame counts.
    """
    database = graph.database
    planar, fps = database.planar, database.fps
    frames = np.flatnonzero(own & (database.successors >= 0))
    if len(frames) == 0:
        return "a moment"
    later = database.successors[frames]
    moved = (planar[later, :2] - planar[frames, :2]) * fps
    cosine, sine = np.cos(planar[frames, 3]), np.sin(planar[frames, 3])
    ahead = float(np.mean(cosine * moved[:, 0] + sine * moved[:, 1]))
    left = float(np.mean(cosine * moved[:, 1] - sine * moved[:, 0]))
    speed = float(np.hypot(ahead, left))
    if speed < _STANDING:
        usual = float(np.median(np.hypot(*moved.T)))
        said = "stays in place" if usual < _STANDING else "goes to and fro"
    elif abs(left) > abs(ahead):
        said = f"goes {'left' if left > 0 else 'right'} at {speed:.1f} m/s"
    else:
        said = f"goes {'ahead' if ahead > 0 else 'back'} at {speed:.1f} m/s"
    turn = float(np.degrees(np.mean(wrapped(planar[later, 3] - planar[frames, 3]))) * fps)
    if abs(turn) < _STRAIGHT:
        return said
    return f"{said}, turns {'left' if turn > 0 else 'right'} at {abs(turn):.0f} deg/s"


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
