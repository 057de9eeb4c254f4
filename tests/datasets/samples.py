"""A small plan on built-in motions, and shards made up by the tests."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.dataset_spec_reader import parse_dataset_spec
from dynresp.datasets.shard_schema import Column, Columns, columns

PLAN = """\
[plan]
name = "A test"
seed = 5
count = 20

[library]
which = "builtin"

[[base]]
motion = "builtin:walk"
weight = 2

[[base]]
motion = "builtin:idle"

[[impact]]
kind = "ball"
mass_kg = { uniform = [3.0, 8.0] }
speed_m_s = { uniform = [4.0, 14.0] }
from_deg = { uniform = [0.0, 360.0] }
height_m = { uniform = [0.1, 1.7] }

[[impact]]
kind = "push"
weight = 0.5
force_n = { uniform = [50.0, 900.0] }
target = { choice = ["chest", "pelvis"] }
"""

LAYOUT: tuple[Column, ...] = columns(5, 3)
"""Of made-up shards: five features, three classes."""


def plan(**table: Any) -> DatasetSpec:
    """The spec above, its `[plan]` changed."""
    content = tomllib.loads(PLAN)
    content["plan"].update(table)
    return parse_dataset_spec(content)


def write_plan(folder: Path) -> Path:
    file = folder / "plan.toml"
    file.write_text(PLAN, encoding="utf-8")
    return file


def made_up(rows: int, first: int = 0, layout: tuple[Column, ...] = LAYOUT) -> Columns:
    """Contents of a shard at random, NaN and -1 among them."""
    rng = np.random.default_rng(rows)
    found: Columns = {}
    for column in layout:
        shape = column.shape(rows)
        if column.dtype[1] == "f":
            numbers = rng.normal(size=shape)
            numbers[rng.random(shape) < 0.1] = np.nan
        else:
            numbers = rng.integers(-1, 2, size=shape)
        found[column.name] = numbers.astype(column.dtype)
    found["index"] = np.arange(first, first + rows, dtype="<i8")
    return found


def command(*words: object) -> list[str]:
    """`dynresp generate` as a process of its own."""
    return [sys.executable, "-m", "dynresp", "generate", *(str(word) for word in words)]


def ran(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=600)


def files(folder: Path) -> dict[str, bytes]:
    """All files of a dataset."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}
