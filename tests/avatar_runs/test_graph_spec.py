import dataclasses
import itertools
from pathlib import Path

import pytest

from dynresp.avatar_runs.graph_spec import (
    GraphTable,
    find_graph_spec,
    graph_spec_names,
    read_graph_spec,
)
from dynresp.locomotion.graph.graph_config import LIMITS, Coordinates, GraphConfig
from dynresp.support.errors import SpecError, UnknownNameError


def written(folder: Path, text: str) -> Path:
    path = folder / "spec.toml"
    path.write_text(text)
    return path


SMALL = """
[graph]
name = "small"

[[motion]]
motion = "builtin:walk"
"""


def test_missing_keys_have_defaults(tmp_path: Path) -> None:
    spec = read_graph_spec(written(tmp_path, SMALL))
    assert spec.graph.config() == GraphConfig()
    assert spec.graph.world == "flat"
    assert spec.motion[0].motion == "builtin:walk"


def test_settings(tmp_path: Path) -> None:
    text = SMALL.replace(
        'name = "small"',
        'name = "small"\nfps = 30\nmirrored = true\ncoordinates = "blocks"\nsigma = 0.2\n'
        "contact_change = false\nblend_s = 0.2",
    )
    config = read_graph_spec(written(tmp_path, text)).graph.config()
    assert (config.fps, config.mirrored, config.sigma) == (30.0, True, 0.2)
    assert config.coordinates is Coordinates.BLOCKS
    assert config.keeps_local_maxima
    assert config.blend_rate_s == 0.2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name", "nam", r"graph\.nam is not a key of \[graph\] \(did you mean 'name'\?\)"),
        ('name = "small"', "", "graph.name is missing; say in a few words"),
        ("[[motion]]", "[motion]", r"motion: write \[\[motion\]\], with two brackets on each side"),
        ("[graph]", "[[graph]]", r"graph: expected a table \[graph\], got \["),
        ("[graph]", 'leave_out = "a.bvh"\n[graph]', "leave_out: expected a list in brackets, got"),
        ("[graph]", "leave_out = [3]\n[graph]", "leave_out: expected text in quotes, got 3"),
        ("[[motion]]", "[[motions]]", r"motions is not a key of the file"),
        ('"builtin:walk"', '"builtin:walk"\nstart_s = -1', "motion.start_s: expected a number"),
        ('"small"', '"small"\nfps = 0', "graph.fps: expected a number from 1 to 240 frames"),
        ('"small"', '"small"\nworld = "moon"', "graph.world: expected 'flat', 'terrain'"),
        ('"small"', '"small"\nblend_s = 0.1\nblend_rate_s = 0.2', "blend_rate_s must be at most"),
        (
            '"small"',
            '"small"\nmirrored = true\ncoordinates = "fixed"',
            "mirrored motion in fixed coordinates",
        ),
        ("[graph]", "[graph", "not valid TOML"),
    ],
)
def test_wrong_specs_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        read_graph_spec(written(tmp_path, SMALL.replace(old, new, 1)))


def test_a_spec_without_motions(tmp_path: Path) -> None:
    text = 'motion = []\n[graph]\nname = "small"\n'
    with pytest.raises(SpecError, match=r"motion: expected at least 1 table \[\[motion\]\], got 0"):
        read_graph_spec(written(tmp_path, text))


@pytest.mark.parametrize("name", graph_spec_names())
def test_specs_that_come_with_dynresp_are_right(name: str) -> None:
    spec = read_graph_spec(find_graph_spec(name))
    assert spec.graph.name
    assert spec.motion


def test_specs_are_found_by_name_or_file() -> None:
    assert find_graph_spec("some/spec.toml") == Path("some/spec.toml")
    with pytest.raises(UnknownNameError, match=r"unknown graph spec 'walkin'.*'walking'"):
        find_graph_spec("walkin")


def test_the_documented_settings_are_those_of_graphs() -> None:
    page = Path(__file__).parents[2] / "docs" / "locomotion.md"
    lines = page.read_text(encoding="utf-8").splitlines()
    begin = lines.index("| key | default | range | meaning |") + 2
    rows = list(itertools.takewhile(lambda line: line.startswith("|"), lines[begin:]))
    cells = [[cell.strip() for cell in row.split("|")] for row in rows]
    documented = {row[1].strip("`"): (row[2], row[3]) for row in cells}
    keys = set(GraphTable.model_fields) - {"name", "world"}
    assert set(documented) == keys
    # The size of blocks is that of the recorded terrain.
    settings = {field.name: field.default for field in dataclasses.fields(GraphConfig)}
    assert set(settings) == keys | {"block_m", "block_height_m"}
    for name, (default, limits) in documented.items():
        if name in LIMITS:
            assert float(default) == settings[name]
            assert limits == f"{LIMITS[name].low:g} to {LIMITS[name].high:g}"
        else:
            assert not limits
            assert default.startswith("by ") or default == f"`{str(settings[name]).lower()}`"
