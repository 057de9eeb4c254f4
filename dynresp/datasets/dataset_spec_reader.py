"""Read a dataset spec from a TOML file and check it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import HIT, DatasetSpec
from dynresp.specs.toml_errors import Hints, read_spec, validate

_HINTS = Hints(
    missing={
        "plan": "add [plan] with name and count",
        "base": 'add [[base]] with motion = "builtin:walk" or another motion',
        "impact": "add [[impact]] with kind",
        "name": "describe the samples in a few words",
        "count": "give the number of samples",
        "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
    },
    inner=HIT,
    hidden=("time_s",),
)


def read_dataset_spec(path: Path | str) -> DatasetSpec:
    """Read a dataset spec.

    Args:
        path: A TOML file.

    Returns:
        What it says, checked.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    return read_spec(DatasetSpec, Path(path), "a dataset spec", _HINTS)


def parse_dataset_spec(content: dict[str, Any], source: str = "dataset spec") -> DatasetSpec:
    """Check the content of a dataset spec.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(DatasetSpec, content, source, _HINTS)
