"""Draws hits from an `[[impact]]` table of a spec: random values, and the impact from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynresp.motion.motion import Motion
from dynresp.physics.impact_spec import BallTable, ImpactTable, PunchTable, PushTable, StrikeTable
from dynresp.physics.impacts import Ball, Impact, Punch, Push, Strike
from dynresp.specs.values import draw


@dataclass(frozen=True)
class Hit:
    """One hit of an experiment.

    Attributes:
        number: Its number in the experiment, from 0.
        values: The keys of the impact's table with the values of this hit; keys hold the units.
        impact: The impact with these values.
    """

    number: int
    values: dict[str, Any]
    impact: Impact


def draw_hits(
    table: ImpactTable,
    seed: int,
    numbers: range,
    strike: Motion | None = None,
    strike_s: float = 0.0,
    side: str = "right",
) -> list[Hit]:
    """Draw hits.

    A hit depends only on the seed and its number, not on how many hits there are.

    Args:
        table: The impact's table; random values are ranges.
        seed: Seed of the experiment.
        numbers: Numbers of the hits.
        strike: The second character's motion, for a strike.
        strike_s: Time in it at which the fist meets the target [s].
        side: The arm that strikes, "left" or "right".
    """
    hits = []
    for n in numbers:
        rng = np.random.default_rng((seed, n))
        keys = [key for key in type(table).model_fields if key != "striker"]
        values = {key: draw(getattr(table, key), rng) for key in keys}
        hits.append(Hit(n, values, _impact(table, values, strike, strike_s, side)))
    return hits


def _impact(
    table: ImpactTable, values: dict[str, Any], strike: Motion | None, strike_s: float, side: str
) -> Impact:
    time, bearing, target = values["time_s"], values["from_deg"], values["target"]
    if isinstance(table, BallTable | PunchTable):
        kind = Ball if isinstance(table, BallTable) else Punch
        return kind(
            time=time,
            speed=values["speed_m_s"],
            mass=values["mass_kg"],
            radius=values["radius_m"],
            from_deg=bearing,
            elevation_deg=values["elevation_deg"],
            target=target,
            height=values["height_m"],
            offset=values["offset_m"],
        )
    if isinstance(table, PushTable):
        return Push(
            time=time,
            force=values["force_n"],
            duration=values["duration_s"],
            from_deg=bearing,
            elevation_deg=values["elevation_deg"],
            target=target,
        )
    assert isinstance(table, StrikeTable)
    assert strike is not None
    return Strike(time, strike, strike_s, side, bearing, target)
