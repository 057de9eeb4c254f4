"""Figures of motion graphs: a table with a column for each graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from dynresp.bench.machine import machine_line
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character

FLAT = ("walking", "builtin")
"""Plans whose graphs walk on level ground."""
WORLDS = (*FLAT, "terrain", "stool", "playground")
"""All plans that come with dynresp."""

Value = float | int | str
"""One figure; its name ends in its unit. Shares are from 0 to 1."""


@dataclass(frozen=True)
class Measurement:
    """What a part of the benchmark measures.

    Attributes:
        measure: Gives the figures of a graph, with a character, a count, and a seed.
        plans: Of which plans' graphs, where their motions are at hand.
        count: Of how many frames, moments, paths or hits, where nothing else is asked for; 0 where
            there is nothing to count.
        asked: What a figure is to reach, by its name.
        notes: Sentences that say how to read the figures.
    """

    measure: Callable[[MotionGraph, Character, int, int], Mapping[str, Value]]
    plans: tuple[str, ...] = FLAT
    count: int = 0
    asked: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class GraphFigures:
    """What a part of the benchmark of motion graphs has measured.

    Attributes:
        part: Name of the part.
        columns: Figures by name, for each graph by the name of its plan.
        machine: See `describe_machine`.
        asked: What a figure is to reach, by its name.
        notes: Sentences that say how to read the figures.
    """

    part: str
    columns: Mapping[str, Mapping[str, Value]]
    machine: dict[str, object]
    asked: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def to_json(self) -> dict[str, object]:
        """All figures, for `json`."""
        return {
            "name": self.part,
            "graphs": {name: dict(column) for name, column in self.columns.items()},
            "asked": dict(self.asked),
            "machine": self.machine,
        }

    def to_text(self) -> str:
        """The report for people: machine, table, notes."""
        names = list(dict.fromkeys(name for column in self.columns.values() for name in column))
        rows = [["", *self.columns, "asked" if self.asked else ""]]
        for name in names:
            values = [_shown(column.get(name, "-")) for column in self.columns.values()]
            rows.append([name, *values, self.asked.get(name, "")])
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = [f"graph, {self.part}", f"  machine   {machine_line(self.machine)}"]
        for row in rows:
            middle = (
                cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True)
            )
            lines.append("  ".join(["", row[0].ljust(widths[0]), *middle, row[-1]]).rstrip())
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def _shown(value: Value) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int) or abs(value) >= 1e4:
        return f"{value:,.0f}"
    return f"{value:.4g}"
