"""Reading a plan file, and saying in words what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from dynresp.datasets.dataset_spec import HIT, DatasetPlan, PlannedBase, PlannedImpact, PlanTable
from dynresp.experiments import experiment_spec as spec
from dynresp.specs.toml_errors import Layout, keys_of, read_toml, validate


def _keys(hit: type[BaseModel]) -> list[str]:
    """Keys that an impact of a plan may have."""
    return [key for key in (*keys_of(hit), *keys_of(PlannedImpact)) if key not in ("time_s", HIT)]


_LAYOUT = Layout(
    tables={
        (): DatasetPlan,
        ("plan",): PlanTable,
        ("base",): PlannedBase,
        ("base", "or"): spec.MotionCut,
        ("impact",): PlannedImpact,
        ("library",): spec.LibraryTable,
        ("settings",): spec.SettingsTable,
    },
    hints={
        "plan": "add [plan] with name and count",
        "base": 'add [[base]] with motion = "builtin:walk" or another motion',
        "impact": "add [[impact]] with kind",
        "name": "say in a few words what the samples are",
        "count": "say how many samples there shall be",
        "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
    },
    kinds={
        "ball": _keys(spec.BallTable),
        "punch": _keys(spec.PunchTable),
        "push": _keys(spec.PushTable),
    },
    inner=HIT,
)


def read_plan(path: Path | str) -> DatasetPlan:
    """Read a plan file.

    Args:
        path: A TOML file.

    Returns:
        What it says, checked.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    path = Path(path)
    return parse_plan(read_toml(path, "a plan file"), str(path))


def parse_plan(content: dict[str, Any], source: str = "plan") -> DatasetPlan:
    """Check the content of a plan file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(DatasetPlan, content, source, _LAYOUT)
