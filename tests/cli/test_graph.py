"""Motion graphs through the command line, on built-in motion."""

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dynresp.cli.app import app
from dynresp.motion.readers.npz import read_npz

from .conftest import Command

PNG = b"\x89PNG\r\n\x1a\n"
FILES = {"motion.npz", "motion.bvh", "recording.html", "filmstrip.png", "plan.png"}


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("graph") / "builtin.npz"
    result = CliRunner().invoke(app, ["graph", "build", "builtin", "--out", str(path)])
    assert result.exit_code == 0, result.output
    return path


class TestBuild:
    def test_without_motion_capture(self, dynresp: Command, tmp_path: Path) -> None:
        result = dynresp("graph", "build", "--out", tmp_path / "graph.npz", "--json")
        assert result.exit_code == 0, result.stderr
        assert "building the graph of built-in motion" in result.stderr
        content = json.loads(result.stdout)
        assert content["built_in_clips"] == content["clips"] > 0
        left = content["jumps_left"]
        assert left["pairs"] > left["contact"] >= left["likelihood"] >= left["component"] > 0

    def test_the_same_graph_has_the_same_bytes(
        self, dynresp: Command, graph: Path, tmp_path: Path
    ) -> None:
        again = tmp_path / "again.npz"
        assert dynresp("graph", "build", "builtin", "--out", again).exit_code == 0
        assert again.read_bytes() == graph.read_bytes()

    def test_an_unknown_spec(self, dynresp: Command, tmp_path: Path) -> None:
        result = dynresp("graph", "build", "biltin", "--out", tmp_path / "graph.npz")
        assert result.exit_code == 2
        assert "Did you mean 'builtin'?" in result.stderr

    def test_motions_that_are_missing(self, dynresp: Command, tmp_path: Path) -> None:
        result = dynresp("graph", "build", "walking", "--out", tmp_path / "graph.npz")
        assert result.exit_code == 1
        assert "not on this machine" in result.stderr
        assert not (tmp_path / "graph.npz").exists()

    @pytest.mark.mocap
    def test_a_spec_of_the_users_own(
        self, dynresp: Command, tmp_path: Path, motions_folder: Path
    ) -> None:
        spec = tmp_path / "spec.toml"
        spec.write_text(
            '[graph]\nname = "mine"\nfps = 30\n\n[[motion]]\n'
            'motion = "snumrl_DataDrivenBipedController/*stright.bvh"\ntrim_t_pose = true\n'
        )
        out = tmp_path / "graph.npz"
        result = dynresp("graph", "build", spec, "--out", out, "--motions", motions_folder)
        assert result.exit_code == 0, result.stderr
        assert "frames at 30 fps" in result.stdout
        assert "Movement Research Lab" in result.stdout


class TestInfo:
    def test_in_words(self, dynresp: Command, graph: Path) -> None:
        result = dynresp("graph", "info", graph)
        assert result.exit_code == 0, result.stderr
        assert "jumps left by each pruning rule" in result.stdout
        assert "built-in motion" in result.stdout

    def test_for_programs(self, dynresp: Command, graph: Path) -> None:
        content = json.loads(dynresp("graph", "info", graph, "--json").stdout)
        assert content["config"]["coordinates"] == "relative"
        assert sum(motion["frames"] for motion in content["motions"]) == content["frames"]

    def test_no_graph(self, dynresp: Command, tmp_path: Path) -> None:
        (tmp_path / "graph.npz").write_bytes(b"no graph at all, only some text")
        for name in ("graph.npz", "none.npz"):
            result = dynresp("graph", "info", tmp_path / name)
            assert result.exit_code == 2
            assert result.stderr.startswith(f"dynresp: {tmp_path / name}:")


