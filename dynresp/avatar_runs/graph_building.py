"""Building the graph of a spec: find, load and cut its motions, and find their contacts."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path, PurePosixPath

from dynresp.avatar_runs.graph_spec import GraphSpec
from dynresp.avatar_runs.world_setup import place_in_world
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.builtin import builtin_names
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.named_motion import BUILTIN_PREFIX, cut_record, find_motion, load_cut
from dynresp.motion.sources.motion_folders import (
    checked_relative_path,
    fits_pattern,
    list_motion_files,
)
from dynresp.specs.shared_tables import MotionCut
from dynresp.support.errors import MissingMotionDataError, SpecError
from dynresp.support.progress import Progress

# Most names of missing files in a message.
_MAX_NAMED = 5


def build_graph(
    spec: GraphSpec,
    folders: Sequence[Path],
    beside: Path,
    character: Character,
    progress: Progress,
    threads: int = 0,
) -> MotionGraph:
    """Build the graph of a spec.

    Args:
        spec: The spec.
        folders: Motions folders.
        beside: Folder of the spec's file; relative paths are looked up there first.
        character: The character.
        progress: Called with the stage, how many steps are done, and of how many.
        threads: Threads, 0 for all cores.

    Raises:
        MissingMotionDataError: Motion files are not on this machine.
        SpecError: A name with wildcards leads out of the folders, or stands for built-in motion; or
            `leave_out` names a motion that the spec does not have.
        DynrespError: A file cannot be read, or its motions make no graph.
    """
    expanded = [cut for given in spec.motion for cut in _expand(given, folders, beside)]
    cuts = _without(expanded, spec.leave_out)
    found = [find_motion(cut.motion, folders, beside) for cut in cuts]
    _refuse_missing([c.motion for c, f in zip(cuts, found, strict=True) if f is None], folders)
    motions: list[Motion] = []
    owed: dict[str, None] = {}
    for number, (cut, where) in enumerate(zip(cuts, found, strict=True)):
        assert where is not None
        progress("loading motions", number, len(cuts))
        motions.append(load_cut(cut, where, f"motion {number + 1}", character))
        about = cut_record(cut, where)
        if "credit" in about:
            owed[about["credit"]] = None
    progress("finding contacts", 0, 1)
    placed = place_in_world(spec.graph.world, motions, character)
    progress("comparing frames", 0, 1)
    config = spec.graph.config()
    database = MotionDatabase.from_motions(
        placed.motions, character, config.fps, config.mirrored, placed.contacts, tuple(owed)
    )
    database = replace(database, world=spec.graph.world)
    return MotionGraph.from_database(database, config, character, threads)


def _expand(given: MotionCut, folders: Sequence[Path], beside: Path) -> list[MotionCut]:
    """A table for each file that a name with wildcards stands for; otherwise the table itself."""
    if not _has_wildcards(given.motion):
        return [given]
    if given.motion.startswith(BUILTIN_PREFIX):
        raise SpecError(
            f"motion: {given.motion!r} has wildcards, and built-in motions are named one by one, "
            f"each in its own [[motion]]; there are {', '.join(builtin_names())}"
        )
    # A spec may be in a home folder: look only into the folders that the name spells out.
    parts = PurePosixPath(checked_relative_path(given.motion)).parts
    fixed = list(takewhile(lambda part: not _has_wildcards(part), parts[:-1]))
    for folder in (beside, *folders):
        below = folder.joinpath(*fixed)
        if not os.path.isdir(below):
            continue
        listed = list_motion_files(below, levels=len(parts) - len(fixed))
        names = [file.relative_to(folder).as_posix() for file in listed]
        matching = [name for name in names if fits_pattern(name, given.motion)]
        if matching:
            return [given.model_copy(update={"motion": name}) for name in matching]
    _refuse_missing([given.motion], folders)
    return []


def _without(cuts: list[MotionCut], leave_out: Sequence[str]) -> list[MotionCut]:
    """The tables without those that `leave_out` names."""
    named = {cut.motion for cut in cuts}
    for name in leave_out:
        if name not in named:
            close = difflib.get_close_matches(name, named, n=3, cutoff=0.3)
            meant = f"; the nearest are {', '.join(close)}" if close else ""
            raise SpecError(
                f"leave_out: {name!r} is not one of the {len(named)} motions that the [[motion]] "
                f"tables name{meant}"
            )
    kept = [cut for cut in cuts if cut.motion not in leave_out]
    if not kept:
        raise SpecError("leave_out names all motions of the spec; keep some of them")
    return kept


def _has_wildcards(name: str) -> bool:
    return any(sign in name for sign in "*?[")


def _refuse_missing(names: list[str], folders: Sequence[Path]) -> None:
    if not names:
        return
    looked = ", ".join(str(folder) for folder in folders) or "no folder: none is known"
    more = len(names) - _MAX_NAMED
    missing = ", ".join(names[:_MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
    raise MissingMotionDataError(
        f"the graph needs motion files that are not on this machine: {missing} (looked in "
        f"{looked}); name a folder that holds them with --motions or DYNRESP_MOTIONS, or build "
        "the graph of built-in motion with `dynresp graph build builtin`."
    )
