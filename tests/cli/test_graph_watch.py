"""Avatars that follow a video, through the command line: people of other shapes in bad pictures."""

import dataclasses
import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from dynresp.cli import graph_watch
from dynresp.cli.app import app
from dynresp.locomotion.graph.graph_file import load_graph, save_graph
from dynresp.motion.builtin.builtin_motions import load_builtin
from dynresp.motion.load import load_motion
from dynresp.motion.motion import Motion
from dynresp.motion.readers.npz import read_npz
from studies.video.filming import SIZE, Filming, film, write_video
from studies.video.people import Body

from .conftest import Command

FILES = {
    "motion.npz", "motion.bvh", "recording.html", "filmstrip.png", "plan.png", "watching.png",
}  # fmt: skip
SPEC = """
[graph]
name = "some steps"

[[motion]]
motion = "builtin:stroll"
start_s = 10.0
stop_s = 18.0

[[motion]]
motion = "builtin:footwork"
start_s = 10.0
stop_s = 18.0
"""
SOMEBODY = Body(1.83, 1.05, 1.0, 1.2)


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache of these tests' own."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("DYNRESP_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small graph of built-in motion."""
    folder = tmp_path_factory.mktemp("graph")
    (folder / "spec.toml").write_text(SPEC)
    words = ["graph", "build", str(folder / "spec.toml"), "--out", str(folder / "graph.npz")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    return folder / "graph.npz"


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[np.ndarray]:
    """A person who stands, and walks backwards."""
    somebody = SOMEBODY.character(tmp_path_factory.mktemp("somebody"))
    motion = load_builtin("footwork", somebody)
    part = slice(round(12.5 * motion.fps), round(16.0 * motion.fps))
    acted = Motion(motion.poses[part], motion.fps)
    return list(film(acted, somebody, Filming(3)))


@pytest.fixture(scope="module")
def video(pictures: list[np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("video") / "somebody.mp4"
    write_video(path, iter(pictures), 30.0)
    return path


def same(a: Path, b: Path) -> bool:
    names = ("motion.npz", "motion.bvh", "result.json")
    return all((a / name).read_bytes() == (b / name).read_bytes() for name in names)


@pytest.fixture(scope="module")
def first(graph: Path, video: Path, tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The first time that the video is watched; into the folder `first` beside it."""
    words = ["graph", "watch", str(graph), str(video), "--no-video", "--out"]
    return CliRunner().invoke(app, [*words, str(video.parent / "first")])


@pytest.mark.slow
class TestFile:
    def test_somebody_is_followed(self, first: Result, video: Path) -> None:
        assert first.exit_code == 0, first.stderr
        assert "drawing silhouettes" in first.stderr
        assert "nobody may be in the picture" in first.stderr
        assert "10 are needed" in first.stdout
        out = video.parent / "first"
        content = json.loads((out / "result.json").read_text())
        assert {name for name, what in content["files"].items() if what == "written"} == FILES
        assert "pace" not in content
        assert content["video"]["name"] == "somebody.mp4"
        assert content["first_seen_s"] == pytest.approx(1.1, abs=0.15)
        assert content["person"][0] == {"from_s": 0.0, "to_s": 1.0, "action": None}
        known = {action["name"] for action in content["actions"]}
        for who in ("person", "chosen", "avatar"):
            assert content[who][-1]["to_s"] == pytest.approx(4.5, abs=0.11)
            assert {part["action"] for part in content[who]} <= {*known, None}
        motion = read_npz(out / "motion.npz")
        assert motion.fps == 30.0
        assert motion.duration == pytest.approx(4.5, abs=0.11)

    def test_the_second_run_reads_what_the_first_learnt(
        self,
        dynresp: Command,
        graph: Path,
        video: Path,
        first: Result,
        tmp_path: Path,
        cache: Path,
    ) -> None:
        made = {path: path.stat().st_mtime_ns for path in (cache / "sight").iterdir()}
        words = ("--no-video", "--json", "--out", tmp_path / "out")
        second = dynresp("graph", "watch", graph, video, *words)
        assert second.exit_code == 0, second.stderr
        assert "drawing silhouettes" not in second.stderr
        assert "learning to recognise actions" not in second.stderr
        assert same(video.parent / "first", tmp_path / "out")
        printed = json.loads(second.stdout)
        assert printed["pace"]["choices"] == 45
        assert printed["pace"]["choices_per_s"] > 0.0
        assert made == {path: path.stat().st_mtime_ns for path in (cache / "sight").iterdir()}

    def test_damaged_files_are_made_again(
        self,
        dynresp: Command,
        graph: Path,
        video: Path,
        first: Result,
        tmp_path: Path,
        cache: Path,
    ) -> None:
        for path in (cache / "sight").iterdir():
            path.write_bytes(path.read_bytes()[:-1000])
        words = ("--no-video", "--out", tmp_path / "out")
        result = dynresp("graph", "watch", graph, video, *words)
        assert result.exit_code == 0, result.stderr
        assert "drawing silhouettes" in result.stderr
        assert same(video.parent / "first", tmp_path / "out")

    def test_where_nothing_can_be_kept(
        self,
        dynresp: Command,
        graph: Path,
        video: Path,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        (tmp_path / "cache").mkdir()
        (tmp_path / "cache" / "sight").write_text("a file of mine")
        monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path / "cache"))
        words = ("--no-video", "--clusters", 3, "--seconds", 2, "--json")
        result = dynresp("graph", "watch", graph, video, *words, "--out", tmp_path / "out")
        assert result.exit_code == 0, result.stderr
        assert "has to learn this graph again" in result.stderr
        content = json.loads(result.stdout)
        assert len(content["actions"]) <= 3
        assert content["video"]["pictures"] == 60

    def test_another_seed_begins_elsewhere(
        self, dynresp: Command, graph: Path, video: Path, first: Result, tmp_path: Path
    ) -> None:
        words = ("--no-video", "--seed", 1, "--out", tmp_path / "out")
        assert dynresp("graph", "watch", graph, video, *words).exit_code == 0
        assert not same(video.parent / "first", tmp_path / "out")


class TestRefused:
    def test_wrong_sources_are_refused(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        (tmp_path / "text.mp4").write_text("no video at all")
        for source, message in (
            (tmp_path / "none.mp4", "no such file"),
            (tmp_path, "is a folder"),
            (tmp_path / "text.mp4", "cannot be opened; expected a video"),
            ("camera:99", "camera 99: cannot be opened"),
            ("camera:first", "expected camera or camera:N"),
        ):
            result = dynresp("graph", "watch", graph, source, "--out", tmp_path / "out")
            assert result.exit_code == 2, result.output
            assert message in result.stderr
            assert "drawing silhouettes" not in result.stderr
        assert not (tmp_path / "out").exists()

    def test_a_video_that_is_too_short(
        self, dynresp: Command, graph: Path, pictures: list[np.ndarray], tmp_path: Path
    ) -> None:
        write_video(tmp_path / "short.mp4", iter(pictures[:40]), 30.0)
        words = ("graph", "watch", graph, tmp_path / "short.mp4", "--out", tmp_path / "out")
        result = dynresp(*words)
        assert result.exit_code == 2, result.output
        assert "short.mp4: 1.33 s of video" in result.stderr
        assert "at least 1.5 s" in result.stderr

    def test_a_video_of_an_empty_room(
        self, dynresp: Command, graph: Path, pictures: list[np.ndarray], tmp_path: Path
    ) -> None:
        write_video(tmp_path / "room.mp4", iter([pictures[0]] * 60), 30.0)
        words = ("graph", "watch", graph, tmp_path / "room.mp4", "--out", tmp_path / "out")
        result = dynresp(*words)
        assert result.exit_code == 1, result.output
        assert "no person is seen in room.mp4" in result.stderr
        assert not (tmp_path / "out" / "result.json").exists()

    def test_a_picture_larger_than_any_camera_has(
        self, dynresp: Command, graph: Path, tmp_path: Path
    ) -> None:
        writer = cv2.VideoWriter(
            str(tmp_path / "wide.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (8208, 16)
        )
        writer.write(np.zeros((16, 8208, 3), dtype=np.uint8))
        writer.release()
        words = ("graph", "watch", graph, tmp_path / "wide.avi", "--out", tmp_path / "out")
        result = dynresp(*words)
        assert result.exit_code == 2, result.output
        assert "8208 x 16 pixels; expected at most 8192" in result.stderr

    def test_a_video_without_a_frame_rate(
        self,
        dynresp: Command,
        graph: Path,
        video: Path,
        pictures: list[np.ndarray],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(cv2, "VideoCapture", lambda source: Camera(pictures, fps=0.0))
        result = dynresp("graph", "watch", graph, video, "--out", tmp_path / "out")
        assert result.exit_code == 2, result.output
        assert "0 pictures a second; expected 1 to 1000" in result.stderr

    def test_a_graph_of_steps_on_blocks(
        self, dynresp: Command, graph: Path, video: Path, tmp_path: Path
    ) -> None:
        flat = load_graph(graph)
        database = dataclasses.replace(flat.database, world="terrain")
        save_graph(dataclasses.replace(flat, database=database), tmp_path / "blocks.npz")
        words = ("graph", "watch", tmp_path / "blocks.npz", video, "--out", tmp_path / "out")
        result = dynresp(*words)
        assert result.exit_code == 2, result.output
        assert "rough terrain" in result.stderr

    def test_without_opencv(
        self,
        dynresp: Command,
        graph: Path,
        video: Path,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setitem(__import__("sys").modules, "cv2", None)
        result = dynresp("graph", "watch", graph, video, "--out", tmp_path / "out")
        assert result.exit_code == 1, result.output
        assert "pip install 'dynresp[camera]'" in result.stderr


class Camera:
    """A camera for OpenCV that delivers pictures in their time, and then is unplugged."""

    def __init__(
        self, pictures: list[np.ndarray], interrupt_at: int | None = None, fps: float = 30.0
    ) -> None:
        self._pictures = pictures
        self._fps = fps
        self._interrupt_at = interrupt_at
        self._begun = time.monotonic()
        self._next = 0

    def isOpened(self) -> bool:  # noqa: N802
        return True

    def get(self, which: int) -> float:
        known = {
            cv2.CAP_PROP_FRAME_WIDTH: SIZE[0],
            cv2.CAP_PROP_FRAME_HEIGHT: SIZE[1],
            cv2.CAP_PROP_FPS: self._fps,
        }
        return float(known.get(which, -1.0))

    def read(self) -> tuple[bool, np.ndarray | None]:
        if self._next == 0:
            self._begun = time.monotonic()
        time.sleep(max(0.0, self._begun + self._next / 30.0 - time.monotonic()))
        if self._next == self._interrupt_at:
            os.kill(os.getpid(), signal.SIGINT)
        self._next += 1
        if self._next > len(self._pictures):
            return False, None
        return True, self._pictures[self._next - 1]

    def release(self) -> None:
        pass


@pytest.mark.slow
class TestCamera:
    @pytest.fixture
    def plugged_in(
        self, monkeypatch: pytest.MonkeyPatch, pictures: list[np.ndarray]
    ) -> dict[str, Camera]:
        """A camera that shows the empty room for half a second, then the person."""
        there = {"camera": Camera([pictures[0]] * 15 + pictures)}
        monkeypatch.setattr(cv2, "VideoCapture", lambda source: there["camera"])
        monkeypatch.setattr(graph_watch, "_STEP_OUT_S", 0.4)
        return there

    def test_the_room_comes_first(
        self, dynresp: Command, graph: Path, tmp_path: Path, plugged_in: dict[str, Camera]
    ) -> None:
        words = ("--no-video", "--seconds", 3, "--json", "--out", tmp_path / "out")
        result = dynresp("graph", "watch", graph, "camera", *words)
        assert result.exit_code == 0, result.stderr
        assert "step out of the picture" in result.stderr
        content = json.loads(result.stdout)
        assert content["video"]["name"] == "camera 0"
        assert content["happened"]["seconds"] == pytest.approx(3.0, abs=0.11)

    def test_ctrl_c_ends_it_and_writes_the_result(
        self,
        dynresp: Command,
        graph: Path,
        tmp_path: Path,
        plugged_in: dict[str, Camera],
        pictures: list[np.ndarray],
    ) -> None:
        plugged_in["camera"] = Camera([pictures[0]] * 15 + pictures, interrupt_at=100)
        before = signal.getsignal(signal.SIGINT)
        words = ("--no-video", "--json", "--out", tmp_path / "out")
        result = dynresp("graph", "watch", graph, "camera:0", *words)
        assert result.exit_code == 0, result.stderr
        assert 2.0 < json.loads(result.stdout)["happened"]["seconds"] < 4.4
        assert signal.getsignal(signal.SIGINT) is before

    def test_ctrl_c_before_anybody_could_be_seen(
        self,
        dynresp: Command,
        graph: Path,
        tmp_path: Path,
        plugged_in: dict[str, Camera],
        pictures: list[np.ndarray],
    ) -> None:
        plugged_in["camera"] = Camera(pictures, interrupt_at=20)
        result = dynresp("graph", "watch", graph, "camera", "--out", tmp_path / "out")
        assert result.exit_code == 130
        assert not (tmp_path / "out").exists()


@pytest.mark.mocap
@pytest.mark.slow
def test_a_stranger_among_recorded_motions(
    dynresp: Command, tmp_path: Path, motions_folder: Path
) -> None:
    spec = tmp_path / "spec.toml"
    folder = "snumrl_ys2010"
    clips = (
        f"{folder}/VideoMotion/wd2_freeWalk_01.bvh",
        f"{folder}/Physics2/wd2_WalkForwardFast00.bvh",
        f"{folder}/Physics2/wd2_WalkBackward00.bvh",
        f"{folder}/samsung_boxing/boxman/boxing_boxman_stand_dir_onetwo.bvh",
    )
    motions = [f'[[motion]]\nmotion = "{clip}"\ntrim_t_pose = true\n' for clip in clips]
    spec.write_text('[graph]\nname = "mine"\n\n' + "\n".join(motions))
    graph = tmp_path / "graph.npz"
    built = dynresp("graph", "build", spec, "--out", graph, "--motions", motions_folder)
    assert built.exit_code == 0, built.stderr
    stranger = Body(1.92, 1.03, 0.97, 1.3).character(tmp_path)
    boxing = load_motion(motions_folder / "cmu/02/02_05.amc", stranger)
    acted = Motion(boxing.poses[: round(6.0 * boxing.fps)], boxing.fps)
    write_video(tmp_path / "boxing.mp4", film(acted, stranger, Filming(43)), 30.0)
    words = ("--no-video", "--json", "--out", tmp_path / "out")
    result = dynresp("graph", "watch", graph, tmp_path / "boxing.mp4", *words)
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert content["graph"]["built_in_clips"] == 0
    # A boxer does not get ahead.
    still = ("stays in place", "goes to and fro")
    on_the_spot = {a["name"] for a in content["actions"] if a["what"].startswith(still)}
    shown = [part for part in content["person"] if part["to_s"] > 2.0]
    right = [p["to_s"] - max(p["from_s"], 2.0) for p in shown if p["action"] in on_the_spot]
    assert sum(right) > 0.8 * (shown[-1]["to_s"] - 2.0)
