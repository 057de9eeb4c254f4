"""From a plan to a graph: finding, loading and cutting its motions, and their contacts."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path, PurePosixPath

from dynresp.avatar_runs.graph_spec import GraphPlan
from dynresp.avatar_runs.world_setup import lay_out
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

_NAMED_MISSING = 5


def build_graph(
    plan: GraphPlan,
    folders: Sequence[Path],
    beside: Path,
    character: Character,
    progress: Progress,
    threads: int = 0,
) -> MotionGraph:
    """Build the graph of a plan.

    Args:
        plan: What it is made of.
        folders: Motions folders.
        beside: Folder of the plan's file, from which relative paths count first.
        character: The character.
        progress: Told the stage, how many are done, and of how many.
        threads: Threads, 0 for all cores.

    Raises:
        MissingMotionDataError: Motion files are not on this machine.
        SpecError: A name with wildcards leads out of the folders, or stands for built-in motion; or
            `leave_out` names what the plan does not hold.
        DynrespError: A file cannot be read, or there is no graph of what it holds.
    """
    spelled = [cut for given in plan.motion for cut in _spelled_out(given, folders, beside)]
    cuts = _taken(spelled, plan.leave_out)
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
    laid = lay_out(plan.graph.world, motions, character)
    progress("comparing frames", 0, 1)
    config = plan.graph.config()
    database = MotionDatabase.from_motions(
        laid.motions, character, config.fps, config.mirrored, laid.contacts, tuple(owed)
    )
    database = replace(database, world=plan.graph.world)
    return MotionGraph.from_database(database, config, character, threads)


def _spelled_out(given: MotionCut, folders: Sequence[Path], beside: Path) -> list[MotionCut]:
    """A table for each file that a name with wildcards stands for; else the table itself."""
    if not _has_wildcards(given.motion):
        return [given]
    if given.motion.startswith(BUILTIN_PREFIX):
        raise SpecError(
            f"motion: {given.motion!r} has wildcards, and built-in motions are named one by one, "
            f"in a [[motion]] each; there are {', '.join(builtin_names())}"
        )
    # A plan may lie in a home folder: only what the name spells out is looked through.
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


def _taken(spelled: list[MotionCut], leave_out: Sequence[str]) -> list[MotionCut]:
    """The tables but for what is left out."""
    named = {cut.motion for cut in spelled}
    for name in leave_out:
        if name not in named:
            close = difflib.get_close_matches(name, named, n=3, cutoff=0.3)
            meant = f"; the nearest are {', '.join(close)}" if close else ""
            raise SpecError(
                f"leave_out: {name!r} is none of the {len(named)} motions that the [[motion]] "
                f"tables stand for{meant}"
            )
    taken = [cut for cut in spelled if cut.motion not in leave_out]
    if not taken:
        raise SpecError("leave_out names all motions of the plan; leave some of them in")
    return taken


def _has_wildcards(name: str) -> bool:
    return any(sign in name for sign in "*?[")


def _refuse_missing(names: list[str], folders: Sequence[Path]) -> None:
    if not names:
        return
    looked = ", ".join(str(folder) for folder in folders) or "no folder: none is known"
    more = len(names) - _NAMED_MISSING
    told = ", ".join(names[:_NAMED_MISSING]) + (f" and {more} more" if more > 0 else "")
    raise MissingMotionDataError(
        f"the graph needs motion files that are not on this machine: {told} (looked in {looked}); "
        "name a folder that holds them with --motions or DYNRESP_MOTIONS, or build the graph of "
        "built-in motion with `dynresp graph build builtin`."
    )
