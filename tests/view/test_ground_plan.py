from pathlib import Path

import matplotlib.image
import numpy as np
import numpy.typing as npt
import pytest

from dynresp.support.errors import DynrespError
from dynresp.view.body_shapes import BLOCK_COLOR, BOUNDS_COLOR, PATH_COLORS
from dynresp.view.ground_plan import write_ground_plan
from dynresp.view.story import Block, GroundPath, MovingCapsule, Story
from tests.view.samples import story_of, striding


def picture(story: Story, folder: Path, marks: tuple[float, ...] = ()) -> npt.NDArray[np.float32]:
    write_ground_plan(story, folder / "plan.png", marks)
    found: npt.NDArray[np.float32] = matplotlib.image.imread(folder / "plan.png")[..., :3]
    return found


def like(image: npt.NDArray[np.float32], color: tuple[float, float, float]) -> int:
    """How many pixels are about of a colour."""
    return int((np.abs(image - color).max(axis=-1) < 0.02).sum())


def test_the_bounds_are_drawn_whole(tmp_path: Path) -> None:
    walker = striding(60, 1.0)
    assert like(picture(story_of(walker), tmp_path), BOUNDS_COLOR) == 0
    image = picture(story_of(walker, bounds=(-4.0, -5.0, 8.0, 5.0)), tmp_path)
    assert like(image, BOUNDS_COLOR) > 1000
    # Along all four sides: long runs in two rows and in two columns that lie far apart.
    edge = np.abs(image - BOUNDS_COLOR).max(axis=-1) < 0.02
    for axis in (0, 1):
        long = np.flatnonzero(edge.sum(axis=axis) > 0.5 * edge.shape[axis])
        assert np.ptp(long) > 0.5 * edge.shape[1 - axis]


def test_blocks_bars_and_ways_are_drawn(tmp_path: Path) -> None:
    upright = np.tile([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0], (60, 1))
    bar = MovingCapsule("bar", 0.02, 1.0, np.tile([3.0, 2.0, 2.0], (60, 1)), upright)
    absent = MovingCapsule("arm", 0.02, 1.0, np.full((60, 3), np.nan), upright)
    story = story_of(
        striding(60, 1.0),
        blocks=[Block((-2.0, 0.0, 0.5), (1.0, 1.0, 0.5)), Block((-4.0, 0.0, 0.2), (1.0, 1.0, 0.2))],
        capsules=[bar, absent],
        paths=[
            GroundPath(name, np.array([[0.0, y], [3.0, y]])) for name, y in (("a", 1), ("b", 3))
        ],
    )
    image = picture(story, tmp_path, marks=(0.5, 1.0))
    assert like(image, BLOCK_COLOR) > 5000
    for color in PATH_COLORS:
        faint = tuple(1.0 - 0.45 * (1.0 - x) for x in color)
        assert like(image, (faint[0], faint[1], faint[2])) > 300


def test_a_long_walk_has_room_for_its_arrows(tmp_path: Path) -> None:
    dark = []
    for frames in (60 * 30, 600 * 30):
        image = picture(Story(striding(frames, 0.5)), tmp_path)
        dark.append(int((image.max(axis=-1) < 0.3).sum()))
    assert dark[1] < 1.5 * dark[0]


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DynrespError, match="cannot write"):
        write_ground_plan(story_of(striding(30, 1.0)), tmp_path / "file" / "x.png")
