"""The file of a motion graph: an `.npz` archive of plain arrays, format version 1.

================  =======  ===============  ====================================================
member            dtype    shape            what it holds
================  =======  ===============  ====================================================
``format_version``  int64  ()               1
``character``     text     ()               `Character.identity` of the character that moves
``identity``      text     ()               hash of frames, configuration and transitions
``config``        text     ()               the configuration, as JSON
``counts``        int64    (8,)             `PruningCounts` in its order; -1 for None
``poses``         float64  (frames, 59)     rows of `qpos`
``contacts``      bool     (frames, 2 or 4) as two members: ``feet`` and ``hands``
``clip_names``    text     (clips,)         names of the motions
``clip_hashes``   text     (clips,)         identities of the motions (`motion_identity`)
``clip_stops``    int64    (clips,)         one past each clip's last frame
``credits``       text     (credits,)       credits of the motions
``world``         text     ()               name of the world they were recorded in
``offsets``       int64    (frames + 1,)    where each frame's transitions begin
``targets``       int32    (transitions,)   the frames to which they lead
``distances``     float32  (transitions,)   their distances
================  =======  ===============  ====================================================

The file holds the poses, so a graph can be walked without the motion files. Probabilities follow
from the distances and are not stored.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph, PruningCounts
from dynresp.motion.character import POSE_SIZE, ROOT, Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.archive import TEXT, ArchiveFormat, Arrays, text_array
from dynresp.support.errors import DynrespError, GraphFileError

FORMAT = ArchiveFormat(
    what="graph",
    error=GraphFileError,
    version=1,
    members={
        "format_version": ("<i8", ()),
        "character": (TEXT, ()),
        "identity": (TEXT, ()),
        "config": (TEXT, ()),
        "counts": ("<i8", (8,)),
        "poses": ("<f8", ("frames", POSE_SIZE)),
        "feet": ("|b1", ("frames", 2)),
        "hands": ("|b1", ("hands", 2)),
        "clip_names": (TEXT, ("clips",)),
        "clip_hashes": (TEXT, ("clips",)),
        "clip_stops": ("<i8", ("clips",)),
        "credits": (TEXT, ("credits",)),
        "world": (TEXT, ()),
        "offsets": ("<i8", ("rows",)),
        "targets": ("<i4", ("transitions",)),
        "distances": ("<f4", ("transitions",)),
    },
    most={
        "frames": 250_000,
        "hands": 250_000,
        "rows": 250_001,
        "clips": 20_000,
        "credits": 1_000,
        "transitions": 50_000_000,
    },
    max_text=2_000,
    max_bytes=1 << 30,
)
"""What a graph file holds."""

# As a motion must be; see `dynresp.motion.motion` and `dynresp.motion.readers.npz`.
_FARTHEST_M = 100_000.0
_UNIT_LENGTH_TOLERANCE = 1e-6
# A transition whose distance has more sigmas than this has probability 0 in a float64.
_MOST_SIGMAS = 700.0

# JSON types for the types of `GraphConfig`'s fields, and their names.
_JSON_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "float": ((float, int), "a number"),
    "bool": ((bool,), "true or false"),
    "bool | None": ((bool, type(None)), "true, false or null"),
    "Coordinates": ((str,), "text"),
}


def save_graph(graph: MotionGraph, path: str | Path) -> None:
    """Write a graph; the same graph gives the same bytes.

    Args:
        graph: The graph.
        path: The file, usually *.npz; missing folders are made, an old file is replaced.

    Raises:
        GraphFileError: The graph is larger than a file may be.
        DynrespError: The file cannot be written.
    """
    FORMAT.write(path, {**_arrays(graph), "identity": text_array(graph_identity(graph))})


def graph_identity(graph: MotionGraph) -> str:
    """Short hash of a graph's frames, configuration and transitions."""
    return _hash(_arrays(graph))


def load_graph(path: str | Path, character: Character | None = None) -> MotionGraph:
    """Read a graph.

    Args:
        path: The file.
        character: The character that the graph must have, by default the product's own.

    Raises:
        GraphFileError: The file cannot be opened, is damaged or out of bounds, or belongs to
            another format version or another character.
    """
    if not isinstance(path, str | os.PathLike):
        raise GraphFileError(f"a graph file is named by text or a Path, got {path!r:.60}")
    path = Path(path)
    arrays = FORMAT.read(path)
    character = character or default_character()
    if arrays["character"].item() != character.identity:
        FORMAT.fail(
            path,
            f"is a graph of character {arrays['character'].item()[:40]!r}, and this one is "
            f"{character.identity!r}; build the graph again with `dynresp graph build`",
        )
    try:
        graph = _graph(arrays)
    except (DynrespError, ValueError) as error:
        FORMAT.fail(path, f"does not hold a graph: {error}")
    if graph_identity(graph) != arrays["identity"].item():
        FORMAT.fail(path, "is not what was written: its hash differs; build the graph again")
    return graph


def _arrays(graph: MotionGraph) -> Arrays:
    database = graph.database
    config: dict[str, Any] = dataclasses.asdict(graph.config)
    config["coordinates"] = graph.config.coordinates.value
    counts = [-1 if x is None else x for x in dataclasses.astuple(graph.counts)]
    return {
        "character": text_array(database.character),
        "config": text_array(json.dumps(config, sort_keys=True)),
        "counts": np.array(counts, dtype="<i8"),
        "poses": database.poses.astype("<f8"),
        "feet": database.contacts[:, :2],
        "hands": database.contacts[:, 2:].reshape(-1, 2),
        "clip_names": text_array([clip.name[:1000].rstrip("\0") for clip in database.clips]),
        "clip_hashes": text_array([clip.identity for clip in database.clips]),
        "clip_stops": np.array([clip.stop for clip in database.clips], dtype="<i8"),
        "credits": text_array(list(database.credits)),
        "world": text_array(database.world),
        "offsets": graph.offsets.astype("<i8"),
        "targets": graph.targets.astype("<i4"),
        "distances": graph.distances.astype("<f4"),
    }


