"""An avatar that follows somebody before a camera, in the video's time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.random_walk import check_in_component, random_walk
from dynresp.locomotion.vision.person_tracker import PictureFeatures, track_person
from dynresp.locomotion.vision.segmentation import Mask, Picture, SegmentationConfig
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.support.arrays import IntArray

CHOICE_S = 0.1
"""Time between choices [s], as in the paper."""


@dataclass(frozen=True, eq=False)
class FollowStep:
    """What the avatar does between a choice and the next.

    Attributes:
        time_s: When, from the first picture on [s].
        frames: (k,) frames of the graph that it plays after those before.
        cluster: The cluster to which the chosen way leads; None where nobody was seen so far.
        person_cluster: The cluster in which the person is most probably; None likewise.
        mask: The person's silhouette; None where nobody is seen.
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
    segmentation: SegmentationConfig | None = None,
) -> Iterator[FollowStep]:
    """Choose for the avatar ten times a second.

    Until somebody is seen it goes by the graph's probabilities. Nothing is read ahead: what is
    yielded follows from the pictures up to then, so that they may come from a camera.

    Args:
        pictures: See `Segmenter`; the first second shows the room alone.
        fps: How many there are a second.
        control: Chooses; it has seen nothing yet.
        frame: The frame of the graph at which the avatar begins.
        rng: For as long as it goes by chance.
        segmentation: How the person is told from the room.

    Raises:
        UsageError: The frame is not in the graph's component, or the frame rate not above 0.
        MotionError: A picture is none, or of another size than those before.
    """
    check_in_component(control.forest.graph, frame)
    seen = track_person(pictures, fps, control.table, segmentation)
    yield from follow_features(seen, control, frame, rng)


def follow_features(
    seen: Iterable[PictureFeatures], control: VideoControl, frame: int, rng: np.random.Generator
) -> Iterator[FollowStep]:
    """The same from what the pictures told: see `follow` and `track_person`.

    Raises:
        UsageError: The frame is not in the graph's component.
    """
    graph = control.forest.graph
    check_in_component(graph, frame)
    somebody = False
    played = chosen = 0
    for features in seen:
        for row in features.rows:
            control.see(row)
            somebody = True
        time_s = features.time_s
        if int(time_s / CHOICE_S + 1e-9) == chosen:
            continue
        chosen = int(time_s / CHOICE_S + 1e-9)
        due = int(time_s * control.table.fps + 1e-9) - played
        played += due
        frames, cluster = np.empty(0, dtype=np.int32), None
        # A way that ends early is followed by another.
        while somebody and len(frames) < due:
            way = control.choose(frame)
            cluster = way.cluster if cluster is None else cluster
            frames = np.concatenate([frames, way.frames[: due - len(frames)]])
            frame = int(frames[-1])
        if len(frames) < due:
            frames = random_walk(graph, due, rng, frame)
            frame = int(frames[-1])
        person_cluster = int(np.argmax(control.clusters)) if somebody else None
        yield FollowStep(time_s, frames.astype(np.int32), cluster, person_cluster, features.mask)
