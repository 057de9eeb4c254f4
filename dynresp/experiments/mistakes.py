"""Reading TOML files with bounds, and saying in words what is wrong with them."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from dynresp.errors import SpecError
from dynresp.experiments.values import shown

MAX_FILE_BYTES = 1 << 20
"""Largest file that is read [bytes]."""

_LISTED_MISTAKES = 8
_TYPES = {
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "tuple_type": "a list in brackets",
    "string_too_short": "at least one character",
}

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path, what: str, hint: str = "") -> dict[str, Any]:
    """Read a TOML file.

    Args:
        path: The file.
        what: What it is, with an article, such as "an experiment file".
        hint: A sentence for those who named no such file.

    Raises:
        SpecError: It cannot be read, is too large or not TOML. The message names the file.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise SpecError(f"{path}: {why}; expected {what} (.toml)" + hint) from None
    if len(data) > MAX_FILE_BYTES:
        name = what.partition(" ")[2]
        raise SpecError(f"{path} is larger than {MAX_FILE_BYTES // 1024} KiB; no {name} is")
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise SpecError(f"{path} is not text in UTF-8 (byte {error.start})") from None
    # Brackets nested deep enough exhaust the parser's stack.
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SpecError(f"{path} is not valid TOML: {error}") from None


def validate(
    model: type[Model],
    content: dict[str, Any],
    source: str,
    explain: Callable[[dict[str, Any]], str],
) -> Model:
    """Check the content of a file.

    Args:
        model: What it must be.
        content: What it says, as `tomllib` gives it.
        source: Name of the file, for messages.
        explain: Says one of pydantic's errors in words.

    Raises:
        SpecError: It says something that is not allowed; the message lists the first mistakes.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        mistakes = [explain(dict(item)) for item in error.errors()]
    more = len(mistakes) - _LISTED_MISTAKES
    lines = [f"{source}:", *mistakes[:_LISTED_MISTAKES]]
    lines += [f"and {more} more"] if more > 0 else []
    raise SpecError("\n  ".join(lines) if len(lines) > 2 else " ".join(lines))


def explain_value(error: dict[str, Any], where: str, kinds: Iterable[str]) -> str:
    """A mistake that is no unknown and no missing key, in words.

    Args:
        error: One of pydantic's.
        where: Its place in the file.
        kinds: The kinds of impacts that there can be.
    """
    kind, given, context = error["type"], error["input"], error.get("ctx", {})
    names = list(kinds)
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing; expected one of {', '.join(names)}"
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        return f"{where}.kind: expected one of {', '.join(names)}, got {tag!r}{near(tag, names)}"
    if kind == "value_error":
        said = str(error["msg"]).removeprefix("Value error, ")
        return f"{where}: {said}" if where else said
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{where}: expected a table [{where}], got {shown(given)}"
    if kind == "string_too_long":
        return f"{where}: expected at most {context['max_length']} characters, got {len(given)}"
    if kind == "literal_error":
        return f"{where}: expected {context['expected']}, got {shown(given)}"
    message = _TYPES.get(kind, str(error["msg"]).removeprefix("Input should be "))
    return f"{where}: expected {message}, got {shown(given)}"


def explain_in_tables(
    error: dict[str, Any],
    content: dict[str, Any],
    tables: Mapping[tuple[str, ...], type[BaseModel]],
    hints: Mapping[str, str],
) -> str:
    """One mistake of a file whose tables lie side by side, in words.

    Args:
        error: One of pydantic's.
        content: What the file says.
        tables: What each table may hold; () is the file itself.
        hints: By key, what to do where it is missing.
    """
    words: list[str] = []
    for part in error["loc"]:
        if isinstance(part, str):
            words.append(part)
        elif isinstance(content.get(words[-1]), list) and len(content[words[-1]]) > 1:
            words[-1] += f" {part + 1}"
    where = ".".join(words)
    keys = [part for part in error["loc"] if isinstance(part, str)]
    if error["type"] == "extra_forbidden":
        table = tuple(keys[:-1])
        what = f"[{'.'.join(table)}]" if table else "the file"
        return unknown_key(where, what, keys_of(tables[table]))
    if error["type"] == "missing":
        return f"{where} is missing; {hints.get(keys[-1], 'it is needed here')}"
    return explain_value(error, where, ())


def unknown_key(where: str, what: str, allowed: Iterable[str]) -> str:
    """A key that its table does not know, in words."""
    names = list(allowed)
    key = where.rpartition(".")[2]
    return f"{where} is not a key of {what}{near(key, names)}; allowed: {', '.join(names)}"


def keys_of(model: type[BaseModel]) -> list[str]:
    """Keys that a table may have."""
    return [field.alias or name for name, field in model.model_fields.items()]


def near(given: str, allowed: Iterable[str]) -> str:
    """A question whether another name was meant, if one is close."""
    found = difflib.get_close_matches(given, list(allowed), n=1)
    return f" (did you mean {found[0]!r}?)" if found else ""
