"""Reading TOML files with bounds, and saying in words what is wrong with them."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from dynresp.specs.values import shown
from dynresp.support.errors import SpecError

MAX_FILE_BYTES = 1 << 20
"""Largest file that is read [bytes]."""

_LISTED_MISTAKES = 8
_TYPES = {
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "tuple_type": "a list in brackets",
    "list_type": "a list in brackets",
    "string_too_short": "at least one character",
}

Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Layout:
    """What a kind of file may hold, as far as words for its mistakes need it.

    Attributes:
        tables: What each table may hold, by the keys that lead to it; () is the file itself.
        hints: By key, what to do where it is missing.
        kinds: By kind of impact, the keys that an `[[impact]]` of it may have.
        inner: Name of the field, which no file knows, that holds what the kinds differ in.
    """

    tables: Mapping[tuple[str, ...], type[BaseModel]]
    hints: Mapping[str, str]
    kinds: Mapping[str, Sequence[str]] = field(default_factory=dict)
    inner: str = ""


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


def validate(model: type[Model], content: dict[str, Any], source: str, layout: Layout) -> Model:
    """Check the content of a file.

    Args:
        model: What it must be.
        content: What it says, as `tomllib` gives it.
        source: Name of the file, for messages.
        layout: What it may hold.

    Raises:
        SpecError: It says something that is not allowed; the message lists the first mistakes.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = [dict(item) for item in error.errors()]
        # Of a list with wrong tables in it only the right ones are counted; that says nothing new.
        found = [item for item in found if not _miscounted(item)]
        mistakes = [_explain(item, content, layout) for item in found]
    more = len(mistakes) - _LISTED_MISTAKES
    lines = [f"{source}:", *mistakes[:_LISTED_MISTAKES]]
    lines += [f"and {more} more"] if more > 0 else []
    raise SpecError("\n  ".join(lines) if len(lines) > 2 else " ".join(lines))


def _explain(error: dict[str, Any], content: dict[str, Any], layout: Layout) -> str:
    """One of pydantic's errors in words: where, what was given, what is allowed."""
    place, impact = _place(error["loc"], layout)
    where = _where(place, content)
    keys = [part for part in place if isinstance(part, str)]
    if error["type"] == "extra_forbidden":
        table = tuple(keys[:-1])
        if impact and table == ("impact",):
            what = f"[[impact]] of kind {impact!r}"
            return _unknown_key(where, what, layout.kinds[impact])
        what = f"[{'.'.join(table)}]" if table else "the file"
        return _unknown_key(where, what, keys_of(layout.tables[table]))
    if error["type"] == "missing":
        needed = "this kind of impact needs it" if impact else "it is needed here"
        return f"{where} is missing; {layout.hints.get(keys[-1], needed)}"
    return _explain_value(error, where, tuple(keys) in layout.tables, list(layout.kinds))


def _miscounted(error: dict[str, Any]) -> bool:
    """Whether a list is called too short that is not."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _place(location: Sequence[int | str], layout: Layout) -> tuple[list[int | str], str | None]:
    """Where a mistake is in the file, without what only the model has; and the impact's kind."""
    place = list(location)
    if place[:1] != ["impact"]:
        return place, None
    if layout.inner and place[2:3] == [layout.inner]:
        del place[2]
    if place[2:3] and place[2] in layout.kinds:
        return [*place[:2], *place[3:]], str(place[2])
    return place, None


def _where(place: list[int | str], content: dict[str, Any]) -> str:
    """A place in words; a table is numbered where there are several of its name."""
    words: list[str] = []
    for part in place:
        if isinstance(part, str):
            words.append(part)
        elif isinstance(content.get(words[-1]), list) and len(content[words[-1]]) > 1:
            words[-1] += f" {part + 1}"
    return ".".join(words)


def _explain_value(error: dict[str, Any], where: str, table: bool, kinds: list[str]) -> str:
    """A mistake that is no unknown and no missing key, in words.

    Args:
        error: One of pydantic's.
        where: Its place in the file.
        table: Whether a table belongs there, or a list of them.
        kinds: The kinds of impacts that there can be.
    """
    kind, given, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing; expected one of {', '.join(kinds)}"
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        return f"{where}.kind: expected one of {', '.join(kinds)}, got {tag!r}{near(tag, kinds)}"
    if kind == "value_error":
        said = str(error["msg"]).removeprefix("Value error, ")
        return f"{where}: {said}" if where else said
    if kind in ("list_type", "tuple_type") and table:
        if isinstance(given, dict):
            return f"{where}: write [[{where}]], with two brackets on each side"
        return f"{where}: expected tables [[{where}]], got {shown(given)}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{where}: expected a table [{where}], got {shown(given)}"
    if kind == "string_too_long":
        return f"{where}: expected at most {context['max_length']} characters, got {len(given)}"
    if kind in ("too_short", "too_long"):
        bound = context["min_length"] if kind == "too_short" else context["max_length"]
        what = "table" if table else "item"
        what += ("" if bound == 1 else "s") + (f" [[{where}]]" if table else "")
        least = "least" if kind == "too_short" else "most"
        return f"{where}: expected at {least} {bound} {what}, got {len(given)}"
    if kind == "literal_error":
        return f"{where}: expected {context['expected']}, got {shown(given)}"
    message = _TYPES.get(kind, str(error["msg"]).removeprefix("Input should be "))
    return f"{where}: expected {message}, got {shown(given)}"


def _unknown_key(where: str, what: str, allowed: Iterable[str]) -> str:
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