class TestWalk:
    def test_by_chance(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        out = tmp_path / "out"
        result = dynresp("graph", "walk", graph, "--out", out, "--seconds", 4, "--no-video")
        assert result.exit_code == 0, result.stderr
        content = json.loads((out / "result.json").read_text())
        assert {name for name, what in content["files"].items() if what == "written"} == FILES
        motion = read_npz(out / "motion.npz")
        assert motion.fps == 30.0
        assert motion.duration == pytest.approx(4.0)
        assert content["happened"]["foot_skate_m"]["median"] < 0.01
        for name in ("filmstrip.png", "plan.png"):
            assert (out / name).read_bytes().startswith(PNG)
        assert "made of built-in motion" in result.stdout

    @pytest.mark.slow
    def test_same_seed_same_bytes(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        words = ("graph", "walk", graph, "--seconds", 2, "--seed", 5, "--no-video", "--out")
        for name in ("a", "b"):
            assert dynresp(*words, tmp_path / name).exit_code == 0
        for name in ("motion.npz", "motion.bvh", "result.json"):
            assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()

    def test_a_file_in_the_way(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        (tmp_path / "out").write_text("mine")
        result = dynresp("graph", "walk", graph, "--out", tmp_path / "out")
        assert result.exit_code == 2
        assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.slow
class TestSketch:
    def test_along_a_path(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        path = tmp_path / "path.csv"
        path.write_text("# x, y\n0, 0\n4, 0\n\n6, 3\n")
        words = ("graph", "sketch", graph, "--no-video", "--json", "--out")
        by_file = dynresp(*words, tmp_path / "a", "--path", path)
        assert by_file.exit_code == 0, by_file.stderr
        content = json.loads(by_file.stdout)
        assert content["sketch"]["arrived"]
        assert content["sketch"]["off_path_mean_m"] < 0.3
        by_points = dynresp(*words, tmp_path / "b", "--points", "0,0 4,0 6,3")
        assert json.loads(by_points.stdout) == content

    def test_around_a_box(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        world = tmp_path / "world.toml"
        world.write_text(
            "[world]\nbounds = [-3, -4, 9, 4]\n\n[[box]]\ncenter = [3, 0]\nsize = [0.6, 1.5]\n"
        )
        result = dynresp(
            "graph", "sketch", graph, "--goal", "6,0", "--world", world, "--no-video", "--json",
            "--out", tmp_path / "out",
        )  # fmt: skip
        assert result.exit_code == 0, result.stderr
        content = json.loads(result.stdout)["sketch"]
        assert content["arrived"]
        assert content["off_sketch_worst_m"] is None

    def test_a_corner_behind_a_wall(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        world = tmp_path / "world.toml"
        world.write_text(
            "[world]\nbounds = [-5, -5, 5, 5]\n\n[[box]]\ncenter = [1.5, 0]\nsize = [0.2, 10]\n"
        )
        words = ("graph", "sketch", graph, "--no-video", "--json", "--out", tmp_path / "out")
        result = dynresp(*words, "--points", "0,0 3,0 0,0.5", "--world", world)
        assert result.exit_code == 0, result.stderr
        content = json.loads(result.stdout)["sketch"]
        # The wall stands 1.6 m before the corner.
        assert content["off_sketch_worst_m"] > 1.6 > content["off_path_worst_m"]
        message = "the walk misses a corner of the path by"
        assert (
            f"{message} {content['off_sketch_worst_m']:.1f} m; obstacles are in the way"
            in " ".join(result.stderr.split())
        )

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            ((), "give either a path (--points or --path) or a goal (--goal), got none"),
            (("--points", "0,0 1"), "--points: expected x,y in metres, got '1'"),
            (("--points", "0,0"), "two corners or more"),
            (("--points", "0,0 1,nan"), "within 10000 m"),
            (("--path", "none.csv"), "cannot be read"),
            (("--points", "0,0 600,0 0,0"), "1200 m long; at most 1000 m"),
            (("--points", "0,0 " * 10_001), "10001 corners; at most 10000"),
            (("--goal", "1,1", "--points", "0,0 1,1"), "or a goal (--goal), got both"),
            (("--goal", "1;1"), "--goal: expected x,y"),
            (("--maze", "--world", "none.toml"), "no such file"),
        ],
    )
    def test_wrong_requests(
        self,
        dynresp: Command,
        graph: Path,
        tmp_path: Path,
        words: tuple[str, ...],
        message: str,
    ) -> None:
        result = dynresp("graph", "sketch", graph, "--out", tmp_path / "out", *words)
        assert result.exit_code == 2, result.output
        assert message in result.stderr
        assert "Traceback" not in result.stderr

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            # The limit of 1 MiB lies inside a character.
            (b"#" + 2**20 * "é".encode(), "is larger than 1024 KiB"),
            (b"0,0\n1,1\xc3", "is not text"),
            (b"0,0\n" + 2**19 * b"9" + b",0", "points must be within 10000 m"),
            (b"0,0\n0.5,0\n" * 1_001, "1000.5 m long; at most 1000 m"),
            (b"0,0\n" * 10_001, "10001 corners; at most 10000"),
        ],
    )
    def test_files_that_hold_no_path(
        self, dynresp: Command, graph: Path, tmp_path: Path, content: bytes, message: str
    ) -> None:
        path = tmp_path / "path.csv"
        path.write_bytes(content)
        result = dynresp("graph", "sketch", graph, "--out", tmp_path / "out", "--path", path)
        assert result.exit_code == 2, result.output
        assert message in " ".join(result.stderr.split())
        assert len(result.stderr) < 1000


@pytest.mark.mocap
@pytest.mark.parametrize("spec", ["terrain", "playground"])
def test_recorded_worlds(dynresp: Command, tmp_path: Path, motions_folder: Path, spec: str) -> None:
    graph = tmp_path / "graph.npz"
    built = dynresp("graph", "build", spec, "--out", graph, "--motions", motions_folder)
    assert built.exit_code == 0, built.stderr
    assert "mocap.cs.cmu.edu" in built.stdout
    walked = dynresp(
        "graph", "walk", graph, "--seconds", 5, "--no-video", "--json", "--out", tmp_path / "out"
    )
    assert walked.exit_code == 0, walked.stderr
    assert json.loads(walked.stdout)["happened"]["foot_skate_m"]["median"] < 0.01


@pytest.mark.mocap
def test_over_rough_terrain(dynresp: Command, tmp_path: Path, motions_folder: Path) -> None:
    graph = tmp_path / "graph.npz"
    dynresp("graph", "build", "terrain", "--out", graph, "--motions", motions_folder)
    words = ("graph", "sketch", graph, "--no-video", "--json", "--out", tmp_path / "out")
    content = json.loads(dynresp(*words, "--seed", 3).stdout)
    assert content["terrain"]["arrived"]
    assert content["terrain"]["feet_off_height_worst_m"] < 0.01
    beside = dynresp(*words, "--goal", "50,50")
    assert beside.exit_code == 2
    assert "inside the grid" in beside.stderr
    assert dynresp(*words, "--maze").exit_code == 2


@pytest.mark.slow
def test_the_step_stool(dynresp: Command, tmp_path: Path) -> None:
    graph, out = tmp_path / "graph.npz", tmp_path / "out"
    assert dynresp("graph", "build", "stool", "--out", graph).exit_code == 0
    result = dynresp("graph", "walk", graph, "--seconds", 2, "--no-video", "--json", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["graph"]["coordinates"] == "fixed"


class TestSketchThatCannotBe:
    def test_a_start_in_a_box(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        world = tmp_path / "world.toml"
        world.write_text(
            "[world]\nbounds = [-5, -5, 5, 5]\n\n[[box]]\ncenter = [0, 0]\nsize = [1, 1]\n"
        )
        words = ("graph", "sketch", graph, "--world", world, "--out", tmp_path / "out")
        for more in (("--points", "0,0 4,0"), ("--goal", "0.2,0", "--start", "3,3")):
            result = dynresp(*words, *more)
            assert result.exit_code == 2, result.output
            assert "in an obstacle" in result.stderr

    def test_one_that_does_not_arrive(self, dynresp: Command, graph: Path, tmp_path: Path) -> None:
        world = tmp_path / "world.toml"
        world.write_text(
            "[world]\nbounds = [-5, -5, 5, 5]\n\n[[box]]\ncenter = [2, 0]\nsize = [0.2, 9.5]\n"
        )
        result = dynresp(
            "graph", "sketch", graph, "--world", world, "--goal", "4,0", "--no-video", "--out",
            tmp_path / "out",
        )  # fmt: skip
        assert result.exit_code == 1, result.output

    def test_fixed_coordinates(self, dynresp: Command, tmp_path: Path) -> None:
        graph = tmp_path / "graph.npz"
        assert dynresp("graph", "build", "stool", "--out", graph).exit_code == 0
        result = dynresp("graph", "sketch", graph, "--goal", "3,3", "--out", tmp_path / "out")
        assert result.exit_code == 2
        assert "belongs to places of its world" in result.stderr


@pytest.mark.parametrize("out", [".", "file/graph.npz"])
def test_a_graph_that_cannot_be_written(dynresp: Command, tmp_path: Path, out: str) -> None:
    (tmp_path / "file").write_text("mine")
    result = dynresp("graph", "build", "builtin", "--out", tmp_path / out)
    assert result.exit_code == 2, result.output
    assert "--out" in result.stderr
    assert "loading" not in result.stderr


def test_a_name_that_is_no_text_and_pictures_of_an_earlier_run(
    dynresp: Command, graph: Path, tmp_path: Path
) -> None:
    odd, out = tmp_path / os.fsdecode(b"x\xff.npz"), tmp_path / "out"
    try:
        odd.write_bytes(graph.read_bytes())
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    out.mkdir()
    earlier = ("options.png", "watching.png")
    for name in (*earlier, "mine.png", "alignment.png"):
        (out / name).touch()
    record = {"files": dict.fromkeys(earlier, "written"), "versions": {"dynresp": "0.1.0"}}
    (out / "result.json").write_text(json.dumps(record))
    result = dynresp("graph", "walk", odd, "--seconds", "2", "--no-video", "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["title"].endswith("x?.npz")
    assert {path.name for path in out.iterdir()} == FILES | {
        "result.json",
        "mine.png",
        "alignment.png",
    }
