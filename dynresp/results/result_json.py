"""JSON files of results: the same content gives the same bytes on every machine."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from dynresp import __version__
from dynresp.support.errors import DynrespError
from dynresp.support.files import replacing

_DIGITS = 6


def versions() -> dict[str, str]:
    """Versions of the packages that compute a response."""
    return {
        "dynresp": __version__,
        "mujoco": str(mujoco.__version__),
        "numpy": str(np.__version__),
    }


def write_json(content: dict[str, Any], path: Path) -> None:
    """Write an object as JSON, completely or not at all.

    Raises:
        DynrespError: The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(to_json(content) + "\n", encoding="utf-8")


def to_json(content: dict[str, Any]) -> str:
    """An object as JSON: floats with six decimals, null for those that are not finite."""
    text = json.dumps(_plain(content), indent=2, allow_nan=False, ensure_ascii=False)
    # Names of files need not be UTF-8, which JSON is.
    return text.encode(errors="replace").decode()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    raise DynrespError(f"a {type(value).__name__} cannot be written to a result: {value!r}")
