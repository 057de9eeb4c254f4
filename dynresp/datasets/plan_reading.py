"""Reading a plan file, and saying in words what is wrong with it."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dynresp.datasets.plan import HIT, KINDS, Plan, PlannedBase, PlannedImpact, PlanTable
from dynresp.errors import SpecError
from dynresp.experiments import spec
from dynresp.experiments.reading import MAX_FILE_BYTES
from dynresp.experiments.values import shown

_LISTED_MISTAKES = 8
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
_TYPES = {
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "tuple_type": "tables, each with its name in two brackets",
    "string_too_short": "at least one character",
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
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise SpecError(f"{path}: {why}; expected a plan file (.toml)") from None
    if len(data) > MAX_FILE_BYTES:
        raise SpecError(f"{path} is larger than {MAX_FILE_BYTES // 1024} KiB; no plan file is")
    try:
        content = tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise SpecError(f"{path} is not text in UTF-8 (byte {error.start})") from None
    # Brackets nested deep enough exhaust the parser's stack.
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SpecError(f"{path} is not valid TOML: {error}") from None
    return parse_plan(content, str(path))


def parse_plan(content: dict[str, Any], source: str = "plan") -> Plan:
    """Check the content of a plan file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    try:
        return Plan.model_validate(content)
    except ValidationError as error:
        mistakes = [_explain(dict(item), content) for item in error.errors()]
    more = len(mistakes) - _LISTED_MISTAKES
    lines = [f"{source}:", *mistakes[:_LISTED_MISTAKES]]
    lines += [f"and {more} more"] if more > 0 else []
    raise SpecError("\n  ".join(lines) if len(lines) > 2 else " ".join(lines))


def _explain(error: dict[str, Any], content: dict[str, Any]) -> str:
    """One mistake in words: where, what was given, what is allowed."""
    kind, given, context = error["type"], error["input"], error.get("ctx", {})
    place, hit = _place(error["loc"])
    where = _where(place, content)
    keys = [part for part in place if isinstance(part, str)]
    if kind == "extra_forbidden":
        return _unknown_key(keys, where, hit)
    if kind == "missing":
        return f"{where} is missing; {_HINTS.get(keys[-1], 'it is needed here')}"
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing; expected one of {', '.join(KINDS)}"
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        return f"{where}.kind: expected one of {', '.join(KINDS)}, got {tag!r}{_near(tag, KINDS)}"
    if kind == "value_error":
        said = str(error["msg"]).removeprefix("Value error, ")
        return f"{where}: {said}" if where else said
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{where}: expected a table, got {shown(given)}"
    if kind == "string_too_long":
        return f"{where}: expected at most {context['max_length']} characters, got {len(given)}"
    if kind == "literal_error":
        return f"{where}: expected {context['expected']}, got {shown(given)}"
    message = _TYPES.get(kind, str(error["msg"]).removeprefix("Input should be "))
    return f"{where}: expected {message}, got {shown(given)}"


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
    *table, key = keys
    if hit and table == ["impact"]:
        names = [*_HITS[hit].model_fields, *PlannedImpact.model_fields]
        allowed = [name for name in names if name not in ("time_s", HIT)]
        what = f"[[impact]] of kind {hit!r}"
    else:
        fields = _TABLES[tuple(table)].model_fields
        allowed = [field.alias or name for name, field in fields.items()]
        what = f"[{'.'.join(table)}]" if table else "the file"
    return f"{where} is not a key of {what}{_near(key, allowed)}; allowed: {', '.join(allowed)}"


def _near(given: str, allowed: Iterable[str]) -> str:
    near = difflib.get_close_matches(given, list(allowed), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""
