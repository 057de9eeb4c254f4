"""An avatar that follows a person before a camera, in the video's time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.random_walk import check_in_component, random_walk
from dynresp.locomotion.vision.person_tracker import PictureFeatures, track_person
from dynresp.locomotion.vision.segmentation import Mask, Picture
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.support.arrays import IntArray

CHOICE_S = 0.1
"""Time between choices [s], as in the paper."""


@dataclass(frozen=True, eq=False)
class FollowStep:
    """What the avatar does from one choice to the next.

    Attributes:
        time_s: Time of the choice; the first picture begins at 0 [s].
        frames: (k,) frames of the graph that it plays after those before.
        cluster: The cluster to which the chosen path leads; None if nobody was seen so far.
        person_cluster: The person's most probable cluster; None if nobody was seen so far.
        mask: The person's silhouette; None if nobody is seen.
    """

    time_s: float
    frames: IntArray
    cluster: int | None
    person_cluster: int | None
    mask: Mask | None


def follow(
    pictures: Iterable[Picture],
    fps: float,
    control: VideoControl,
    frame: int,
    rng: np.random.Generator,
) -> Iterator[FollowStep]:
    """Choose for the avatar ten times a second.

    Until a person is seen, the avatar does a random walk. No picture is read ahead of time, so
    that pictures may come from a camera.

    Args:
        pictures: See `Segmenter.segment`; the first second shows the empty room.
        fps: Pictures per second.
        control: Chooses; it has seen nothing yet.
        frame: The frame of the graph at which the avatar begins.
        rng: For the random walk.

    Raises:
        UsageError: The frame is not in the graph's component, or the frame rate not above 0.
        MotionError: One of them is not a picture, or its size differs from the first one's.
    """
    check_in_component(control.forest.graph, frame)
    seen = track_person(pictures, fps, control.table)
    yield from follow_features(seen, control, frame, rng)


def follow_features(
    seen: Iterable[PictureFeatures], control: VideoControl, frame: int, rng: np.random.Generator
) -> Iterator[FollowStep]:
    """`follow`, from the features of pictures that `track_person` gives.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    graph = control.forest.graph
    check_in_component(graph, frame)
    person_seen = False
    played = chosen = 0
    for features in seen:
        for row in features.rows:
            control.see(row)
            person_seen = True
        time_s = features.time_s
        if int(time_s / CHOICE_S + 1e-9) == chosen:
            continue
        chosen = int(time_s / CHOICE_S + 1e-9)
        due = int(time_s * control.table.fps + 1e-9) - played
        played += due
        frames, cluster = np.empty(0, dtype=np.int32), None
        # A path that ends early is followed by another.
        while person_seen and len(frames) < due:
            path = control.choose(frame)
            cluster = path.cluster if cluster is None else cluster
            frames = np.concatenate([frames, path.frames[: due - len(frames)]])
            frame = int(frames[-1])
        if len(frames) < due:
            frames = random_walk(graph, due, rng, frame)
            frame = int(frames[-1])
        person_cluster = int(np.argmax(control.clusters)) if person_seen else None
        yield FollowStep(time_s, frames.astype(np.int32), cluster, person_cluster, features.mask)
