"""No command writes over, or removes, a file that is not its own."""

import json
import shutil
from pathlib import Path

import pytest

from ..datasets.samples import write_plan
from .conftest import Command
from .test_run import quick

SOMEBODYS = b"somebody's work of a week"
EXPERIMENT = """
[experiment]
name = "A ball on my own motion"
[base]
motion = "motion.npz"
[library]
which = "builtin"
[[impact]]
kind = "ball"
time_s = 0.8
mass_kg = 6.0
speed_m_s = 8.0
from_deg = 180.0
[output]
write = ["motion.npz", "motion.bvh"]
"""


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.fixture
def recording(tmp_path: Path, dynresp: Command) -> Path:
    """A folder with a recording of the user."""
    folder = tmp_path / "mine"
    assert dynresp("motions", "export", "builtin:walk", "--out", folder).exit_code == 0
    (folder / "walk.bvh").rename(folder / "mine.bvh")
    return folder


@pytest.mark.parametrize("more", [[], ["--overwrite"]], ids=["as it is", "overwrite"])
def test_export_keeps_the_recording(recording: Path, dynresp: Command, more: list[str]) -> None:
    before = contents(recording)
    result = dynresp("motions", "export", recording / "mine.bvh", "--out", recording, *more)
    assert result.exit_code == 2
    assert "mine.bvh is read by this command" in result.stderr
    assert contents(recording) == before


def test_import_keeps_what_it_reads_later(recording: Path, dynresp: Command) -> None:
    shutil.copy(recording / "mine.bvh", recording / "a.bvh")
    done = dynresp("motions", "import", recording / "mine.bvh", "--out", recording)
    assert done.exit_code == 0, done.stderr
    before = contents(recording)
    # a.npz is new, mine.npz is an input.
    files = [recording / "a.bvh", recording / "mine.npz"]
    result = dynresp("motions", "import", *files, "--out", recording, "--overwrite")
    assert result.exit_code == 2
    assert contents(recording) == before


@pytest.mark.parametrize("command", ["import", "export", "show"])
def test_files_that_exist_are_not_replaced(
    recording: Path, tmp_path: Path, dynresp: Command, command: str
) -> None:
    out = tmp_path / "out"
    name = {"import": "mine.npz", "export": "mine.bvh", "show": "filmstrip.png"}[command]
    out.mkdir()
    (out / name).write_bytes(SOMEBODYS)
    words = ("motions", command, recording / "mine.bvh", "--out", out)
    result = dynresp(*words)
    assert result.exit_code == 2
    assert f"{name} exists" in result.stderr
    assert contents(out) == {name: SOMEBODYS}
    assert dynresp(*words, "--overwrite").exit_code == 0
    assert (out / name).read_bytes() != SOMEBODYS


@pytest.mark.parametrize("more", [[], ["--overwrite"]], ids=["as it is", "overwrite"])
def test_run_keeps_the_motion_that_it_reads(
    tmp_path: Path, dynresp: Command, more: list[str]
) -> None:
    exported = dynresp("motions", "export", "builtin:walk", "--out", tmp_path, "--format", "npz")
    assert exported.exit_code == 0, exported.stderr
    (tmp_path / "walk.npz").rename(tmp_path / "motion.npz")
    file = tmp_path / "experiment.toml"
    file.write_text(EXPERIMENT)
    before = contents(tmp_path)
    result = dynresp("run", file, "--out", tmp_path, *more)
    assert result.exit_code == 2
    assert "motion.npz is read" in result.stderr
    assert contents(tmp_path) == before
    # Also where an earlier result has written it, and this one would only remove it.
    out = tmp_path / "out"
    assert dynresp("run", file, "--out", out).exit_code == 0
    file.write_text(
        EXPERIMENT.replace('"motion.npz"\n[lib', '"out/motion.npz"\n[lib').replace(
            '["motion.npz", "motion.bvh"]', '["motion.bvh"]'
        )
    )
    before = contents(tmp_path)
    result = dynresp("run", file, "--out", out, *more)
    assert result.exit_code == 2
    assert "motion.npz is read" in result.stderr
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["motion.npz", "result.json"])
def test_run_replaces_only_its_own(world: Path, dynresp: Command, name: str) -> None:
    file, out = quick(world, '"motion.npz"'), world / "out"
    words = ("run", file, "--out", out, "--motions", world / "motions")
    others = ["video.mp4", "table.csv", "recording.html", "summary.json", "notes.txt"]
    out.mkdir()
    for other in [*others, name]:
        (out / other).write_bytes(SOMEBODYS)
    before = contents(out)
    result = dynresp(*words)
    assert result.exit_code == 2
    assert name in result.stderr
    assert "--overwrite" in result.stderr
    assert "simulating" not in result.stderr  # before any work
    assert contents(out) == before
    assert dynresp(*words, "--overwrite").exit_code == 0
    # Its own are replaced the second time, and the others are left.
    assert dynresp(*words).exit_code == 0
    after = contents(out)
    assert sorted(after) == sorted([*others, "motion.npz", "result.json"])
    assert all(after[other] == SOMEBODYS for other in others)
    assert json.loads(after["result.json"])["files"] == {"motion.npz": "written"}


def test_generate_keeps_a_manifest_of_somebody(tmp_path: Path, dynresp: Command) -> None:
    out = tmp_path / "out"
    for name in ("manifest.json", "shard-00000.parquet"):
        out.mkdir()
        (out / name).write_bytes(b'{"name": "my web page"}')
        words = (
            "generate",
            write_plan(tmp_path),
            "--out",
            out,
            "--count",
            "1",
            "--motions",
            tmp_path,
        )
        result = dynresp(*words)
        assert result.exit_code == 2, result.stderr
        assert name in result.stderr
        assert contents(out) == {name: b'{"name": "my web page"}'}
        shutil.rmtree(out)


@pytest.mark.parametrize("words", [("graph", "build", "builtin", "--out")], ids=["graph"])
def test_another_kind_of_file_is_not_replaced(
    tmp_path: Path, dynresp: Command, words: tuple[str, ...]
) -> None:
    file = tmp_path / "mine.npz"
    file.write_bytes(SOMEBODYS)
    result = dynresp(*words, file)
    assert result.exit_code == 2
    assert "--overwrite" in result.stderr
    assert contents(tmp_path) == {"mine.npz": SOMEBODYS}
