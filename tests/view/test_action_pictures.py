"""The picture of actions to choose from: its numbers cover neither each other nor the ways."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.view import action_pictures as options


@pytest.mark.parametrize("count", [1, 3, 6])
def test_numbers_lie_apart(count: int, rng: np.random.Generator) -> None:
    size = np.array([4.5, 5.0])
    for spread in (0.0, 0.1, 1.0):
        ends = size / 2.0 + rng.normal(0.0, spread, (count, 2))
        way = np.linspace([0.5, 0.5], ends[0], 100)
        taken = np.concatenate([way, ends])
        places = options._free_places(ends, taken, size)
        apart = np.linalg.norm(places[:, None] - places, axis=2) + 9.0 * np.eye(count)
        assert apart.min() > 2.0 * options._RADIUS
        assert np.linalg.norm(places - ends, axis=1).max() <= options._REACHES[-1] + 1e-9
        if spread == 1.0:
            clear = np.linalg.norm(places[:, None] - taken, axis=2).min(axis=1)
            assert clear.min() > 0.9 * options._RADIUS


def test_numbers_stay_on_the_sheet() -> None:
    corner = np.array([[0.1, 0.1]])
    place = options._free_places(corner, corner, np.array([4.0, 4.0]))[0]
    assert (place >= options._RADIUS - 1e-9).all()


def ways(*ends: tuple[float, float]) -> list[FloatArray]:
    return [np.linspace([0.0, 0.0, 0.9, 0.0], [x, y, 0.9, 1.0], 20) for x, y in ends]


def test_a_picture_of_ways_that_end_at_one_place(tmp_path: Path) -> None:
    pose = default_character().rest_pose
    actions = [(way, pose) for way in ways((1.0, 0.0), (1.0, 0.0), (1.0, 0.05))]
    options.write_action_pictures(actions, ["a", "b, in 1 s", "c"], tmp_path / "options.png")
    assert (tmp_path / "options.png").read_bytes().startswith(b"\x89PNG")
    assert [file.name for file in tmp_path.iterdir()] == ["options.png"]
