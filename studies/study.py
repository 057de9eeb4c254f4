"""What a study is: what it measures, its targets, and the table of what it has measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

Value = float | int | str
"""One measured value; its name ends in its unit. Shares are from 0 to 1."""
Columns = Mapping[str, Mapping[str, Value]]
"""Values by name, for each thing that is measured (a graph, a group of people) by its name."""


@dataclass(frozen=True)
class Options:
    """What a user of a study may choose.

    Attributes:
        seed: Seed of all that is random.
        motions: Motions folder; None for `DYNRESP_MOTIONS` and what was fetched.
        quick: Measure little, to see whether the study runs; no figures for the documents.
        spec: The only graph spec that is measured, by name or file; None for all of the study.
        count: How many frames, moments, paths or hits; 0 for as many as the study states.
        say: Called with a line for people before each long step.
    """

    seed: int = 0
    motions: Path | None = None
    quick: bool = False
    spec: str | None = None
    count: int = 0
    say: Callable[[str], None] = lambda _: None


@dataclass(frozen=True)
class Target:
    """What a value is to reach.

    Attributes:
        value: Its name.
        words: The target for people, such as "at least 0.9".
        at_least: Lowest value that meets it; a text names another value of the same column.
        at_most: Highest value that meets it.
        column: The only column that has to meet it; empty for every column that has the value.
    """

    value: str
    words: str
    at_least: float | str | None = None
    at_most: float | None = None
    column: str = ""

    def missed_by(self, columns: Columns) -> list[str]:
        """The names of the columns that miss the target."""
        return [name for name, column in columns.items() if not self._met(name, column)]

    def _met(self, name: str, column: Mapping[str, Value]) -> bool:
        if self.value not in column or self.column not in ("", name):
            return True
        measured = float(column[self.value])
        least = column[self.at_least] if isinstance(self.at_least, str) else self.at_least
        if least is not None and measured < float(least):
            return False
        return self.at_most is None or measured <= self.at_most


@dataclass(frozen=True)
class Study:
    """One study.

    Attributes:
        name: Its name on the command line and of its file in `studies/results`.
        about: One line on what is measured.
        takes: About how long it takes on two cores.
        measure: Measures.
        targets: What its values are to reach.
        packages: Distributions whose versions matter for the result.
        notes: Sentences that say how to read the values.
    """

    name: str
    about: str
    takes: str
    measure: Callable[[Options], Columns]
    targets: Sequence[Target] = ()
    packages: Sequence[str] = ("numpy", "numba", "mujoco")
    notes: Sequence[str] = ()

    def to_text(self, columns: Columns, machine: str) -> str:
        """The report for people: machine, a table with a column for each thing, notes."""
        names = list(dict.fromkeys(name for column in columns.values() for name in column))
        rows = [["", *columns, "target" if self.targets else ""]]
        for name in names:
            shown = [_shown(column.get(name, "-")) for column in columns.values()]
            targets = [_verdict(target, columns) for target in self.targets if target.value == name]
            rows.append([name, *shown, "; ".join(targets)])
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = [f"{self.name}: {self.about}", f"  machine   {machine}"]
        for row in rows:
            middle = (
                cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True)
            )
            lines.append("  ".join(["", row[0].ljust(widths[0]), *middle, row[-1]]).rstrip())
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def _verdict(target: Target, columns: Columns) -> str:
    words = f"{target.column}: {target.words}" if target.column else target.words
    missed = target.missed_by(columns)
    return f"{words}, missed by {', '.join(missed)}" if missed else words


def _shown(value: Value) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int) or abs(value) >= 1e4:
        return f"{value:,.0f}"
    return f"{value:.4g}"
