"""Time the sides of a comparison, and report the result."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from dynresp.bench.machine import machine_line
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class Contender:
    """One side of a comparison.

    Attributes:
        name: Name under which its time is returned.
        call: What is timed.
        every: Timed in every n-th round only, so that a slow side takes part less often.
    """

    name: str
    call: Callable[[], object]
    every: int = 1


@dataclass(frozen=True)
class BenchResult:
    """The outcome of a benchmark.

    Attributes:
        name: Name of the benchmark.
        value: The measured value.
        unit: Unit of `value` and `baseline`.
        baseline: The same quantity for what it is compared with.
        baseline_name: What it is compared with.
        ratio: How many times better `value` is than `baseline`.
        machine: See `describe_machine`.
        more: Further values, by name.
        notes: Sentences on how to read the values.
    """

    name: str
    value: float
    unit: str
    baseline: float
    baseline_name: str
    ratio: float
    machine: dict[str, object]
    more: Mapping[str, float | int | str] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def to_json(self) -> dict[str, object]:
        """One flat object with all values, for `json`."""
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "baseline": self.baseline,
            "baseline_name": self.baseline_name,
            "ratio": self.ratio,
            **self.more,
            "machine": self.machine,
        }

    def to_text(self) -> str:
        """The report for people: machine, value, baseline, ratio, further values, notes."""
        lines = [
            f"{self.name}",
            f"  machine   {machine_line(self.machine)}",
            f"  measured  {self.value:.4g} {self.unit}",
            f"  baseline  {self.baseline:.4g} {self.unit} ({self.baseline_name})",
            f"  ratio     {self.ratio:.3g}",
        ]
        width = max((len(key) for key in self.more), default=0)
        for key, value in self.more.items():
            shown = f"{value:.4g}" if isinstance(value, float) else f"{value}"
            lines.append(f"  {key:<{width}}  {shown}")
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def median_seconds(contenders: Sequence[Contender], rounds: int) -> dict[str, float]:
    """Time all sides in turn, round after round, so that other load slows all of them alike.

    The caller warms up before (compilation, caches).

    Args:
        contenders: The sides.
        rounds: Number of rounds, at least one.

    Returns:
        Median duration of one call [s] for each name.

    Raises:
        UsageError: `rounds` is below one.
    """
    if rounds < 1:
        raise UsageError(f"rounds is {rounds}; a benchmark needs at least one.")
    seconds: dict[str, list[float]] = {contender.name: [] for contender in contenders}
    for number in range(rounds):
        for contender in contenders:
            if number % contender.every == 0:
                start = time.perf_counter()
                contender.call()
                seconds[contender.name].append(time.perf_counter() - start)
    return {name: statistics.median(times) for name, times in seconds.items()}
