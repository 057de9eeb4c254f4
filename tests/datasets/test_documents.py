"""docs/datasets.md says what is."""

import re
import tomllib
from pathlib import Path

import pytest

from dynresp.datasets.dataset_spec import KINDS, DatasetSpec
from dynresp.datasets.dataset_spec_reader import parse_dataset_spec
from dynresp.datasets.generation import Summary
from dynresp.datasets.shard_schema import columns
from dynresp.support.paths import example_specs

TEXT = (Path(__file__).parents[2] / "docs/datasets.md").read_text(encoding="utf-8")


def test_its_plan_is_right() -> None:
    (text,) = re.findall(r"^```toml\n(.*?)^```", TEXT, re.M | re.S)
    assert parse_dataset_spec(tomllib.loads(text)).plan.count == 5000


def test_all_columns_are_explained_in_order() -> None:
    (section,) = re.findall(r"^# The files.*?(?=^# )", TEXT, re.M | re.S)
    rows = re.findall(r"^\| (`[^|]*) \| ([a-z0-9\[\]]+) \|", section, re.M)
    documented = [(name, kind) for names, kind in rows for name in re.findall(r"`(\w+)`", names)]
    types = {"<i8": "int64", "<i4": "int32", "<i2": "int16", "|i1": "int8", "|b1": "bool",
             "<f8": "double", "<f4": "float"}  # fmt: skip
    widths = {3: "[3]", 7: "[features]", 5: "[classes]", 0: ""}
    assert documented == [(c.name, types[c.dtype] + widths[c.width]) for c in columns(7, 5)]


@pytest.mark.parametrize("table", ["plan", "base", "impact", "library", "settings"])
def test_all_tables_of_a_plan_are_explained(table: str) -> None:
    assert set(DatasetSpec.model_fields) == {"plan", "base", "impact", "library", "settings"}
    assert re.search(rf"^\| `\[+{table}\]+` \|", TEXT, re.M)


def test_all_numbers_of_the_summary_are_explained() -> None:
    for key in Summary(Path()).to_json():
        assert f"`{key}`" in TEXT, key


def test_all_example_plans_are_named() -> None:
    for file in (example_specs("datasets")).glob("*.toml"):
        assert f"`{file.stem}`" in TEXT, file
    for kind in KINDS:
        assert f'`"{kind}"`' in TEXT
