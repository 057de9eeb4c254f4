"""What an experiment file may say. `docs/experiments.md` explains it to those who write one.

Units stand in the names of the keys. Times count from the start of the base motion as it is cut.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, model_validator

from dynresp.response.budget import Budget
from dynresp.specs.values import Name, Number, fixed, name, number, shown, whole
from dynresp.support.errors import UnknownNameError

MAX_COUNT = 100_000
"""Most hits of one experiment."""

Artefact = Literal[
    "motion.npz",
    "motion.bvh",
    "recording.html",
    "filmstrip.png",
    "alignment.png",
    "video.mp4",
]
"""What can be written for each response, besides `result.json`."""


def _check_body(given: str) -> None:
    from dynresp.motion.character import default_character

    try:
        default_character().body(given)
    except UnknownNameError as error:
        raise ValueError(str(error)) from None


def _one_impact(given: Any) -> Any:
    if isinstance(given, list) and len(given) != 1:
        raise ValueError(
            f"an experiment takes one [[impact]], this one has {len(given)}; "
            "write several experiments, or draw one impact at random with count and ranges"
        )
    return given


def _video_size(given: Any) -> tuple[int, int]:
    # Video codecs halve the resolution of colour, so odd numbers will not do.
    expected = "[width, height], two even whole numbers from 64 to 4096"
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise ValueError(f"expected {expected}, got {shown(given)}")
    for pixels in given:
        if type(pixels) is not int or pixels % 2 or not 64 <= pixels <= 4096:
            raise ValueError(f"expected {expected}, got {shown(given)}")
    return given[0], given[1]


Body: TypeAlias = Annotated[Name, name(_check_body)]
Time: TypeAlias = Annotated[Number, number(0.0, 3600.0, "s")]
Bearing: TypeAlias = Annotated[Number, number(-360.0, 360.0, "degrees")]
Elevation: TypeAlias = Annotated[Number, number(-60.0, 89.0, "degrees")]
Height: TypeAlias = Annotated[Number | None, number(0.0, 2.5, "m")]
Offset: TypeAlias = Annotated[Number, number(-1.0, 1.0, "m")]


class Strict(BaseModel):
    """A table that knows its keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class ExperimentTable(Strict):
    """`[experiment]`: its name, and how many hits to draw from which seed."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    seed: Annotated[int, whole(0, 2**63 - 1)] = 0
    count: Annotated[int, whole(1, MAX_COUNT)] = 1
    show: Annotated[int, whole(0, 100)] = 3


def _as_table(given: Any) -> Any:
    return {"motion": given} if isinstance(given, str) else given


class MotionCut(Strict):
    """A motion, how to read its file, and which part of it is taken."""

    motion: Annotated[str, Field(min_length=1, max_length=1000)]
    start_s: Annotated[float, fixed(0.0, 1e5, "s")] = 0.0
    stop_s: Annotated[float | None, fixed(0.0, 1e5, "s")] = None
    mirrored: bool = False
    trim_t_pose: bool = False
    uneven_floor: bool = False
    asf: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    unit_m: Annotated[float | None, fixed(1e-4, 100.0, "m")] = None
    up: Literal["x", "y", "z"] | None = None
    fps: Annotated[float | None, fixed(1.0, 10_000.0, "frames a second")] = None

    @model_validator(mode="after")
    def _in_order(self) -> MotionCut:
        if self.stop_s is not None and self.stop_s <= self.start_s:
            raise ValueError(
                f"stop_s must be above start_s, got {self.stop_s:g} and {self.start_s:g}"
            )
        return self


class BaseMotion(MotionCut):
    """`[base]`: what the character does when it is hit."""

    otherwise: Annotated[MotionCut | None, BeforeValidator(_as_table)] = Field(None, alias="or")


class StrikerCut(MotionCut):
    """The second character's motion, and when and with which arm it strikes."""

    hit_s: Annotated[float, fixed(0.0, 3600.0, "s")]
    side: Literal["left", "right"] = "right"


class Striker(StrikerCut):
    """`[impact.striker]`: the second character."""

    otherwise: StrikerCut | None = Field(None, alias="or")


