import math
from pathlib import Path

import pytest

from dynresp.errors import SpecError
from dynresp.graphs.world_file import read_world
from dynresp.locomotion.worlds.obstacles import Obstacle

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
    ("old", "new", "said"),
    [
        ("bounds = [-1, -2, 10, 4.5]", "", "world.bounds is missing"),
        ("[-1, -2, 10, 4.5]", "[-1, -2, 10]", r"world.bounds: expected 4 numbers in brackets"),
        ("[-1, -2, 10, 4.5]", "[5, -2, 1, 4]", "bounds must be"),
        ("[2, 1]", "[2, nan]", "box 1.size: expected 2 numbers"),
        ("[2, 1]", "[2, -1]", "sizes of an obstacle must be above 0"),
        ("size = [0.2, 3]", "sizes = [0.2, 3]", r"sizes is not a key of \[box\]"),
        ("height_m = 0.4", "height_m = true", "box 2.height_m: expected a number"),
    ],
)
def test_mistakes_are_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(SpecError, match=said):
        read_world(written(tmp_path, WORLD.replace(old, new, 1)))
