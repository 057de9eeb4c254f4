"""Reading an experiment file, and saying in words what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from dynresp.experiments import spec
from dynresp.experiments.mistakes import (
    explain_value,
    keys_of,
    read_toml,
    unknown_key,
    validate,
)
from dynresp.experiments.spec import Experiment

_IMPACTS: dict[str, type[BaseModel]] = {
    "ball": spec.BallTable,
    "punch": spec.PunchTable,
    "push": spec.PushTable,
    "strike": spec.StrikeTable,
}
# Which keys a table knows, by the names in the place of a mistake that lead to it.
_TABLES: dict[tuple[str, ...], type[BaseModel]] = {
    (): Experiment,
    ("experiment",): spec.ExperimentTable,
    ("base",): spec.BaseMotion,
    ("base", "or"): spec.MotionCut,
    ("impact", "striker"): spec.Striker,
    ("impact", "striker", "or"): spec.StrikerCut,
    ("library",): spec.LibraryTable,
    ("choice",): spec.ChoiceTable,
    ("settings",): spec.SettingsTable,
    ("output",): spec.OutputTable,
}


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
    path = Path(path)
    hint = ". `dynresp demo` shows one that works."
    return parse_experiment(read_toml(path, "an experiment file", hint), str(path))


def parse_experiment(content: dict[str, Any], source: str = "experiment") -> Experiment:
    """Check the content of an experiment file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(Experiment, content, source, _explain)


def _explain(error: dict[str, Any]) -> str:
    """One mistake in words: where, what was given, what is allowed."""
    # Of a list with one impact the number is left out, and so is the kind that pydantic adds.
    place = [part for part in error["loc"] if isinstance(part, str)]
    impact = place[1] if place[:1] == ["impact"] and place[1:2] and place[1] in _IMPACTS else None
    if impact:
        del place[1]
    where = ".".join(place)
    if error["type"] == "extra_forbidden":
        table = place[:-1]
        if impact and table == ["impact"]:
            return unknown_key(where, f"[[impact]] of kind {impact!r}", keys_of(_IMPACTS[impact]))
        what = f"[{'.'.join(table)}]" if table else "the file"
        return unknown_key(where, what, keys_of(_TABLES[tuple(table)]))
    if error["type"] == "missing":
        return f"{where} is missing; {_missing_hint(place)}"
    return explain_value(error, where, _IMPACTS)


def _missing_hint(place: list[str]) -> str:
    hints = {
        "experiment": 'add [experiment] with name = "..."',
        "base": 'add [base] with motion = "builtin:walk" or another motion',
        "impact": "add [[impact]] with kind and time_s",
        "name": "say in a few words what the experiment shows",
        "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
        "time_s": "say when it hits, in seconds from the start of the base motion",
        "hit_s": "say when the fist is to hit, in seconds from the start of the striker's motion",
    }
    return hints.get(place[-1], "this kind of impact needs it")
