"""Reading an experiment file, and saying in words what is wrong with it."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dynresp.errors import SpecError
from dynresp.experiments import spec
from dynresp.experiments.spec import Experiment
from dynresp.experiments.values import shown

MAX_FILE_BYTES = 1 << 20
"""Largest experiment file that is read [bytes]."""

_LISTED_MISTAKES = 8
_IMPACTS: dict[str, type[BaseModel]] = {
    "ball": spec.BallTable,
    "punch": spec.PunchTable,
    "push": spec.PushTable,
    "strike": spec.StrikeTable,
}
_TYPES = {
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "tuple_type": "a list in brackets",
    "string_too_short": "at least one character",
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
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise SpecError(
            f"{path}: {why}; expected an experiment file (.toml). "
            "`dynresp demo` shows one that works."
        ) from None
    if len(data) > MAX_FILE_BYTES:
        raise SpecError(
            f"{path} is larger than {MAX_FILE_BYTES // 1024} KiB; no experiment file is"
        )
    try:
        content = tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise SpecError(f"{path} is not text in UTF-8 (byte {error.start})") from None
    # Brackets nested deep enough exhaust the parser's stack.
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SpecError(f"{path} is not valid TOML: {error}") from None
    return parse_experiment(content, str(path))


def parse_experiment(content: dict[str, Any], source: str = "experiment") -> Experiment:
    """Check the content of an experiment file.

    Args:
        content: What the file says, as `tomllib` gives it.
        source: Name of the file, for messages.

    Raises:
        SpecError: It says something that is not allowed.
    """
    try:
        return Experiment.model_validate(content)
    except ValidationError as error:
        mistakes = [_explain(dict(item)) for item in error.errors()]
    more = len(mistakes) - _LISTED_MISTAKES
    lines = [
        f"{source}:",
        *mistakes[:_LISTED_MISTAKES],
        *([f"and {more} more"] if more > 0 else []),
    ]
    raise SpecError("\n  ".join(lines) if len(lines) > 2 else " ".join(lines))


def _explain(error: dict[str, Any]) -> str:
    """One mistake in words: where, what was given, what is allowed."""
    kind, given, context = error["type"], error["input"], error.get("ctx", {})
    # Of a list with one impact the number is left out, and so is the kind that pydantic adds.
    place = [part for part in error["loc"] if isinstance(part, str)]
    impact = place[1] if place[:1] == ["impact"] and place[1:2] and place[1] in _IMPACTS else None
    if impact:
        del place[1]
    where = ".".join(place)
    if kind == "extra_forbidden":
        return _unknown_key(place, impact)
    if kind == "missing":
        return f"{where} is missing; {_missing_hint(place)}"
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing; expected one of {_listed(_IMPACTS)}"
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        return (
            f"{where}.kind: expected one of {_listed(_IMPACTS)}, got {tag!r}{_near(tag, _IMPACTS)}"
        )
    if kind == "value_error":
        return f"{where}: {str(error['msg']).removeprefix('Value error, ')}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{where}: expected a table [{where}], got {shown(given)}"
    if kind == "literal_error":
        return f"{where}: expected {context['expected']}, got {shown(given)}"
    if kind in _TYPES:
        return f"{where}: expected {_TYPES[kind]}, got {shown(given)}"
    if kind == "string_too_long":
        return f"{where}: expected at most {context['max_length']} characters, got {len(given)}"
    message = str(error["msg"]).removeprefix("Input should be ")
    return f"{where}: expected {message}, got {shown(given)}"


def _unknown_key(place: list[str], impact: str | None) -> str:
    """A key that its table does not know."""
    *table, key = place
    if impact and table == ["impact"]:
        model = _IMPACTS[impact]
        what = f"[[impact]] of kind {impact!r}"
    else:
        model = _TABLES[tuple(table)]
        what = f"[{'.'.join(table)}]" if table else "the file"
    allowed = [field.alias or name for name, field in model.model_fields.items()]
    near = _near(key, allowed)
    return f"{'.'.join(place)} is not a key of {what}{near}; allowed: {_listed(allowed)}"


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


def _near(given: str, allowed: Iterable[str]) -> str:
    near = difflib.get_close_matches(given, list(allowed), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
