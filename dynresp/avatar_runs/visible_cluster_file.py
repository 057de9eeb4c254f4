"""What following a video learns of a graph, kept in the user's cache folder.

Silhouettes of every frame, visible clusters, and the network that recognises them take a minute to
make, and depend on the graph alone. A file that is damaged, or of another version, is replaced.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import CurvePoint, Mixture
from dynresp.locomotion.graph.graph_file import graph_identity
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.silhouette_features import FeatureConfig
from dynresp.locomotion.vision.silhouette_table import ViewTable, table_identity
from dynresp.locomotion.vision.silhouettes import Viewpoints
from dynresp.locomotion.vision.visible_clusters import (
    CLUSTERING_VERSION,
    OBSERVATION_SIZE,
    find_visible_clusters,
)
from dynresp.motion.character import Character
from dynresp.support.archive import TEXT, ArchiveFormat, Arrays, text_array
from dynresp.support.errors import DynrespError, GraphFileError
from dynresp.support.paths import cache_folder
from dynresp.support.progress import Progress

FORMAT = ArchiveFormat(
    what="actions",
    error=GraphFileError,
    version=1,
    members={
        "format_version": ("<i8", ()),
        "identity": (TEXT, ()),
        "weights": ("<f8", ("clusters",)),
        "means": ("<f8", ("clusters", "numbers")),
        "variances": ("<f8", ("clusters",)),
        "labels": ("<i4", ("frames",)),
        "log_probabilities": ("<f4", ("frames", "clusters")),
        "examples": ("<i4", ("clusters",)),
        "spacing": ("<i8", ()),
        "curve": ("<f8", ("points", 3)),
        "bounded": ("|b1", ()),
        "ages": ("<i4", ("ages",)),
        "first_weights": ("<f8", ("seen", "width")),
        "first_biases": ("<f8", ("width",)),
        "last_weights": ("<f8", ("width", "clusters")),
        "last_biases": ("<f8", ("clusters",)),
    },
    most={
        "frames": 250_000, "clusters": 100, "numbers": 1_000, "points": 100, "ages": 100,
        "seen": 10_000, "width": 1_000,
    },
    max_text=100,
    max_bytes=1 << 28,
)  # fmt: skip
"""The file of clusters and of the network that recognises them."""

# Largest number of frames back in time.
_MAX_AGE = 10_000
# Squares and products of larger numbers overflow.
_LARGEST = 1e100
# Largest logarithm of a probability, above 0 by rounding.
_ROUNDING = 1e-3

_Made = TypeVar("_Made")


@dataclass(frozen=True, eq=False)
class VideoModel:
    """What is needed to follow a person through a graph.

    Attributes:
        forest: The avatar's paths between visible clusters.
        table: Silhouettes of the frames.
        recogniser: Recognises clusters from silhouettes.
    """

    forest: ClusterForest
    table: ViewTable
    recogniser: Recogniser

    @classmethod
    def of(
        cls,
        graph: MotionGraph,
        character: Character,
        most: int,
        progress: Progress,
        remark: Callable[[str], None],
    ) -> VideoModel:
        """Load what the cache has of a graph; make and save the rest.

        Args:
            graph: The graph.
            character: Its character.
            most: Most clusters.
            progress: Called with the stage, how many steps are done, and of how many.
            remark: Called with the reason if something could not be saved.

        Raises:
            UsageError: `DYNRESP_CACHE` names something that is not a folder.
        """
        folder = cache_folder() / "sight"
        database = graph.database
        name = table_identity(database, FeatureConfig(), Viewpoints())

        def draw() -> ViewTable:
            return ViewTable.of(
                database,
                character=character,
                progress=lambda done, of: progress("drawing silhouettes", done, of),
            )

        table = _kept(
            folder / f"silhouettes-{name}.npz",
            lambda path: ViewTable.load(path, database),
            draw,
            lambda made, path: made.save(path),
            remark,
        )
        identity = _identity(graph, table, most)

        def learn() -> tuple[Clusters, Recogniser]:
            progress("learning to recognise actions", 0, 2)
            clusters = find_visible_clusters(graph, most, character)
            progress("learning to recognise actions", 1, 2)
            return clusters, Recogniser.trained(database, table, clusters.labels)

        clusters, recogniser = _kept(
            folder / f"actions-{identity}.npz",
            lambda path: load_actions(path, identity, graph, table),
            learn,
            lambda made, path: save_actions(path, identity, *made),
            remark,
        )
        return cls(ClusterForest(graph, clusters), table, recogniser)


def save_actions(path: Path, identity: str, clusters: Clusters, recogniser: Recogniser) -> None:
    """Write clusters and the network that recognises them.

    Raises:
        GraphFileError: They are larger than such a file may be.
        DynrespError: The file cannot be written.
    """
    mixture, curve = clusters.mixture, clusters.curve
    points = [(point.clusters, point.log_likelihood, point.bic) for point in curve]
    FORMAT.write(
        path,
        {
            "identity": text_array(identity),
            "weights": mixture.weights.astype("<f8"),
            "means": mixture.means.astype("<f8"),
            "variances": mixture.variances.astype("<f8"),
            "labels": clusters.labels.astype("<i4"),
            "log_probabilities": clusters.log_probabilities.astype("<f4"),
            "examples": clusters.examples.astype("<i4"),
            "spacing": np.array(clusters.spacing, dtype="<i8"),
            "curve": np.array(points, dtype="<f8").reshape(-1, 3),
            "bounded": np.array(clusters.bounded, dtype="|b1"),
            "ages": recogniser.ages.astype("<i4"),
            "first_weights": recogniser.weights[0].astype("<f8"),
            "first_biases": recogniser.biases[0].astype("<f8"),
            "last_weights": recogniser.weights[1].astype("<f8"),
            "last_biases": recogniser.biases[1].astype("<f8"),
        },
    )


def load_actions(
    path: Path, identity: str, graph: MotionGraph, table: ViewTable
) -> tuple[Clusters, Recogniser]:
    """Read the clusters of a graph and the network that recognises them.

    Raises:
        GraphFileError: The file cannot be read, or is of another graph.
    """
    a = FORMAT.read(path)
    if a["identity"].item() != identity:
        FORMAT.fail(path, "has the actions of another graph; delete it, and it is made again")
    frames, count, width = len(graph.database), len(a["weights"]), len(a["first_biases"])
    seen = len(a["ages"]) * table.rows.shape[2]
    shapes = {
        "means": (count, OBSERVATION_SIZE),
        "variances": (count,),
        "labels": (frames,),
        "log_probabilities": (frames, count),
        "examples": (count,),
        "first_weights": (seen, width),
        "last_weights": (width, count),
        "last_biases": (count,),
    }
    whole = count > 0 and all(a[name].shape == shape for name, shape in shapes.items())
    if not (whole and _within(a["labels"], count)):
        FORMAT.fail(path, "does not hold actions: its arrays do not fit together")
    if not _plausible(a):
        FORMAT.fail(path, "does not hold actions: some of its numbers make no sense")
    if not (np.isin(a["examples"], graph.frames).all() and _within(a["ages"], _MAX_AGE)):
        FORMAT.fail(path, "does not hold actions: it names frames that the graph does not have")
    clusters = Clusters(
        Mixture(a["weights"].copy(), a["means"].copy(), a["variances"].copy()),
        a["labels"].copy(),
        a["log_probabilities"].copy(),
        a["examples"].copy(),
        int(a["spacing"]),
        tuple(CurvePoint(int(n), float(logs), float(bic)) for n, logs, bic in a["curve"]),
        bool(a["bounded"]),
    )
    recogniser = Recogniser(
        a["ages"], (a["first_weights"], a["last_weights"]), (a["first_biases"], a["last_biases"])
    )
    return clusters, recogniser


def _plausible(a: Arrays) -> bool:
    """Whether learning can give these numbers; the arrays fit together."""
    # The bias of a cluster without frames is minus infinity.
    biases, logs = a["last_biases"], a["log_probabilities"]
    biases = biases[biases != -np.inf]
    finite = [a[x] for x in ("weights", "means", "variances", "curve")]
    finite += [a[x] for x in ("first_weights", "first_biases", "last_weights")]
    likeliest = logs.max(axis=1)
    return bool(
        all((np.abs(numbers) <= _LARGEST).all() for numbers in [*finite, biases])
        and len(biases)
        and a["weights"].min() >= 0.0
        and a["variances"].min() > 0.0
        and a["spacing"] >= 1
        and not np.isnan(logs).any()
        and np.isfinite(likeliest).all()
        and likeliest.max() <= _ROUNDING
    )


def _within(numbers: np.ndarray, end: int) -> bool:
    """Whether all are from 0 to before the end."""
    return bool(len(numbers)) and int(numbers.min()) >= 0 and int(numbers.max()) < end


def _identity(graph: MotionGraph, table: ViewTable, most: int) -> str:
    """Short hash of everything that clusters and network depend on."""
    text = f"{graph_identity(graph)} {table.identity} {most} {CLUSTERING_VERSION}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _kept(
    path: Path,
    load: Callable[[Path], _Made],
    make: Callable[[], _Made],
    save: Callable[[_Made, Path], None],
    remark: Callable[[str], None],
) -> _Made:
    """Load a file; if it cannot be read, make its content and write it."""
    try:
        return load(path)
    except GraphFileError:
        made = make()
    try:
        save(made, path)
    except DynrespError as error:
        remark(f"the next run has to learn this graph again: {error}")
    return made
