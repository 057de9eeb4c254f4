"""Checking a TOML file against its pydantic model, with errors in plain words.

Every error says where it is, what was given, and what is allowed.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from dynresp.specs.toml_reader import read_toml
from dynresp.specs.values import shown
from dynresp.support.errors import SpecError

# Most errors that one message lists.
_LISTED = 8
_TYPES = {
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "tuple_type": "a list in brackets",
    "list_type": "a list in brackets",
    "string_too_short": "at least one character",
}

Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Hints:
    """What errors about a kind of file need, beside its model.

    Attributes:
        missing: By key, what to do if it is missing.
        inner: A field of the model that stands for keys of the table around it; files do not
            have it.
        hidden: Keys of the model that files do not have either.
    """

    missing: Mapping[str, str] = field(default_factory=dict)
    inner: str = ""
    hidden: Sequence[str] = ()


def read_spec(
    model: type[Model], path: Path, what: str, hints: Hints, otherwise: str = ""
) -> Model:
    """Read and check a spec file.

    Args:
        model: What it must be.
        path: The file.
        what: What it is, with an article, such as "an experiment file".
        hints: For the words about its errors.
        otherwise: What else the user can do if there is no such file; follows the message.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    return validate(model, read_toml(path, what, otherwise), str(path), hints)


def validate(model: type[Model], content: dict[str, Any], source: str, hints: Hints) -> Model:
    """Check the content of a file.

    Args:
        model: What it must be.
        content: What it says, as `tomllib` gives it.
        source: Name of the file, for messages.
        hints: For the words about its errors.

    Raises:
        SpecError: It says something that is not allowed; the message lists the first errors.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = [dict(item) for item in error.errors()]
    # pydantic counts only the right tables of a list, and then also calls the list too short.
    lines = [_explain(item, model, content, hints) for item in found if not _miscounted(item)]
    more = len(lines) - _LISTED
    lines = [f"{source}:", *lines[:_LISTED], *([f"and {more} more"] if more > 0 else [])]
    raise SpecError("\n  ".join(lines) if len(lines) > 2 else " ".join(lines))


@dataclass(frozen=True)
class _Place:
    """Where an error is in the file.

    Attributes:
        keys: The keys and numbers that lead there, without what only the model has.
        around: The tables, one inside the other, that hold the last key; several where the keys
            of one stand in the other (`Hints.inner`).
        inside: The tables that can stand there.
        kind: The kind of the innermost table around it that comes in several kinds.
    """

    keys: list[int | str]
    around: list[type[BaseModel]]
    inside: list[type[BaseModel]]
    kind: str | None


def _place(model: type[BaseModel], location: Sequence[int | str], hints: Hints) -> _Place:
    keys: list[int | str] = []
    around: list[type[BaseModel]] = [model]
    outer: list[type[BaseModel]] = []
    inside: list[type[BaseModel]] = [model]
    kind: str | None = None
    inside_kind: str | None = None
    in_mapping = False
    for part in location:
        if isinstance(part, int) or in_mapping:
            keys.append(part)
            in_mapping = False
            continue
        of_kind = [table for table in inside if part in _kinds(table)]
        if len(inside) > 1 and of_kind:
            inside, inside_kind = of_kind, part
            continue
        around, outer = [*inside, *outer], []
        kind, inside_kind = inside_kind, None
        held = [f for t in inside for name, f in t.model_fields.items() if part in (f.alias, name)]
        if part == hints.inner and held:
            outer = around
        else:
            keys.append(part)
        inside = _tables_in(held[0].annotation) if held else []
        in_mapping = bool(held) and get_origin(held[0].annotation) is Mapping
    return _Place(keys, around, inside, kind)


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    """The tables that a field of this type can hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for inner in get_args(annotation) for table in _tables_in(inner)]


def _kinds(table: type[BaseModel]) -> list[str]:
    """The words by which a table of several kinds says which one it is."""
    annotations = [item.annotation for item in table.model_fields.values() if item.is_required()]
    return [word for a in annotations if get_origin(a) is Literal for word in get_args(a)]


def _explain(
    error: dict[str, Any], model: type[BaseModel], content: dict[str, Any], hints: Hints
) -> str:
    place = _place(model, error["loc"], hints)
    where = _where(place.keys, content)
    if error["type"] == "extra_forbidden":
        keys = [part for part in place.keys if isinstance(part, str)]
        table = ".".join(keys[:-1])
        what = f"[{table}]" if table else "the file"
        if place.kind:
            what = f"[{what}] of kind {place.kind!r}"
        names = [key for table in place.around for key in keys_of(table)]
        return _unknown_key(
            where, what, [n for n in names if n != hints.inner and n not in hints.hidden]
        )
    if error["type"] == "missing" and isinstance(place.keys[-1], int):
        count, given = place.keys[-1] + 1, shown(list(error["input"]))
        return f"{where}: expected at least {count} values in brackets, got {given}"
    if error["type"] == "missing":
        needed = "this kind of table needs it" if place.kind else "it is needed here"
        return f"{where} is missing; {hints.missing.get(str(place.keys[-1]), needed)}"
    return _explain_value(error, where, place.inside)


def _miscounted(error: dict[str, Any]) -> bool:
    """Whether a list that is long enough is called too short."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _where(keys: list[int | str], content: dict[str, Any]) -> str:
    """A place in words; a table is numbered where there are several of its name."""
    words: list[str] = []
    held: Any = content
    for part in keys:
        if isinstance(part, str):
            words.append(part)
            held = held.get(part) if isinstance(held, dict) else None
        else:
            if isinstance(held, list) and len(held) > 1:
                words[-1] += f" {part + 1}"
            held = held[part] if isinstance(held, list) and part < len(held) else None
    return ".".join(words)


def _explain_value(error: dict[str, Any], where: str, tables: list[type[BaseModel]]) -> str:
    """An error other than an unknown or a missing key, in words.

    Args:
        error: One of pydantic's.
        where: Its place in the file.
        tables: The tables, of one or several kinds, that belong there; or lists of them.
    """
    kind, given, context = error["type"], error["input"], error.get("ctx", {})
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        kinds = [word for table in tables for word in _kinds(table)]
        where += "." + str(context["discriminator"]).strip("'")
        if kind == "union_tag_not_found":
            return f"{where} is missing; expected one of {', '.join(kinds)}"
        tag = str(context.get("tag"))
        return f"{where}: expected one of {', '.join(kinds)}, got {tag!r}{near(tag, kinds)}"
    if kind == "value_error":
        message = str(error["msg"]).removeprefix("Value error, ")
        return f"{where}: {message}" if where else message
    if kind in ("list_type", "tuple_type") and tables:
        if isinstance(given, dict):
            return f"{where}: write [[{where}]], with two brackets on each side"
        return f"{where}: expected tables [[{where}]], got {shown(given)}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{where}: expected a table [{where}], got {shown(given)}"
    if kind == "string_too_long":
        return f"{where}: expected at most {context['max_length']} characters, got {len(given)}"
    if kind in ("too_short", "too_long"):
        bound = context["min_length"] if kind == "too_short" else context["max_length"]
        what = "table" if tables else "item"
        what += ("" if bound == 1 else "s") + (f" [[{where}]]" if tables else "")
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
    return [item.alias or name for name, item in model.model_fields.items()]


def near(given: str, allowed: Iterable[str]) -> str:
    """A question whether another name was meant, if one is close."""
    found = difflib.get_close_matches(given, list(allowed), n=1)
    return f" (did you mean {found[0]!r}?)" if found else ""