class ImpactTable(Strict):
    """What all kinds of impacts share."""

    kind: str
    time_s: Time
    from_deg: Bearing = 0.0


class BallTable(ImpactTable):
    """A thrown ball."""

    kind: Literal["ball"]
    mass_kg: Annotated[Number, number(0.05, 200.0, "kg")] = 6.0
    radius_m: Annotated[Number, number(0.02, 0.5, "m")] = 0.12
    speed_m_s: Annotated[Number, number(2.0, 30.0, "m/s")] = 8.0
    elevation_deg: Elevation = 0.0
    target: Body = "chest"
    height_m: Height = None
    offset_m: Offset = 0.0


class PunchTable(ImpactTable):
    """A fist-sized mass."""

    kind: Literal["punch"]
    mass_kg: Annotated[Number, number(0.05, 50.0, "kg")] = 2.9
    radius_m: Annotated[Number, number(0.02, 0.2, "m")] = 0.05
    speed_m_s: Annotated[Number, number(2.0, 20.0, "m/s")] = 9.0
    elevation_deg: Elevation = 0.0
    target: Body = "head"
    height_m: Height = None
    offset_m: Offset = 0.0


class PushTable(ImpactTable):
    """A force that rises and falls."""

    kind: Literal["push"]
    force_n: Annotated[Number, number(1.0, 10_000.0, "N")] = 600.0
    duration_s: Annotated[Number, number(0.02, 5.0, "s")] = 0.2
    elevation_deg: Elevation = 0.0
    target: Body = "chest"


class StrikeTable(ImpactTable):
    """A second character's recorded strike."""

    kind: Literal["strike"]
    target: Body = "head"
    striker: Striker


AnyImpact: TypeAlias = Annotated[
    BallTable | PunchTable | PushTable | StrikeTable, Field(discriminator="kind")
]


class LibraryTable(Strict):
    """`[library]`: which reactions are chosen from."""

    which: Annotated[str, Field(min_length=1, max_length=1000)] = "core"


class ChoiceTable(Strict):
    """`[choice]`: how much is spent on choosing, and with which classifier."""

    budget: Budget = "fast"
    classifier: Annotated[str, Field(min_length=1, max_length=1000)] | None = None


class SettingsTable(Strict):
    """`[settings]`: how simulation, search and blend run; what is left out keeps its default."""

    blend_s: Annotated[float | None, fixed(0.05, 2.0, "s")] = None
    second_pass: bool | None = None
    # The shortest reactions of the full library last a little longer.
    window_s: Annotated[float | None, fixed(0.05, 0.8, "s")] = None
    exit_min_s: Annotated[float | None, fixed(0.0, 3.0, "s")] = None
    exit_max_s: Annotated[float | None, fixed(0.0, 3.0, "s")] = None
    entry_step_s: Annotated[float | None, fixed(0.01, 1.0, "s")] = None
    entry_max_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    graze_speed_m_s: Annotated[float | None, fixed(0.0, 10.0, "m/s")] = None
    carry_on_max_error_m: Annotated[float | None, fixed(0.0, 100.0, "m")] = None
    carry_on_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    remaining_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    substeps: Annotated[int | None, whole(4, 100)] = None


class OutputTable(Strict):
    """`[output]`: what is written, and how."""

    write: Annotated[tuple[Artefact, ...], Field(strict=False)] = get_args(Artefact)
    lead_in_s: Annotated[float, fixed(0.2, 30.0, "s")] = 1.5
    video_size_px: Annotated[tuple[int, int], PlainValidator(_video_size)] = (960, 540)
    video_fps: Annotated[float, fixed(1.0, 60.0, "frames a second")] = 30.0


class Experiment(Strict):
    """A whole experiment file."""

    experiment: ExperimentTable
    base: BaseMotion
    impact: Annotated[tuple[AnyImpact], BeforeValidator(_one_impact), Field(strict=False)]
    library: LibraryTable = LibraryTable()
    choice: ChoiceTable = ChoiceTable()
    settings: SettingsTable = SettingsTable()
    output: OutputTable = OutputTable()
