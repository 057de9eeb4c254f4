"""Draw the samples of a dataset spec: which base motion, which hit, when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynresp.datasets.dataset_spec import DatasetSpec, ImpactTable
from dynresp.physics.drawn_hits import draw_hits
from dynresp.physics.impact_spec import PushTable
from dynresp.physics.impacts import Impact
from dynresp.physics.prepared_impact import flight_s
from dynresp.specs.values import Choice, Number, Uniform, draw
from dynresp.support.errors import SpecError

TAIL_S = 1.0
"""A base motion lasts at least this long after a hit [s]: the servos track it while the simulation
looks ahead."""


@dataclass(frozen=True)
class Sample:
    """One hit of a spec.

    Attributes:
        index: Its number in the dataset, from 0.
        base: Which `[[base]]` of the spec is hit, from 0.
        table: Which `[[impact]]` of the spec it was drawn from, from 0.
        phase: When it hits, as a share of the times at which it can.
        values: The impact's keys and the drawn values; the keys name the units.
        impact: The same as an impact of the simulation.
    """

    index: int
    base: int
    table: int
    phase: float
    values: dict[str, Any]
    impact: Impact


def draw_sample(spec: DatasetSpec, durations: Sequence[float], index: int) -> Sample:
    """Draw a sample.

    It depends only on the spec, its seed and the index, not on the number of samples.

    Args:
        spec: What the samples are drawn from.
        durations: How long each base motion lasts [s].
        index: Which sample, from 0.
    """
    rng = np.random.default_rng((spec.plan.seed, index))
    base = _pick([item.weight for item in spec.base], rng)
    table = _pick([item.weight for item in spec.impact], rng)
    planned = spec.impact[table]
    phase = float(draw(planned.phase, rng))
    keys = [key for key in type(planned.hit).model_fields if key != "time_s"]
    values = {key: draw(getattr(planned.hit, key), rng) for key in keys}
    lead = lead_s(values.get("radius_m", 0.0), values.get("speed_m_s"))
    values["time_s"] = lead + phase * (durations[base] - TAIL_S - lead)
    # With all its values drawn, the table is that of an experiment of one hit.
    (hit,) = draw_hits(planned.hit.model_copy(update=values), 0, range(1))
    return Sample(index, base, table, phase, values, hit.impact)


def _pick(weights: Sequence[float], rng: np.random.Generator) -> int:
    """A random number from 0 to the number of weights - 1, with these weights."""
    bounds = np.cumsum(weights)
    # The last bound can be below the sum by rounding.
    found = int(np.searchsorted(bounds, rng.random() * bounds[-1], side="right"))
    return min(found, len(weights) - 1)


def lead_s(radius: float, speed: float | None) -> float:
    """How long before an impact its simulation begins [s], as `prepared_impact.prepare` has it.

    Args:
        radius: Of a ball or a fist [m].
        speed: Of a ball or a fist [m/s]; None for a push.
    """
    return 0.0 if speed is None else flight_s(radius, speed)


def check_durations(spec: DatasetSpec, durations: Sequence[float]) -> None:
    """Refuse base motions that are too short for the impacts of the spec, before any work.

    Raises:
        SpecError: Names the base motion, how long it lasts and how long it should.
    """
    needed = TAIL_S + max(_max_lead_s(planned) for planned in spec.impact)
    for base, duration in zip(spec.base, durations, strict=True):
        if duration < needed:
            raise SpecError(
                f"base: {base.title!r} lasts {duration:.2f} s; with these impacts a base motion "
                f"must last at least {needed:.2f} s, {TAIL_S:g} s of it after the hit"
            )


def _max_lead_s(planned: ImpactTable) -> float:
    hit = planned.hit
    if isinstance(hit, PushTable):
        return lead_s(0.0, None)
    return lead_s(_range_of(hit.radius_m)[1], _range_of(hit.speed_m_s)[0])


def _range_of(value: Number) -> tuple[float, float]:
    """The lowest and the highest value that a number can have."""
    if isinstance(value, Uniform):
        return value.low, value.high
    if isinstance(value, Choice):
        return min(value.values), max(value.values)
    return value, value
