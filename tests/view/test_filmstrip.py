from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from dynresp.motion.motion import Motion
from dynresp.support.errors import DynrespError
from dynresp.view.filmstrip import write_filmstrip
from dynresp.view.story import Block, GroundPath, MovingCapsule, Story, StoryEvent, StoryPhase
from tests.view.samples import story_of, striding

SMALL = {"width_px": 700, "moments": 5}
FILES = ("a.png", "b.png")
BASE = (0.30, 0.50, 0.74)
"""Colour of a shirt during the base motion."""


def pixels_of(picture: np.ndarray, hue: tuple[float, float, float]) -> np.ndarray:
    """(height, width) which pixels have a hue, however bright."""
    flat = picture[..., :3]
    unit = flat / np.linalg.norm(flat, axis=-1, keepdims=True).clip(1e-6)
    return unit @ (np.array(hue) / np.linalg.norm(hue)) > 0.995


def test_a_picture_of_the_width_asked_for(
    tmp_path: Path, story: Story, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "filmstrip.png"
    write_filmstrip(story, file, **SMALL)
    picture = matplotlib.image.imread(file)
    assert picture.shape[1] == 700
    assert 200 < picture.shape[0] < 900
    assert [p.name for p in file.parent.iterdir()] == ["filmstrip.png"]
    assert capfd.readouterr().out == ""
    # Shirts in the colours of all four phases.
    for hue in (BASE, (0.90, 0.36, 0.17), (0.95, 0.71, 0.22), (0.22, 0.62, 0.48)):
        assert pixels_of(picture, hue).sum() > 300, hue


def test_a_second_character_and_an_arm(tmp_path: Path, crowded_story: Story) -> None:
    write_filmstrip(crowded_story, tmp_path / "a.png", **SMALL)
    assert matplotlib.image.imread(tmp_path / "a.png").shape[1] == 700


@pytest.mark.parametrize("frames", [1, 2])
def test_the_shortest_motions(tmp_path: Path, frames: int) -> None:
    write_filmstrip(Story(striding(frames, 1.0)), tmp_path / "a.png", **SMALL)
    picture = matplotlib.image.imread(tmp_path / "a.png")[..., :3]
    # A coloured figure stands on a grey floor.
    assert (np.ptp(picture, axis=-1) > 0.1).sum() > 300


def test_far_travel_needs_no_second_picture(tmp_path: Path) -> None:
    runner = story_of(striding(90, 4.0), events=[], phases=[])
    write_filmstrip(runner, tmp_path / "far.png", **SMALL)
    idler = story_of(striding(90, 0.0), events=[], phases=[])
    write_filmstrip(idler, tmp_path / "near.png", **SMALL)
    far, near = (matplotlib.image.imread(tmp_path / f"{n}.png") for n in ("far", "near"))
    assert far.shape[0] < 0.7 * near.shape[0]


def test_same_story_same_picture(tmp_path: Path, story: Story) -> None:
    for name in ("a.png", "b.png"):
        write_filmstrip(story, tmp_path / name, **SMALL)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_place_that_cannot_be_written(tmp_path: Path, story: Story) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DynrespError, match="cannot write"):
        write_filmstrip(story, tmp_path / "file" / "x.png", **SMALL)


def test_a_very_long_way_is_shown_twice(tmp_path: Path) -> None:
    # Side by side the figures stay as large as they are on a short way.
    for name, frames in (("short", 90), ("long", 900)):
        walker = story_of(striding(frames, 4.0), events=[], phases=[], spheres=[])
        write_filmstrip(walker, tmp_path / f"{name}.png", **SMALL)
    short, long = (shirt_rows(tmp_path / f"{name}.png") for name in ("short", "long"))
    assert long > short


def shirt_rows(file: Path) -> int:
    """How many rows of a picture a shirt is in, of the picture's longest such run."""
    picture = matplotlib.image.imread(file)[..., :3]
    blue = (picture[..., 2] > picture[..., 0] + 0.2).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], blue, [0]]).astype(int)))
    return int((edges[1::2] - edges[::2]).max())


def test_what_stands_is_in_the_lower_picture_and_the_picture_stays_small(tmp_path: Path) -> None:
    motion = striding(90, 0.0)
    alone = story_of(motion, events=[], phases=[], spheres=[])
    write_filmstrip(alone, tmp_path / "alone.png", **SMALL)
    # A wall far away, a bar above, and a world so large that no picture could hold it.
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (90, 1))
    among = story_of(
        motion, events=[], phases=[], spheres=[],
        blocks=[Block((0.0, 3.0, 0.5), (2.0, 0.1, 0.5)), Block((190.0, 0.0, 1.0), (1.0, 1.0, 1.0))],
        capsules=[MovingCapsule("bar", 0.02, 0.3, np.tile([0.0, 0.0, 2.6], (90, 1)), upright)],
        paths=[GroundPath("way", np.array([[-1.0, 0.5], [2.0, 0.5]]))],
        bounds=(-200.0, -200.0, 200.0, 200.0),
    )  # fmt: skip
    write_filmstrip(among, tmp_path / "among.png", **SMALL)
    before, after = (matplotlib.image.imread(tmp_path / f"{n}.png") for n in ("alone", "among"))
    assert before.shape[0] < after.shape[0] < 3 * before.shape[0]


def test_importing_the_views_imports_nothing_heavy() -> None:
    code = (
        "import sys, dynresp.view.filmstrip, dynresp.view.recording, dynresp.view.video_writer, "
        "dynresp.view.response_plots; print(*{'matplotlib', 'viser', 'scipy', 'trimesh', 'PIL'} "
        "& set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_figure_lying_down(tmp_path: Path) -> None:
    motion = striding(30, 0.0)
    poses = motion.poses.copy()
    poses[:, 2], poses[:, 3:7] = 0.12, (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    tall = []
    for shown in (motion, Motion(poses, motion.fps)):
        story = story_of(shown, events=[], phases=[StoryPhase("base motion", 0.0, shown.duration)])
        write_filmstrip(story, tmp_path / "a.png", **SMALL)
        shirt = pixels_of(matplotlib.image.imread(tmp_path / "a.png"), BASE)
        assert shirt.sum() > 300
        tall.append(np.ptp(np.flatnonzero(shirt.any(axis=1))))
    # A trunk that lies is less high than one that stands, though it is drawn as long.
    assert tall[1] < 0.7 * tall[0]


def test_dollar_signs_are_no_mathematics(tmp_path: Path) -> None:
    text = "price $\\foo{$ up"
    shown = story_of(striding(30, 1.3), title=text, subtitle=text, events=[StoryEvent(text, 0.3)])
    write_filmstrip(shown, tmp_path / "a.png", **SMALL)
    plain = story_of(striding(30, 1.3), title="", subtitle="", events=[StoryEvent("", 0.3)])
    write_filmstrip(plain, tmp_path / "b.png", **SMALL)
    # The title is written, in dark letters on white: there is more ink than without it.
    ink = [int((matplotlib.image.imread(tmp_path / n)[:40, :, 0] < 0.5).sum()) for n in FILES]
    assert ink[0] > ink[1] + 100
