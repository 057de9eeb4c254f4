"""Reading a plan file, and saying in words what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import HIT, DatasetPlan
from dynresp.specs.toml_errors import Hints, read_spec, validate

_HINTS = Hints(
    missing={
        "plan": "add [plan] with name and count",
        "base": 'add [[base]] with motion = "builtin:walk" or another motion',
        "impact": "add [[impact]] with kind",
        "name": "say in a few words what the samples are",
        "count": "say how many samples there shall be",
        "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
    },
    inner=HIT,
    hidden=("time_s",),
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
    return read_spec(DatasetPlan, Path(path), "a plan file", _HINTS)


def parse_plan(content: dict[str, Any], source: str = "plan") -> DatasetPlan:
    """Check the content of a plan file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(DatasetPlan, content, source, _HINTS)
