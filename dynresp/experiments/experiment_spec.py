"""The tables of an experiment file; `docs/experiments.md` explains them to users.

Units stand in the names of the keys. Times count from the start of the base motion as it is cut.
"""

from __future__ import annotations

from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, Field, PlainValidator

from dynresp.physics.impact_spec import AnyImpact
from dynresp.response.chooser import ChoiceTable
from dynresp.response.response_settings import SettingsTable
from dynresp.results.result_folder import Artefact
from dynresp.specs.shared_tables import BaseMotion, LibraryTable, Strict
from dynresp.specs.values import fixed, shown, whole

MAX_COUNT = 100_000
"""Most hits of one experiment."""


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


class ExperimentTable(Strict):
    """`[experiment]`: its name, and how many hits to draw from which seed."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    seed: Annotated[int, whole(0, 2**63 - 1)] = 0
    count: Annotated[int, whole(1, MAX_COUNT)] = 1
    show: Annotated[int, whole(0, 100)] = 3


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
