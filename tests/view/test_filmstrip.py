from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from dynresp.errors import DynrespError
from dynresp.motion.motion import Motion
from dynresp.view.filmstrip import FilmstripConfig, settle, spread, write_filmstrip
from dynresp.view.story import Event, Story
from tests.view.samples import story_of, striding

SMALL = FilmstripConfig(width_px=700, moments=5)


def test_a_picture_of_the_width_asked_for(
    tmp_path: Path, story: Story, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "filmstrip.png"
    write_filmstrip(story, file, SMALL)
    picture = matplotlib.image.imread(file)
    assert picture.shape[1] == 700
    assert 200 < picture.shape[0] < 900
    assert [p.name for p in file.parent.iterdir()] == ["filmstrip.png"]
    assert capfd.readouterr().out == ""
    # Shirts in the colours of all four phases.
    for hue in ((0.30, 0.50, 0.74), (0.90, 0.36, 0.17), (0.95, 0.71, 0.22), (0.22, 0.62, 0.48)):
        flat = picture[..., :3].reshape(-1, 3)
        unit = flat / np.linalg.norm(flat, axis=1, keepdims=True).clip(1e-6)
        alike = unit @ (np.array(hue) / np.linalg.norm(hue)) > 0.995
        assert alike.sum() > 300, hue


def test_a_second_character_and_an_arm(tmp_path: Path, crowded_story: Story) -> None:
    write_filmstrip(crowded_story, tmp_path / "a.png", SMALL)
    assert matplotlib.image.imread(tmp_path / "a.png").shape[1] == 700


@pytest.mark.parametrize("frames", [1, 2])
def test_the_shortest_motions(tmp_path: Path, frames: int) -> None:
    write_filmstrip(Story(striding(frames, 1.0)), tmp_path / "a.png", SMALL)
    assert (tmp_path / "a.png").exists()


def test_far_travel_needs_no_second_picture(tmp_path: Path) -> None:
    runner = story_of(striding(90, 4.0), events=[], phases=[])
    write_filmstrip(runner, tmp_path / "far.png", SMALL)
    idler = story_of(striding(90, 0.0), events=[], phases=[])
    write_filmstrip(idler, tmp_path / "near.png", SMALL)
    far, near = (matplotlib.image.imread(tmp_path / f"{n}.png") for n in ("far", "near"))
    assert far.shape[0] < 0.7 * near.shape[0]


def test_same_story_same_picture(tmp_path: Path, story: Story) -> None:
    for name in ("a.png", "b.png"):
        write_filmstrip(story, tmp_path / name, SMALL)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_place_that_cannot_be_written(tmp_path: Path, story: Story) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DynrespError, match="cannot write"):
        write_filmstrip(story, tmp_path / "file" / "x.png", SMALL)


def test_spread_moves_only_to_the_right_and_clears() -> None:
    extents = np.array([[0.0, 1.0], [0.2, 1.4], [-1.0, 0.0], [9.0, 9.5]])
    shifts = spread(extents, 0.1)
    assert shifts[0] == 0
    assert (np.diff(shifts) >= 0).all()
    moved = extents + shifts[:, None]
    widths = np.diff(extents, axis=1)[:, 0]
    covered = moved[:-1, 1] - moved[1:, 0]
    assert (covered <= 0.1 * np.minimum(widths[1:], widths[:-1]) + 1e-12).all()
    np.testing.assert_array_equal(spread(extents[[0, 3]], 0.1), 0.0)


def test_labels_settle_without_overlap() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        anchors, widths = rng.uniform(0, 1, 9), rng.uniform(0.02, 0.1, 9)
        centers = settle(anchors, widths)
        order = np.argsort(anchors)
        gaps = np.diff(centers[order]) - 0.5 * (widths[order][1:] + widths[order][:-1])
        assert (gaps >= -1e-12).all()
        assert (centers - widths / 2 >= -1e-12).all()
        assert (centers + widths / 2 <= 1 + 1e-12).all()
    roomy = np.array([0.2, 0.8, 0.5])
    np.testing.assert_allclose(settle(roomy, np.full(3, 0.1)), roomy)


def test_importing_the_views_imports_nothing_heavy() -> None:
    code = (
        "import sys, dynresp.view.filmstrip, dynresp.view.recording, dynresp.view.video, "
        "dynresp.view.plots; print(*{'matplotlib', 'viser', 'scipy', 'trimesh', 'PIL'} "
        "& set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_numbers_stay_finite_for_a_figure_lying_down(tmp_path: Path) -> None:
    motion = striding(30, 0.0)
    poses = motion.poses.copy()
    poses[:, 2], poses[:, 3:7] = 0.12, (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    lying = story_of(Motion(poses, motion.fps))
    write_filmstrip(lying, tmp_path / "a.png", SMALL)
    assert np.isfinite(matplotlib.image.imread(tmp_path / "a.png")).all()


def test_dollar_signs_are_no_mathematics(tmp_path: Path) -> None:
    text = "price $\\foo{$ up"
    told = story_of(striding(30, 1.3), title=text, subtitle=text, events=[Event(text, 0.3)])
    write_filmstrip(told, tmp_path / "a.png", SMALL)
    assert (tmp_path / "a.png").exists()
