"""Tables of the transitions of motion graphs: beside table 1 of the paper, and between sessions."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import study

from dynresp.locomotion.graph.motion_graph import MotionGraph

PAPER = {
    "maze": (8318, 394284, 32229, None, None, 31469),
    "terrain": (12879, 520193, 60130, None, None, 59043),
    "stool": (4576, 30058, 4964, None, None, 4831),
    "playground": (5971, 984152, 37209, 7091, None, 5458),
}
"""Table 1 of Lee et al. 2002: frames, and the jumps that each of `RULES` leaves."""
RULES = ("contact", "likelihood", "similarity", "feet", "component")

SESSIONS = {
    "back and forth": ("woddy2",),
    "starts, crossings, spirals": ("start_", "cross_", "spiral_"),
    "backward": ("Backward",),
    "forward": ("Forward",),
    "turns, circles, sideways": ("",),
}
"""Kinds of recorded walks, and parts of their names; the first that fits counts."""

Row = tuple[str, tuple[int | None, ...]]


def beside_the_paper(graphs: Mapping[str, MotionGraph]) -> list[Row]:
    """Rows of counts by world, the paper's and then ours; what walks on level ground is its maze."""
    rows: list[Row] = []
    for name, graph in graphs.items():
        paper = name if name in PAPER else "maze"
        c = graph.counts
        own = (c.frames, c.contact, c.likelihood, c.similarity, c.footing, c.component)
        rows += [(f"{paper}, paper", PAPER[paper]), (f"{name}, ours", own)]
    return rows


def print_counts(rows: list[Row]) -> None:
    """Print how many jumps each rule leaves."""
    study.table(
        ("", "frames", *RULES),
        [(said, *("-" if n is None else f"{n:,}" for n in numbers)) for said, numbers in rows],
    )


def print_shares(rows: list[Row]) -> None:
    """Print the same as shares of what the rule before has left, and jumps from a frame."""
    shares = []
    for said, (frames, *left) in rows:
        counted = [n for n in left if n is not None]
        parts = iter(study.percent(b / a, 2) for a, b in pairwise([frames**2, *counted]))
        of_each = ["-" if n is None else next(parts) for n in left]
        shares.append((said, *of_each, f"{counted[-1] / frames:.1f}"))
    study.table(("", *RULES, "jumps / frame"), shares)


def print_between_sessions(graph: MotionGraph) -> None:
    """Print how many jumps lead from walks of one session to walks of another."""
    database = graph.database
    session = np.array(
        [
            next(
                k for k, parts in enumerate(SESSIONS.values()) if any(p in clip.name for p in parts)
            )
            for clip in database.clips
        ]
    )[database.clip_of]
    jumps = database.successors[graph.sources] != graph.targets
    between = np.zeros((len(SESSIONS), len(SESSIONS)), dtype=int)
    np.add.at(between, (session[graph.sources[jumps]], session[graph.targets[jumps]]), 1)
    rows = [(said, *(f"{n:,}" for n in line)) for said, line in zip(SESSIONS, between, strict=True)]
    study.table(("jumps from, to", *(said.split(",")[0] for said in SESSIONS)), rows)
