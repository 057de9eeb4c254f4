import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dynresp.motion.readers.bvh import read_bvh
from dynresp.motion.readers.npz import read_npz

from .conftest import Command

FILES = (
    "motion.npz",
    "motion.bvh",
    "recording.html",
    "filmstrip.png",
    "alignment.png",
)
PNG = b"\x89PNG\r\n\x1a\n"


def quick(world: Path, what: str = "") -> Path:
    """The experiment of this folder, writing little."""
    file = world / "experiment.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[output]\n", f"[output]\nwrite = [{what}]\n"), encoding="utf-8")
    return file


@pytest.mark.slow
def test_a_whole_run(world: Path, dynresp: Command) -> None:
    out = world / "out"
    result = dynresp(
        "run", world / "experiment.toml", "--out", out, "--motions", world / "motions", "--json"
    )
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert json.loads((out / "result.json").read_text(encoding="utf-8")) == content
    for name in FILES:
        assert content["files"][name] == "written"
    frames = content["motion"]["frames"]
    assert len(read_npz(out / "motion.npz")) == frames
    assert read_bvh(out / "motion.bvh").frames == frames
    assert (out / "filmstrip.png").read_bytes().startswith(PNG)
    assert (out / "alignment.png").read_bytes().startswith(PNG)
    page = (out / "recording.html").read_text(encoding="utf-8")
    assert "<html" in page
    # Where the machine cannot render, a message says so, and it still is a success.
    if content["files"]["video.mp4"] == "written":
        assert b"ftyp" in (out / "video.mp4").read_bytes()[:16]
    else:
        assert "video.mp4 not written" in result.stderr
        assert not (out / "video.mp4").exists()
    assert "simulating" in result.stderr
    assert {path.name for path in out.iterdir()} <= {*FILES, "video.mp4", "result.json"}


def test_results_are_printed_in_plain_words(world: Path, dynresp: Command) -> None:
    file, out = quick(world), world / "out"
    result = dynresp("run", file, "--out", out, "--motions", world / "motions")
    assert result.exit_code == 0, result.stderr
    for word in (
        "A test",
        "contact",
        "s of the base motion",
        "outcome",
        "exit",
        "entry",
        "blend",
        "mismatch",
        "summed over 14 bodies, averaged over 0.33 s",
        "seams",
        "shakes",
        "ground",
        "result.json",
    ):
        assert word in result.stdout


def test_a_batch_is_printed_in_plain_words(world: Path, dynresp: Command) -> None:
    file = quick(world)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("seed = 3", "count = 3\nshow = 1"), encoding="utf-8")
    result = dynresp("run", file, "--out", world / "out", "--motions", world / "motions")
    assert result.exit_code == 0, result.stderr
    for word in (
        "outcomes",
        "speed_step_ratio",
        "root_shake_m",
        "summary.json",
        "table.csv",
    ):
        assert word in result.stdout
    assert "MISSED" not in result.stdout
    result = dynresp("run", file, "--out", world / "o", "--motions", world / "motions", "--json")
    assert json.loads(result.stdout)["responses"] == 3


def test_the_seed_of_the_command_line_counts(world: Path, dynresp: Command) -> None:
    file = quick(world)
    words = ("run", file, "--out", world / "out", "--motions", world / "motions", "--json")
    assert json.loads(dynresp(*words).stdout)["seed"] == 3
    assert json.loads(dynresp(*words, "--seed", 11).stdout)["seed"] == 11


def test_a_wrong_file_says_which_key(world: Path, dynresp: Command) -> None:
    file = world / "experiment.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("mass_kg = 6", "mass_kg = -6"), encoding="utf-8")
    result = dynresp("run", file, "--out", world / "out")
    assert result.exit_code == 2
    assert result.stderr == (
        f"dynresp: {file}: impact.mass_kg: expected a number from 0.05 to 200 kg, got -6\n"
    )
    assert not (world / "out").exists()


