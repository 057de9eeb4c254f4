import dataclasses
from typing import Any

import numpy as np
import pytest

from dynresp.errors import UsageError
from dynresp.locomotion.sketch.search import SearchConfig
from dynresp.locomotion.sketch.walking import SketchConfig
from dynresp.locomotion.worlds.maze import MazeConfig
from dynresp.locomotion.worlds.planning import PlanningConfig
from dynresp.locomotion.worlds.terrain_walk import TerrainWalkConfig

ALL = (SearchConfig, SketchConfig, PlanningConfig, MazeConfig, TerrainWalkConfig)


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("wrong", ["1", None, True, np.nan, np.inf, [1.0], np.ones(2)])
def test_what_is_no_number(kind: Any, wrong: object) -> None:
    for field in dataclasses.fields(kind):
        if field.type in ("float", "int"):
            with pytest.raises(UsageError, match=field.name):
                kind(**{field.name: wrong})


def test_what_is_a_number() -> None:
    assert SketchConfig(budget=np.int64(5), horizon_m=np.float32(2.0)).budget == 5
    assert MazeConfig(columns=3, cell_m=2).cell_m == 2
    with pytest.raises(UsageError, match=r"columns must be a whole number, got '2\.5'"):
        MazeConfig(columns=2.5)  # type: ignore[arg-type]


def test_settings_within_settings() -> None:
    with pytest.raises(UsageError, match="search must be a SearchConfig, got PlanningConfig"):
        SketchConfig(search=PlanningConfig())  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="stop must be a bool, got str"):
        SketchConfig(stop="no")  # type: ignore[arg-type]
