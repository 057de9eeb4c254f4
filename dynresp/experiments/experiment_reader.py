"""Reading an experiment file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dynresp.experiments.experiment_spec import Experiment
from dynresp.specs.toml_errors import Hints, read_spec, validate

_HINTS = Hints(
    missing={
        "experiment": 'add [experiment] with name = "..."',
        "base": 'add [base] with motion = "builtin:walk" or another motion',
        "impact": "add [[impact]] with kind and time_s",
        "name": "say in a few words what the experiment shows",
        "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
        "time_s": "say when it hits, in seconds from the start of the base motion",
        "hit_s": "say when the fist is to hit, in seconds from the start of the striker's motion",
    },
)


def read_experiment(path: Path | str) -> Experiment:
    """Read an experiment file.

    Args:
        path: A TOML file.

    Returns:
        What it says, checked.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    hint = ". `dynresp demo` shows one that works."
    return read_spec(Experiment, Path(path), "an experiment file", _HINTS, hint)


def parse_experiment(content: dict[str, Any], source: str = "experiment") -> Experiment:
    """Check the content of an experiment file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(Experiment, content, source, _HINTS)
