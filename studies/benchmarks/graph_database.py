"""Graphs of specs, and databases of any number of frames, for benchmarks and studies."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.support.arrays import BoolArray
from dynresp.support.errors import MissingMotionDataError

SPECS = ("walking", "builtin")
"""Specs to take motions from: the first whose motions are on this machine."""

# Deviations of repeated clips: size [rad], such that the share of close pairs is as in recorded
# walking; number; and frequencies [Hz].
_DEVIATION, _WAVES, _FREQUENCIES = 0.07, 4, (0.1, 1.2)


def database_of(recorded: MotionDatabase, frames: int, rng: np.random.Generator) -> MotionDatabase:
    """A database of a given number of frames.

    Args:
        recorded: Its clips are used in order. Then they are used again, each time with other slow
            deviations of all rotations, as in another performance.
        frames: Number of frames.
        rng: Random numbers for the deviations.
    """
    poses: list[FloatArray] = []
    contacts: list[BoolArray] = []
    clips: list[Clip] = []
    at = 0
    while at < frames:
        again = at >= len(recorded)
        for clip in recorded.clips:
            stop = min(clip.stop, clip.start + frames - at)
            if stop <= clip.start:
                break
            own = recorded.poses[clip.start : stop]
            poses.append(_deviating(own, recorded.fps, rng) if again else own)
            contacts.append(recorded.contacts[clip.start : stop])
            clips.append(Clip(clip.name, at, at + len(own), f"{clip.identity}.{len(clips)}"))
            at += len(own)
    return replace(
        recorded, poses=np.concatenate(poses), contacts=np.concatenate(contacts), clips=tuple(clips)
    )


def _deviating(poses: FloatArray, fps: float, rng: np.random.Generator) -> FloatArray:
    """Poses (n, 59) with slow random deviations of root and joints."""
    time_s = np.arange(len(poses)) / fps
    turns = np.zeros((len(poses), 14, 3))
    for _ in range(_WAVES):
        phase = 2.0 * np.pi * rng.uniform(*_FREQUENCIES) * time_s + rng.uniform(0.0, 2.0 * np.pi)
        turns += rng.normal(0.0, _DEVIATION, (14, 3)) * np.sin(phase)[:, None, None]
    quaternions = poses[:, 3:].reshape(-1, 14, 4)
    turned = rotations.multiply(quaternions, rotations.from_rotation_vector(turns))
    return np.concatenate([poses[:, :3], turned.reshape(len(poses), -1)], axis=1)


def graphs_at_hand(
    names: Sequence[str], folders: Sequence[Path], character: Character, needed: bool = False
) -> Iterator[tuple[str, MotionGraph]]:
    """The graphs of graph specs, one after the other, with the names of the specs.

    Args:
        names: Of specs that come with dynresp, or spec files.
        folders: Motions folders.
        character: The character.
        needed: Whether all motions must be on this machine; else specs without them are left out.

    Raises:
        MissingMotionDataError: Needed motions are not on this machine.
        DynrespError: There is no such spec, or motions cannot be read.
    """
    for name in names:
        path = find_graph_spec(name)
        try:
            graph = _built(path, tuple(folders), character)
        except MissingMotionDataError:
            if needed:
                raise
            continue
        yield path.stem, graph


@functools.lru_cache(maxsize=8)
def _built(path: Path, folders: tuple[Path, ...], character: Character) -> MotionGraph:
    """The graph of a spec; cached, since reading the motions takes most of the time."""
    return build_graph(read_graph_spec(path), folders, path.parent, character, lambda *_: None)


def recorded_database(motions: Path | None, character: Character) -> tuple[str, MotionDatabase]:
    """The frames of the first spec whose motions are on this machine.

    Args:
        motions: Motions folder.
        character: The character.

    Returns:
        Name of the spec, and its frames.

    Raises:
        DynrespError: Motions cannot be read.
    """
    for name, graph in graphs_at_hand(SPECS, motion_folders(motions), character):
        return name, graph.database
    raise MissingMotionDataError("built-in motion is missing; install dynresp again")


def about(spec: str, frames: int, recorded: int) -> str:
    """A sentence on the source of a database: the spec, and how many frames were recorded."""
    source = f"the {frames:,} frames are the first of the spec {spec!r}"
    if spec == SPECS[-1]:
        source += ", built-in motion and no motion capture"
    if frames > recorded:
        source = source.replace("the first of", f"{recorded:,} of")
        source += ", repeated with slow random deviations"
    return source + "."
