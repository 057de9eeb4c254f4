"""How well, how soon and how fast an avatar follows strangers in videos.

Nobody is compared with himself: the database, its clusters, what its frames look like and what is
learnt of them are made of others' motion, not even captured in the same studio, and the person is
filmed in another body's shape than the character's, in a patterned room under moving light.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dynresp.bench.judging import Judged
from dynresp.bench.left_out import Gathered, Take, gather, takes_of
from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult
from dynresp.bench.people import PEOPLE, Person
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.locomotion.vision.video_following import CHOICE_S, follow_sightings
from dynresp.locomotion.vision.visible_clusters import (
    MAX_VISIBLE_CLUSTERS,
    find_visible_clusters,
    visible_observations,
)
from dynresp.motion.character import Character, default_character
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.support.arrays import IntArray
from dynresp.support.errors import MissingMotionDataError

MOST_S = 60.0
"""How much is filmed of each person [s]."""
GRAPH = GraphConfig(contact_change=False, sigma=0.15)
"""An avatar that is to follow at once needs more ways on than one that walks about."""


@dataclass(frozen=True)
class Fold:
    """One person's videos against the motion of all other studios.

    Attributes:
        person: Who is filmed.
        judged: The choices.
        commonest: The cluster that is the most frequent in the database: the best constant answer
            that can be known before.
        see_s: Seconds of computing a second of video until its rows are there.
        choose_s: The same from there to the choices.
    """

    person: Person
    judged: Judged
    commonest: int
    see_s: float
    choose_s: float


def run(
    seed: int = 0,
    motions: Path | None = None,
    *,
    clusters: Sequence[int] = (MAX_VISIBLE_CLUSTERS,),
    most_s: float = MOST_S,
    progress: Callable[[str], None] = lambda _: None,
) -> BenchResult:
    """Measure on one core: about eight minutes, and four for each number of clusters.

    Args:
        seed: Of the rooms, the lights and the cameras, and of what is learnt.
        motions: Motions folder.
        clusters: How many clusters at most; the first is `value`'s.
        most_s: How much is filmed of each person [s].
        progress: Told what is done.

    Returns:
        `value` is the share of choices that lead to a cluster in which the actor was within the
        last second, the mean of the clusters' shares, of people whom no setting was chosen for.

    Raises:
        MissingMotionDataError: There is motion of fewer than two studios.
        DynrespError: A motion cannot be read, or a video not be written.
    """
    folders = motion_folders(motions)
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
        character = default_character()
        progress(f"drawing what {len(people)} people do")
        gathered = gather(people, folders, character)
        takes = []
        for number, person in enumerate(people):
            progress(f"filming {person.name}")
            takes += takes_of(person, folders, gathered.table, seed + 1000 * number, most_s)
        more: dict[str, float | int | str] = {
            "people": len(people),
            "takes": len(takes),
            "video_s": sum(take.truth.duration for take in takes),
            "frames": len(gathered.database),
        }
        tables: list[list[Fold]] = []
        for most in clusters:
            tables.append([])
            for studio in sorted(studios):
                progress(f"leaving out {studio}; {most} clusters")
                tables[-1] += leave_out(studio, gathered, takes, most, character, seed)
    finally:
        cv2.setNumThreads(threads)
    for most, folds in zip(clusters, tables, strict=True):
        for who, known in (("strangers", False), ("known", True)):
            chosen = [fold for fold in folds if fold.person.known is known]
            more |= {f"{who}_{most}_{key}": value for key, value in told(chosen).items()}
        for fold in folds:
            more[f"{fold.person.name}_{most}"] = " ".join(
                f"{key} {value:.2f}" for key, value in told([fold]).items()
            )
    first = tables[0]
    more["choices_per_s"] = 1.0 / CHOICE_S / float(np.mean([f.see_s + f.choose_s for f in first]))
    value = float(more[f"strangers_{clusters[0]}_balanced"])
    constant = float(more[f"strangers_{clusters[0]}_constant_balanced"])
    return BenchResult(
        name="video",
        value=value,
        unit="of the choices",
        baseline=constant,
        baseline_name="always the most frequent cluster",
        ratio=value / constant,
        machine=describe_machine(("numpy", "numba", "scikit-learn", "opencv-python-headless")),
        more=more,
        notes=(
            "Measured: choices that lead to where the actor was within the last second, the mean "
            "over the actor's clusters, of people for whom no setting was chosen (strangers).",
            "right: the share of all choices; constant: what the database's most frequent cluster "
            "gets at all times, best_constant: each person's own, which nobody can know before; "
            "avatar: moments at which the avatar itself is where the actor was within the last "
            "second.",
            "lag: from an actor's change that lasts a second to the choice; 3 s if never.",
        ),
    )


def told(folds: Sequence[Fold]) -> dict[str, float]:
    """The figures of some people."""
    if not folds:
        return {}
    right, constant, best, avatar, lags = [], [], [], [], []
    balanced = np.empty((len(folds), 3))
    for row, fold in zip(balanced, folds, strict=True):
        judged = fold.judged
        given: tuple[IntArray | int, ...] = (judged.chosen, fold.commonest, judged.own)
        right.append(judged.right(judged.chosen))
        constant.append(judged.right(fold.commonest))
        every = [judged.right(k) for k in range(judged.recent.shape[1])]
        best.append(max(every, key=lambda shares: float(shares.mean())))
        avatar.append(judged.right(judged.own))
        lags.append(judged.lags)
        for column, answers in enumerate(given):
            row[column] = judged.balanced(answers)
    means = balanced.mean(axis=0)
    lag = np.concatenate(lags)
    out = {
        "right": float(np.mean(np.concatenate(right))),
        "constant": float(np.mean(np.concatenate(constant))),
        "best_constant": float(np.mean(np.concatenate(best))),
        "balanced": float(means[0]),
        "constant_balanced": float(means[1]),
        "avatar": float(np.mean(np.concatenate(avatar))),
        "avatar_balanced": float(means[2]),
        "changes": float(len(lag)),
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
    graph = MotionGraph.of(database, GRAPH, character)
    clusters = find_visible_clusters(graph, most, character)
    commonest = int(np.bincount(clusters.labels[graph.frames]).argmax())
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
            acted = MotionDatabase.gather([take.truth], character, table.fps)
            truth = clusters.mixture.labels(visible_observations(acted, character))
            control = VideoControl(forest, table, recogniser)
            seen, start = translated(take), int(rng.choice(graph.frames))
            began = time.perf_counter()
            steps = list(follow_sightings(seen, control, start, rng))
            choosing_s += time.perf_counter() - began
            parts.append(Judged.of(steps, clusters, truth, table.fps, take.empty_s))
        length = sum(take.seen[-1].time_s for take in own)
        seeing_s = sum(take.seconds for take in own)
        judged = Judged.joined(parts)
        folds.append(Fold(person, judged, commonest, seeing_s / length, choosing_s / length))
    return folds
