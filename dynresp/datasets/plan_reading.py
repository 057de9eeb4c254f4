"""Reading a plan file, and saying in words what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from dynresp.datasets.plan import HIT, KINDS, Plan, PlannedBase, PlannedImpact, PlanTable
from dynresp.experiments import spec
from dynresp.experiments.mistakes import (
    explain_value,
    keys_of,
    read_toml,
    unknown_key,
    validate,
)

_HITS: Mapping[str, type[BaseModel]] = {
    "ball": spec.BallTable,
    "punch": spec.PunchTable,
    "push": spec.PushTable,
}
_TABLES: Mapping[tuple[str, ...], type[BaseModel]] = {
    (): Plan,
    ("plan",): PlanTable,
    ("base",): PlannedBase,
    ("base", "or"): spec.MotionCut,
    ("library",): spec.LibraryTable,
    ("settings",): spec.SettingsTable,
}
_HINTS = {
    "plan": "add [plan] with name and count",
    "base": 'add [[base]] with motion = "builtin:walk" or another motion',
    "impact": "add [[impact]] with kind",
    "name": "say in a few words what the samples are",
    "count": "say how many samples there shall be",
    "motion": 'give "builtin:walk", a path inside a motions folder, or a file',
}


def read_plan(path: Path | str) -> Plan:
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


def parse_plan(content: dict[str, Any], source: str = "plan") -> Plan:
    """Check the content of a plan file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    return validate(Plan, content, source, partial(_explain, content=content))


def _explain(error: dict[str, Any], content: dict[str, Any]) -> str:
    """One mistake in words: where, what was given, what is allowed."""
    place, hit = _place(error["loc"])
    where = _where(place, content)
    keys = [part for part in place if isinstance(part, str)]
    if error["type"] == "extra_forbidden":
        return _unknown_key(keys, where, hit)
    if error["type"] == "missing":
        return f"{where} is missing; {_HINTS.get(keys[-1], 'it is needed here')}"
    return explain_value(error, where, KINDS)


def _place(location: tuple[int | str, ...]) -> tuple[list[int | str], str | None]:
    """Where a mistake is in the file, without what only the model has; and the impact's kind."""
    place = list(location)
    hit = None
    if place[:1] == ["impact"] and place[2:3] == [HIT]:
        del place[2]
        if place[2:3] and place[2] in _HITS:
            hit = str(place.pop(2))
    return place, hit


def _where(place: list[int | str], content: dict[str, Any]) -> str:
    """A place in words; a table is numbered where there are several of its name."""
    words: list[str] = []
    for part in place:
        if isinstance(part, str):
            words.append(part)
        elif isinstance(content.get(words[-1]), list) and len(content[words[-1]]) > 1:
            words[-1] += f" {part + 1}"
    return ".".join(words)


def _unknown_key(keys: list[str], where: str, hit: str | None) -> str:
    """A key that its table does not know."""
    table = keys[:-1]
    if hit and table == ["impact"]:
        names = [*_HITS[hit].model_fields, *PlannedImpact.model_fields]
        allowed = [name for name in names if name not in ("time_s", HIT)]
        return unknown_key(where, f"[[impact]] of kind {hit!r}", allowed)
    what = f"[{'.'.join(table)}]" if table else "the file"
    return unknown_key(where, what, keys_of(_TABLES[tuple(table)]))
