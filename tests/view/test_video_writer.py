from __future__ import annotations

import re
import stat
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from dynresp.support.errors import DynrespError, UsageError
from dynresp.view import video_writer as video
from dynresp.view.story import Story
from dynresp.view.video_writer import RenderingUnavailableError, write_video


def fake_python(folder: Path, body: str) -> str:
    """A program that stands in for the worker's interpreter."""
    file = folder / "python"
    file.write_text(f"#!/bin/sh\n{body}\n")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return str(file)


@pytest.mark.slow
def test_a_film_that_plays_everywhere(
    tmp_path: Path, crowded_story: Story, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "video.mp4"
    seen: list[tuple[int, int]] = []
    try:
        write_video(
            crowded_story, file, (320, 240), progress=lambda done, total: seen.append((done, total))
        )
    except RenderingUnavailableError as error:
        pytest.skip(str(error))
    assert capfd.readouterr().out == ""
    assert [p.name for p in file.parent.iterdir()] == ["video.mp4"]
    assert seen[-1] == (30, 30)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    output = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(file)], capture_output=True, text=True
    ).stderr
    assert re.search(r"Video: h264.*yuv420p.*320x240.*30 fps", output), output
    duration = re.search(r"Duration: 00:00:(\d+\.\d+)", output)
    assert duration is not None
    assert float(duration.group(1)) == pytest.approx(1.0, abs=0.04)


def test_the_script_says_where_all_is(crowded_story: Story) -> None:
    script = video._script(crowded_story, (320, 240), 15.0)
    assert script["poses"].shape == (15, len(script["vertex_counts"]), 7)
    assert script["vertex_counts"].sum() == len(script["vertices"])
    # The arm is there for 25 of 30 frames.
    absent = [bool(row) for row in np.isnan(script["poses"][:, -1, 0])]
    assert absent == [False] * 13 + [True] * 2


def test_no_renderer(tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "_renderers", lambda: ["no-such-thing"])
    with pytest.raises(RenderingUnavailableError, match=r"no-such-thing.*libosmesa6.*libegl1"):
        write_video(story, tmp_path / "a.mp4", (64, 64))
    assert not list(tmp_path.iterdir())


def test_a_driver_that_crashes(
    tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video.sys, "executable", fake_python(tmp_path, "kill -SEGV $$"))
    with pytest.raises(RenderingUnavailableError, match=r"crashed \(signal 11\)"):
        write_video(story, tmp_path / "out" / "a.mp4", (64, 64))
    assert not list((tmp_path / "out").iterdir())


def test_a_driver_that_hangs(tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video.sys, "executable", fake_python(tmp_path, "exec sleep 30"))
    monkeypatch.setattr(video, "_renderers", lambda: ["egl"])
    monkeypatch.setattr(video, "_STALL_S", 0.3)
    with pytest.raises(RenderingUnavailableError, match=r"no picture within 0\.3 s"):
        write_video(story, tmp_path / "out" / "a.mp4", (64, 64))


def test_what_the_user_chose_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video.sys, "platform", "linux")
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert video._renderers() == ["osmesa", "egl"]
    monkeypatch.delenv("MUJOCO_GL")
    assert video._renderers() == ["egl", "osmesa"]


@pytest.mark.parametrize("size", [(321, 240), (0, 240), (320, 5000)])
def test_sizes_that_make_no_video(tmp_path: Path, story: Story, size: tuple[int, int]) -> None:
    with pytest.raises(UsageError, match="even"):
        write_video(story, tmp_path / "a.mp4", size)


def test_rates_that_make_no_video(tmp_path: Path, story: Story) -> None:
    with pytest.raises(UsageError, match="frame rate"):
        write_video(story, tmp_path / "a.mp4", fps=0.0)


def test_stray_lines_of_drivers_mean_nothing(
    tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch
) -> None:
    says = (
        r"printf 'libGL: hello\n1 2 3\n\377\376\n\ndynresp-video x y\ndynresp-video 5 30\n'; "
        'printf film > "$4"'
    )
    monkeypatch.setattr(video.sys, "executable", fake_python(tmp_path, says))
    seen: list[tuple[int, int]] = []
    file = tmp_path / "out" / "a.mp4"
    write_video(story, file, (64, 64), progress=lambda done, of: seen.append((done, of)))
    assert file.read_text() == "film"
    assert seen == [(5, 30)]


def test_no_process_can_be_started(
    tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video.sys, "executable", str(tmp_path / "gone"))
    with pytest.raises(RenderingUnavailableError, match="no process could be started"):
        write_video(story, tmp_path / "a.mp4", (64, 64))


def test_no_room_for_temporary_files(
    tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*words: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(video.np, "savez", full)
    with pytest.raises(DynrespError, match="temporary files: No space left"):
        write_video(story, tmp_path / "a.mp4", (64, 64))
    monkeypatch.setattr(video.tempfile, "mkdtemp", full)
    with pytest.raises(DynrespError, match="temporary files: No space left"):
        write_video(story, tmp_path / "a.mp4", (64, 64))
    assert not list(tmp_path.iterdir())