def _hash(arrays: Arrays) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        content = (
            "\n".join(array.ravel().tolist()).encode("utf-8", "surrogatepass")
            if (array.dtype.kind == "U")
            else np.ascontiguousarray(array).tobytes()
        )
        digest.update(f"{name} {array.shape} ".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def _graph(arrays: Arrays) -> MotionGraph:
    """The graph that the arrays of a file describe.

    Raises:
        ValueError: They contradict each other.
        DynrespError: They make no graph.
    """
    stops = arrays["clip_stops"].tolist()
    names, hashes = arrays["clip_names"].tolist(), arrays["clip_hashes"].tolist()
    frames = len(arrays["poses"])
    if not len(names) == len(hashes) == len(stops):
        raise ValueError("names, hashes and ends of clips differ in number")
    starts = [0, *stops[:-1]]
    if any(stop - start < 1 for start, stop in zip(starts, stops, strict=True)):
        raise ValueError("a clip ends before it begins")
    if len(arrays["feet"]) != frames or len(arrays["hands"]) not in (0, frames):
        raise ValueError("contacts are not given for every frame")
    hands = arrays["hands"]
    contacts = np.concatenate([arrays["feet"], hands], axis=1) if len(hands) else arrays["feet"]
    config = _config(arrays["config"].item())
    _check_poses(arrays["poses"])
    clips = [Clip(*clip) for clip in zip(names, starts, stops, hashes, strict=True)]
    database = MotionDatabase(
        arrays["poses"],
        contacts,
        config.fps,
        tuple(clips),
        arrays["character"].item(),
        tuple(arrays["credits"].tolist()),
        arrays["world"].item(),
    )
    offsets, targets, distances = (arrays[x] for x in ("offsets", "targets", "distances"))
    if len(offsets) != frames + 1 or offsets[0] != 0 or offsets[-1] != len(targets):
        raise ValueError("the transitions do not match the frames")
    if (np.diff(offsets) < 0).any() or len(distances) != len(targets):
        raise ValueError("the transitions do not match each other")
    if len(targets) and not (targets.min() >= 0 and targets.max() < frames):
        raise ValueError("a transition leads to a frame that does not exist")
    if not (np.isfinite(distances).all() and (distances >= 0).all()):
        raise ValueError("a distance is negative or not finite")
    if len(targets) == 0 or (np.diff(offsets)[targets] == 0).any():
        raise ValueError("a transition leads to a frame that has none")
    filled = np.flatnonzero(np.diff(offsets))
    if (np.minimum.reduceat(distances, offsets[filled]) > _MOST_SIGMAS * config.sigma).any():
        raise ValueError("a frame has no transition with a probability above 0")
    rows = np.repeat(np.arange(frames), np.diff(offsets))
    jumps = database.successors[rows] != targets
    first = np.zeros(frames, dtype=bool)
    first[starts] = True
    if first[targets[jumps]].any():
        raise ValueError("a jump leads to the first frame of a clip")
    considered, pairs, contact, likelihood, similarity, *rest = (int(x) for x in arrays["counts"])
    kept = None if similarity < 0 else similarity
    pruned = PruningCounts(considered, pairs, contact, likelihood, kept, rest[0], rest[1], rest[2])
    return MotionGraph(
        database, config, pruned, offsets.astype(np.int64), targets.astype(np.int32),
        distances.astype(np.float32),
    )  # fmt: skip


def _config(text: str) -> GraphConfig:
    """The configuration; every key must be there and have its type.

    Raises:
        ValueError: A key is missing or has another type.
        UsageError: A value is out of range.
    """
    try:
        table = json.loads(text)
    except RecursionError:
        raise ValueError("the configuration is nested too deeply") from None
    if not isinstance(table, dict):
        raise ValueError("the configuration is not a table")
    kinds = {field.name: _JSON_TYPES[str(field.type)] for field in dataclasses.fields(GraphConfig)}
    if table.keys() != kinds.keys():
        raise ValueError(f"the configuration must have the keys {', '.join(sorted(kinds))}")
    for name, (types, what) in kinds.items():
        # Not isinstance: True is not a number.
        if type(table[name]) not in types:
            raise ValueError(f"{name} must be {what}, not {type(table[name]).__name__}")
    return GraphConfig(**{**table, "coordinates": Coordinates(table["coordinates"])})


def _check_poses(poses: FloatArray) -> None:
    """Check poses (frames, 59).

    Raises:
        ValueError: A number is not finite, a root is too far from the origin, or a quaternion is
            not of unit length.
    """
    if not np.isfinite(poses).all():
        raise ValueError("a pose is not finite")
    far = (np.abs(poses[:, ROOT]) > _FARTHEST_M).any(axis=1)
    if far.any():
        frame = int(np.argmax(far))
        raise ValueError(
            f"the root of frame {frame} is at {poses[frame, ROOT].tolist()}; "
            f"it must be within {_FARTHEST_M:g} m of the origin"
        )
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(poses[:, 3:].reshape(len(poses), -1, 4), axis=2)
    wrong = ~(np.abs(lengths - 1.0) <= _UNIT_LENGTH_TOLERANCE)
    if wrong.any():
        frame, number = divmod(int(np.argmax(wrong)), wrong.shape[1])
        raise ValueError(
            f"quaternions must be of unit length; quaternion {number} of frame {frame} has the "
            f"length {lengths[frame, number]:g}"
        )
