"""The `[[impact]]` tables of a spec; `docs/experiments.md` explains them.

Names of keys hold the units. Times count from the start of the base motion after its cut.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from dynresp.motion.character import default_character
from dynresp.specs.shared_tables import MotionCut, Strict
from dynresp.specs.values import Name, Number, fixed, name, number
from dynresp.support.errors import UnknownNameError


def _check_body(given: str) -> None:
    try:
        default_character().body(given)
    except UnknownNameError as error:
        raise ValueError(str(error)) from None


Body: TypeAlias = Annotated[Name, name(_check_body)]
Time: TypeAlias = Annotated[Number, number(0.0, 3600.0, "s")]
Bearing: TypeAlias = Annotated[Number, number(-360.0, 360.0, "degrees")]
Elevation: TypeAlias = Annotated[Number, number(-60.0, 89.0, "degrees")]
Height: TypeAlias = Annotated[Number | None, number(0.0, 2.5, "m")]
Offset: TypeAlias = Annotated[Number, number(-1.0, 1.0, "m")]


class StrikerCut(MotionCut):
    """The second character's motion, and when and with which arm it strikes."""

    hit_s: Annotated[float, fixed(0.0, 3600.0, "s")]
    side: Literal["left", "right"] = "right"


class Striker(StrikerCut):
    """`[impact.striker]`: the second character."""

    otherwise: StrikerCut | None = Field(None, alias="or")


class ImpactTable(Strict):
    """Keys of all kinds of impacts."""

    kind: str
    time_s: Time
    from_deg: Bearing = 0.0


class BallTable(ImpactTable):
    """A thrown ball, as `impacts.Ball`."""

    kind: Literal["ball"]
    mass_kg: Annotated[Number, number(0.05, 200.0, "kg")] = 6.0
    radius_m: Annotated[Number, number(0.02, 0.5, "m")] = 0.12
    speed_m_s: Annotated[Number, number(2.0, 30.0, "m/s")] = 8.0
    elevation_deg: Elevation = 0.0
    target: Body = "chest"
    height_m: Height = None
    offset_m: Offset = 0.0


class PunchTable(ImpactTable):
    """A mass of the size of a fist, as `impacts.Punch`."""

    kind: Literal["punch"]
    mass_kg: Annotated[Number, number(0.05, 50.0, "kg")] = 2.9
    radius_m: Annotated[Number, number(0.02, 0.2, "m")] = 0.05
    speed_m_s: Annotated[Number, number(2.0, 20.0, "m/s")] = 9.0
    elevation_deg: Elevation = 0.0
    target: Body = "head"
    height_m: Height = None
    offset_m: Offset = 0.0


class PushTable(ImpactTable):
    """A force that rises and falls, as `impacts.Push`."""

    kind: Literal["push"]
    force_n: Annotated[Number, number(1.0, 10_000.0, "N")] = 600.0
    duration_s: Annotated[Number, number(0.02, 5.0, "s")] = 0.2
    elevation_deg: Elevation = 0.0
    target: Body = "chest"


class StrikeTable(ImpactTable):
    """The recorded strike of a second character, as `impacts.Strike`."""

    kind: Literal["strike"]
    target: Body = "head"
    striker: Striker


AnyImpact: TypeAlias = Annotated[
    BallTable | PunchTable | PushTable | StrikeTable, Field(discriminator="kind")
]
