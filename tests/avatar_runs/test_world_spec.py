import math
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.avatar_runs.world_spec import read_world
from dynresp.locomotion.worlds.obstacles import Obstacle
from dynresp.support.errors import SpecError

WORLD = """
[world]
bounds = [-1, -2, 10, 4.5]

[[box]]
center = [3, 0.5]
size = [2, 1]
turn_deg = 90

[[box]]
center = [6, 1]
size = [0.2, 3]
height_m = 0.4
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "world.toml"
    path.write_text(text)
    return path


def test_a_world(tmp_path: Path) -> None:
    world = read_world(written(tmp_path, WORLD))
    assert world.bounds == (-1.0, -2.0, 10.0, 4.5)
    assert world.obstacles[0] == Obstacle((3.0, 0.5), (1.0, 0.5), math.radians(90.0))
    assert world.obstacles[1].height == 0.4


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bounds = [-1, -2, 10, 4.5]", "", "world.bounds is missing"),
        ("[-1, -2, 10, 4.5]", "[-1, -2, 10]", r"world.bounds: expected 4 numbers in brackets"),
        ("[-1, -2, 10, 4.5]", "[5, -2, 1, 4]", "bounds must be"),
        ("[-1, -2, 10, 4.5]", "[-1e3, -1e3, 1e3, 1e3]", "sides of at most 400 m, got 2000 x 2000"),
        ("[-1, -2, 10, 4.5]", "[-1e5, -1, 1e5, 1]", "sides of at most 400 m, got 200000 x 2 m"),
        ("[-1, -2, 10, 4.5]", "[0, 0, 400, 101]", "at most 40000 m2, got 40400 m2; cut"),
        ("[2, 1]", "[2, nan]", "box 1.size: expected 2 numbers"),
        ("[2, 1]", "[2, -1]", "half_sizes of an obstacle must be 2 finite numbers above 0"),
        ("size = [0.2, 3]", "sizes = [0.2, 3]", r"sizes is not a key of \[box\]"),
        ("height_m = 0.4", "height_m = true", "box 2.height_m: expected a number"),
    ],
)
def test_wrong_worlds_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        read_world(written(tmp_path, WORLD.replace(old, new, 1)))


def test_a_box_needs_two_brackets(tmp_path: Path) -> None:
    text = WORLD[: WORLD.rindex("[[box]]")].replace("[[box]]", "[box]")
    with pytest.raises(SpecError, match=r"box: write \[\[box\]\], with two brackets on each side"):
        read_world(written(tmp_path, text))


def test_a_large_world_may_have_many_boxes(tmp_path: Path) -> None:
    box = "[[box]]\ncenter = [{0}, 1]\nsize = [{1}, {1}]\n"
    text = "[world]\nbounds = [0, 0, 200, 200]\n"
    many = "".join(box.format(k / 10, 0.1) for k in range(2000))
    assert len(read_world(written(tmp_path, text + many)).obstacles) == 2000
    large = "".join(box.format(k, 400) for k in range(40))
    with pytest.raises(SpecError, match=r"40 boxes are too large and too many"):
        read_world(written(tmp_path, text + large))


_NUMBERS = ("0", "-1", "1e400", "nan", "inf", "9" * 400)
_LISTS = ("[]", "[1]", "[1, 2]", "[1e308, -1e308]", "[-1, -2, 3, 4]", "[nan, 1]", "[[1, 2]]")
_VALUES = st.sampled_from((*_NUMBERS, *_LISTS, "true", '""', '["a", 1]', "{}", "1979-05-27"))
_NAMES = st.sampled_from(["bounds", "center", "size", "turn_deg", "height_m", "box", "world", "x"])
_HEADS = st.sampled_from(["[world]", "[[box]]", "[box]", "[[world]]", "[box.x]", ""])
_TABLES = st.lists(st.tuples(_HEADS, st.dictionaries(_NAMES, _VALUES, max_size=4)), max_size=4)


@given(_TABLES)
@settings(max_examples=200)
def test_whatever_a_file_holds_it_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, tables: list[tuple[str, dict[str, str]]]
) -> None:
    text = "".join(
        f"{head}\n" + "".join(f"{name} = {value}\n" for name, value in content.items())
        for head, content in tables
    )
    with suppress(SpecError):
        read_world(written(tmp_path_factory.mktemp("fuzz"), text))
