from __future__ import annotations

import re
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from dynresp.support.errors import DynrespError
from dynresp.view.recording import write_recording
from dynresp.view.story import Story, StoryEvent
from tests.view.samples import striding


def test_a_page_that_needs_nothing_else(
    tmp_path: Path, story: Story, capfd: pytest.CaptureFixture[str]
) -> None:
    before = set(threading.enumerate())
    file = tmp_path / "new" / "recording.html"
    write_recording(story, file)
    assert capfd.readouterr().out == ""
    assert set(threading.enumerate()) <= before
    assert [p.name for p in file.parent.iterdir()] == ["recording.html"]
    page = file.read_text(encoding="utf-8")
    assert 0.5e6 < len(page) < 2e6
    assert "__VISER_EMBED_DATA__" in page
    # Addresses may be named (XML namespaces are), but nothing is loaded from one.
    assert not re.search(r"""(?:src|href|import)\s*[=(]\s*["'`]?(?:https?:)?//""", page)
    assert "Content-Security-Policy" in page
    assert "a &lt;ball&gt; &amp; a walk" in page
    assert "a <ball>" not in page
    assert "0.33 s contact" in page


def test_many_events_are_counted_in_the_heading(tmp_path: Path) -> None:
    events = [StoryEvent("contact", 0.1 * number) for number in range(9)]
    write_recording(Story(striding(40, 1.0), events=events), tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert page.count(" s contact") == 6
    assert " and 3 more</div>" in page


def test_a_second_character_and_an_arm(tmp_path: Path, crowded_story: Story) -> None:
    write_recording(crowded_story, tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size > 0.5e6


def test_fast_motions_are_thinned(tmp_path: Path) -> None:
    slow = striding(30, 1.0)
    write_recording(Story(slow), tmp_path / "slow.html")
    write_recording(Story(slow.resampled(240.0)), tmp_path / "fast.html")
    sizes = [(tmp_path / name).stat().st_size for name in ("slow.html", "fast.html")]
    assert sizes[1] < 1.1 * sizes[0]


def test_two_processes_at_once(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from dynresp.view.recording import write_recording\n"
        "from dynresp.view.story import Story\n"
        "from tests.view.samples import striding\n"
        "write_recording(Story(striding(20, 1.0)), sys.argv[1])\n"
    )
    files = [tmp_path / f"{n}.html" for n in range(2)]
    root = Path(__file__).resolve().parents[2]
    running = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(file)], cwd=root, stdout=subprocess.PIPE, text=True
        )
        for file in files
    ]
    assert [process.communicate(timeout=600)[0] for process in running] == ["", ""]
    assert [process.returncode for process in running] == [0, 0]
    assert all(file.stat().st_size > 0.5e6 for file in files)


def test_no_server_allowed(tmp_path: Path, story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(socket.socket, "bind", refuse)
    with pytest.raises(DynrespError, match=r"127\.0\.0\.1.*leave the\s+recording out"):
        write_recording(story, tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written(tmp_path: Path, story: Story) -> None:
    before = set(threading.enumerate())
    (tmp_path / "file").write_text("")
    with pytest.raises(DynrespError, match="cannot write"):
        write_recording(story, tmp_path / "file" / "a.html")
    assert set(threading.enumerate()) <= before
