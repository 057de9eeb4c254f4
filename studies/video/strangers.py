"""How well, how soon and how fast an avatar follows strangers in videos.

The database, its clusters, silhouettes and recognition are made of other people's motion, from
other studios. The person is filmed with another body shape than the character's, in a patterned
room under moving light.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.locomotion.vision.video_following import CHOICE_S, follow_features
from dynresp.locomotion.vision.visible_clusters import (
    MAX_VISIBLE_CLUSTERS,
    find_visible_clusters,
    visible_observations,
)
from dynresp.motion.character import Character, default_character
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.support.arrays import IntArray
from dynresp.support.errors import MissingMotionDataError
from studies.study import Columns, Options, Study, Target, Value
from studies.video.cross_validation import Gathered, Take, gather, takes_of
from studies.video.judged_choices import Judged
from studies.video.people import PEOPLE, Person

FILMED_S, QUICK_S = 60.0, 3.0
"""How much is filmed of each person, and in a quick run [s]."""
GRAPH = GraphConfig(contact_change=False, sigma=0.15)
"""An avatar that follows at once needs more jumps than one that walks about."""


@dataclass(frozen=True)
class Fold:
    """One person's videos against the motion of all other studios.

    Attributes:
        person: Who is filmed.
        judged: The choices.
        most_frequent: The most frequent cluster of the database: the best constant answer
            that can be known before.
        see_s: Seconds of computing a second of video until its rows are there.
        choose_s: The same from there to the choices.
    """

    person: Person
    judged: Judged
    most_frequent: int
    see_s: float
    choose_s: float


def measure(options: Options) -> Columns:
    """Film people and follow them, on one core.

    Args:
        options: The seed is of the rooms, the lights and the cameras, and of what is learnt.

    Returns:
        Columns `strangers`, for whom no setting was chosen, `known`, and one for each person.

    Raises:
        MissingMotionDataError: There is motion of fewer than two studios.
        DynrespError: A motion cannot be read, or a video not be written.
    """
    folders = motion_folders(options.motions)
    people = [person for person in PEOPLE if person.files(folders)]
    studios = {person.studio for person in people}
    if len(studios) < 2:
        raise MissingMotionDataError(
            "videos of strangers need motion of people of at least two studios, "
            f"{len(studios)} are on this machine; fetch some with `dynresp motions fetch`, or name "
            "a folder with --motions"
        )
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        folds = _followed(people, folders, options)
    finally:
        cv2.setNumThreads(threads)
    columns = {
        who: judged_together([fold for fold in folds if fold.person.known is known])
        for who, known in (("strangers", False), ("known", True))
    }
    return columns | {fold.person.name: judged_together([fold]) for fold in folds}


def _followed(people: Sequence[Person], folders: Sequence[Path], options: Options) -> list[Fold]:
    """Film everybody, then follow the people of each studio with the motion of all others."""
    character = default_character()
    options.say(f"drawing the motion of {len(people)} people")
    gathered = gather(people, folders, character)
    most_s = QUICK_S if options.quick else FILMED_S
    takes = []
    for number, person in enumerate(people):
        options.say(f"filming {person.name}")
        takes += takes_of(person, folders, gathered.table, options.seed + 1000 * number, most_s)
    folds = []
    for studio in sorted({person.studio for person in people}):
        options.say(f"leaving out {studio}")
        count = options.count or MAX_VISIBLE_CLUSTERS
        folds += leave_out(studio, gathered, takes, count, character, options.seed)
    return folds


def judged_together(folds: Sequence[Fold]) -> dict[str, Value]:
    """Values of some people together."""
    if not folds:
        return {}
    right, constant, best, avatar, lags = [], [], [], [], []
    balanced = np.empty((len(folds), 3))
    for row, fold in zip(balanced, folds, strict=True):
        judged = fold.judged
        given: tuple[IntArray | int, ...] = (judged.chosen, fold.most_frequent, judged.own)
        right.append(judged.right(judged.chosen))
        constant.append(judged.right(fold.most_frequent))
        every = [judged.right(k) for k in range(judged.recent.shape[1])]
        best.append(max(every, key=lambda shares: float(shares.mean())))
        avatar.append(judged.right(judged.own))
        lags.append(judged.lags)
        for column, answers in enumerate(given):
            row[column] = judged.balanced(answers)
    means = balanced.mean(axis=0)
    lag = np.concatenate(lags)
    out: dict[str, Value] = {
        "people": len(folds),
        "right": float(np.mean(np.concatenate(right))),
        "constant": float(np.mean(np.concatenate(constant))),
        "best_constant": float(np.mean(np.concatenate(best))),
        "balanced": float(means[0]),
        "constant_balanced": float(means[1]),
        "avatar": float(np.mean(np.concatenate(avatar))),
        "avatar_balanced": float(means[2]),
        "changes": len(lag),
        "choices_per_s": 1.0 / CHOICE_S / float(np.mean([f.see_s + f.choose_s for f in folds])),
    }
    if len(lag):
        out["lag_median_s"] = float(np.median(lag))
        out["lag_within_1s"] = float(np.mean(lag <= 1.0))
    return out


def leave_out(
    studio: str,
    gathered: Gathered,
    takes: Sequence[Take],
    most: int,
    character: Character,
    seed: int = 0,
) -> list[Fold]:
    """Follow the people of one studio with a database of all others.

    Args:
        studio: Whose motion is left out.
        gathered: Everybody's motion.
        takes: Videos, also of others.
        most: How many clusters at most.
        character: The product's own.
        seed: Of what is learnt, and of where avatars begin.
    """
    database, table, translated = gathered.without(studio)
    graph = MotionGraph.from_database(database, GRAPH, character)
    clusters = find_visible_clusters(graph, most, character)
    most_frequent = int(np.bincount(clusters.labels[graph.frames]).argmax())
    forest = ClusterForest(graph, clusters)
    recogniser = Recogniser.trained(database, table, clusters.labels, seed)
    rng = np.random.default_rng(seed)
    folds = []
    for person in gathered.people:
        own = [take for take in takes if take.person == person.name]
        if person.studio != studio or not own:
            continue
        parts, choosing_s = [], 0.0
        for take in own:
            acted = MotionDatabase.from_motions([take.truth], character, table.fps)
            truth = clusters.mixture.labels(visible_observations(acted, character))
            control = VideoControl(forest, table, recogniser)
            seen, start = translated(take), int(rng.choice(graph.frames))
            began = time.perf_counter()
            steps = list(follow_features(seen, control, start, rng))
            choosing_s += time.perf_counter() - began
            parts.append(Judged.of(steps, clusters, truth, table.fps, take.empty_s))
        length = sum(take.seen[-1].time_s for take in own)
        seeing_s = sum(take.seconds for take in own)
        judged = Judged.joined(parts)
        folds.append(Fold(person, judged, most_frequent, seeing_s / length, choosing_s / length))
    return folds


STUDY = Study(
    "video",
    "how well an avatar follows strangers in videos, one studio left out at a time",
    "12 min",
    measure,
    (
        Target("right", "at least 80 %", at_least=0.8),
        Target("lag_within_1s", "all", at_least=1.0),
        Target("choices_per_s", "at least 10", at_least=10.0),
    ),
    ("numpy", "numba", "scikit-learn", "opencv-python-headless"),
    (
        "right: choices that lead to a cluster in which the actor was within the last second; "
        "balanced: the mean over the actor's clusters; constant: always the most frequent cluster "
        "of the database; best_constant: each person's own, which nobody can know before; avatar: "
        "moments at which the avatar itself is in such a cluster.",
        "lag: from an actor's change that lasts a second to the choice; 3 s if never.",
        "--count bounds the clusters, by default 5. Targets are for strangers and known people.",
    ),
)
