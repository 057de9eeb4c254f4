import json
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.readers.npz import read_npz

from .conftest import Command


def test_show_tells_facts(world: Path, dynresp: Command) -> None:
    result = dynresp("motions", "show", world / "stand.npz", "--json")
    facts = json.loads(result.stdout)
    assert facts["frames"] == 121
    assert facts["fps"] == 30.0
    assert facts["duration_s"] == 4.0
    assert facts["file"] is None
    assert facts["t_poses_s"] == []
    assert facts["distance_m"] == pytest.approx(0.0, abs=1e-9)
    text = dynresp("motions", "show", "stand.npz", "--motions", world).stdout
    assert "4.00 s, 121 frames at 30 fps" in text


def test_show_finds_what_a_foreign_file_is(world: Path, dynresp: Command) -> None:
    result = dynresp("motions", "export", world / "stand.npz", "--out", world / "bvh")
    assert result.exit_code == 0, result.stderr
    file = Path(result.stdout.strip())
    assert file == world / "bvh" / "stand.bvh"
    facts = json.loads(dynresp("motions", "show", file, "--json").stdout)
    # Our own BVH files are in metres with Y up.
    assert facts["file"]["unit_m"] == 1.0
    assert facts["file"]["up"] == "y"
    assert facts["file"]["leg_m"] == pytest.approx(0.83, abs=0.05)


def test_show_reports_the_unit_and_axis_that_were_given(world: Path, dynresp: Command) -> None:
    made = dynresp("motions", "export", world / "stand.npz", "--out", world / "bvh").stdout.strip()
    options = ("--unit", 1.1, "--up", "y")
    facts = json.loads(dynresp("motions", "show", made, *options, "--json").stdout)
    assert facts["file"]["unit_m"] == 1.1
    assert facts["file"]["up"] == "y"
    assert facts["file"]["leg_m"] == pytest.approx(0.91, abs=0.06)


def test_show_draws(world: Path, dynresp: Command) -> None:
    result = dynresp("motions", "show", "builtin:walk", "--out", world / "shown")
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in (world / "shown").iterdir()} == {
        "recording.html", "filmstrip.png",
    }  # fmt: skip


def test_export_and_import_round(world: Path, dynresp: Command) -> None:
    bvh = dynresp("motions", "export", world / "stand.npz", "--out", world / "a").stdout.strip()
    result = dynresp("motions", "import", bvh, "--out", world / "b", "--json")
    assert result.exit_code == 0, result.stderr
    (row,) = json.loads(result.stdout)["imported"]
    before, after = read_npz(world / "stand.npz"), read_npz(row["written"])
    assert after.fps == before.fps
    # Retargeting settles the feet on the floor; the joints stay.
    turns = np.abs(np.sum(before.joint_quaternions * after.joint_quaternions, axis=-1))
    assert np.degrees(2 * np.arccos(np.minimum(turns, 1.0))).max() < 5.0


def test_export_writes_npz(world: Path, dynresp: Command) -> None:
    result = dynresp("motions", "export", "builtin:walk", "--format", "npz", "--out", world / "a")
    assert Path(result.stdout.strip()) == world / "a" / "walk.npz"
    assert read_npz(world / "a" / "walk.npz").name == "built-in: walk"


def test_import_takes_the_given_options(world: Path, dynresp: Command) -> None:
    bvh = dynresp("motions", "export", world / "stand.npz", "--out", world / "a").stdout.strip()
    options = ("--unit", 1, "--up", "y", "--fps", 60, "--uneven-floor", "--trim-t-pose")
    result = dynresp("motions", "import", bvh, "--out", world / "b", *options)
    assert result.exit_code == 0, result.stderr
    assert read_npz(result.stdout.strip()).fps == 60.0
    result = dynresp("motions", "import", world / "stand.npz", "--unit", 1, "--out", world / "c")
    assert result.exit_code == 2
    assert "leave them out" in result.stderr


@pytest.mark.parametrize("words", [("show",), ("export", "--out", "x"), ("import", "--out", "x")])
def test_files_that_are_not_there(dynresp: Command, words: tuple[str, ...], tmp_path: Path) -> None:
    command, *rest = words
    gone = tmp_path / "gone.bvh"
    result = dynresp("motions", command, gone, *rest)
    assert result.exit_code == 2
    assert "gone.bvh" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_name_that_is_nowhere(world: Path, dynresp: Command) -> None:
    result = dynresp("motions", "show", "gone.bvh", "--motions", world)
    assert result.exit_code == 1
    assert "no such motion in" in result.stderr
    result = dynresp("motions", "show", "builtin:wlak")
    assert result.exit_code == 2
    assert "Did you mean 'walk'" in result.stderr


def test_two_files_of_one_name(world: Path, dynresp: Command) -> None:
    files = world / "stand.npz", world / "motions" / ".." / "stand.npz"
    result = dynresp("motions", "import", *files, "--out", world / "b")
    assert result.exit_code == 2
    assert "more than one file" in result.stderr


def test_damaged_files(world: Path, dynresp: Command) -> None:
    file = world / "bad.bvh"
    file.write_bytes(b"HIERARCHY\nROOT x\n{")
    result = dynresp("motions", "show", file)
    assert result.exit_code == 2
    assert "bad.bvh" in result.stderr


def test_reactions_are_listed(world: Path, dynresp: Command) -> None:
    words = ("--library", world / "library.toml", "--motions", world / "motions")
    rows = json.loads(dynresp("reactions", "list", *words, "--json").stdout)["reactions"]
    assert [row["name"] for row in rows] == [
        "bend_back", "bend_back_mirrored", "bend_forward", "bend_forward_mirrored",
    ]  # fmt: skip
    assert "upper_body_front" in dynresp("reactions", "list", *words).stdout


def test_fetch_shows_licences_and_fetches_from_a_server(
    tmp_path: Path, dynresp: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    # No server listens there: what can be shown beforehand is, and the failure is one line.
    monkeypatch.setenv("DYNRESP_FETCH_URL", "http://127.0.0.1:9")
    from dynresp.motion.sources import download

    monkeypatch.setattr(download.time, "sleep", lambda seconds: None)
    result = dynresp("motions", "fetch", "core", "--motions", tmp_path / "motions")
    assert result.exit_code == 1
    assert "MIT" in result.stderr
    assert "files to fetch" in result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