def test_a_missing_motion_is_something_that_could_not_be_done(
    world: Path, dynresp: Command
) -> None:
    file = world / "experiment.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('"stand.npz"', '"walk/gone.bvh"'), encoding="utf-8")
    result = dynresp("run", file, "--out", world / "out", "--motions", world / "motions")
    assert result.exit_code == 1
    assert "'walk/gone.bvh' is not on this machine" in result.stderr
    assert "--motions" in result.stderr


def test_results_go_into_a_folder(world: Path, dynresp: Command) -> None:
    result = dynresp("run", world / "experiment.toml", "--out", world / "stand.npz")
    assert result.exit_code == 2
    assert "expected a folder for the results" in result.stderr


def test_divergence_of_all_is_a_failure(
    world: Path, dynresp: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dynresp.experiments import runner
    from dynresp.physics.trace import Divergence
    from dynresp.response.response import Response

    respond_well = runner.Responder.respond

    def respond(self: object, *rest: object) -> list[Response]:
        return [
            Response(r.motion.slice(0, r.start + 5), r.start, r.prepared,
                     diverged=Divergence(4, "BADQVEL"))
            for r in respond_well(self, *rest)  # type: ignore[arg-type]
        ]  # fmt: skip

    monkeypatch.setattr(runner.Responder, "respond", respond)
    file = quick(world, '"motion.npz"')
    words = ("run", file, "--out", world / "out", "--motions", world / "motions")
    result = dynresp(*words)
    assert result.exit_code == 1
    assert "diverged (BADQVEL)" in result.stdout
    assert (world / "out" / "motion.npz").exists()


def test_what_could_not_be_written_is_a_failure(world: Path, dynresp: Command) -> None:
    file, out = quick(world, '"motion.npz", "motion.bvh"'), world / "out"
    (out / "motion.bvh").mkdir(parents=True)
    result = dynresp("run", file, "--out", out, "--motions", world / "motions", "--json")
    assert result.exit_code == 1
    assert "dynresp: motion.bvh failed: cannot write" in result.stderr
    assert "Traceback" not in result.stderr
    assert json.loads(result.stdout)["files"]["motion.npz"] == "written"
    assert (out / "result.json").exists()


def test_nobodys_home_folder(world: Path, dynresp: Command) -> None:
    file = quick(world)
    words = ("run", file, "--out", world / "out", "--motions", "~nobody.here/motions")
    result = dynresp(*words)
    assert result.exit_code == 2
    assert "(--motions): '~nobody.here/motions'" in result.stderr
    assert "nobody's home folder" in result.stderr


@pytest.mark.slow
def test_the_demo_needs_no_network_and_little_time(tmp_path: Path) -> None:
    environment = {
        **{key: value for key, value in os.environ.items() if key != "DYNRESP_MOTIONS"},
        "DYNRESP_CACHE": str(tmp_path / "cache"),
        # Whatever would fetch something fails.
        "DYNRESP_FETCH_URL": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    done = subprocess.run(
        [sys.executable, "-m", "dynresp", "demo", "--out", str(tmp_path / "out"), "--json"],
        capture_output=True,
        text=True,
        env=environment,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    content = json.loads(done.stdout)
    assert content["base"]["built_in"]
    assert content["library"]["built_in"]
    assert content["happened"]["outcome"] == "reaction"
    assert "built-in motions take the place" in done.stderr


@pytest.mark.slow
def test_a_renderer_that_is_not_there_costs_no_more_than_the_video(world: Path) -> None:
    done = subprocess.run(
        [
            *(sys.executable, "-m", "dynresp", "run", str(world / "experiment.toml")),
            *("--out", str(world / "out"), "--motions", str(world / "motions")),
        ],
        env=dict(os.environ, MUJOCO_GL="bogus"),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert (world / "out" / "result.json").is_file()


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(
    world: Path, dynresp: Command
) -> None:
    (world / "FILE").write_text("")
    out = world / "FILE" / "sub"
    result = dynresp("run", world / "experiment.toml", "--out", out, "--motions", world / "motions")
    assert result.exit_code == 2
    assert "--out" in result.stderr
    assert "simulating" not in result.stderr
