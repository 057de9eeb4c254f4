"""The Python interface, as users type it."""

import ast
import doctest
import inspect
import json
import subprocess
import sys
import webbrowser
from pathlib import Path

import numpy as np
import pytest

import dynresp
import dynresp.experiments.one_hit
import dynresp.front_door
import dynresp.motion.character
import dynresp.physics.impacts
import dynresp.response.runtime.crowd
from dynresp.motion.character import default_character
from dynresp.motion.export import write_npz

BALL = dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)


@pytest.fixture(autouse=True)
def without_motions(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine without motion capture: what a newcomer has."""
    monkeypatch.setenv("DYNRESP_MOTIONS", "")
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def response() -> dynresp.HitResponse:
    return dynresp.hit("builtin:walk", BALL, library="builtin")


def test_three_lines() -> None:
    poses = dynresp.hit("builtin:walk", dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)).poses
    assert poses.ndim == 2
    assert poses.shape[1] == 59
    assert np.isfinite(poses).all()
    # A ball of 6 kg moves a walking person from where the walk alone would lead.
    walk = dynresp.load_motion("builtin:walk").resampled(30.0).poses
    both = min(len(walk), len(poses))
    assert np.linalg.norm(poses[:both, :3] - walk[:both, :3], axis=1).max() > 0.1


def test_import_is_light() -> None:
    code = (
        "import sys; import dynresp; "
        "print(sorted({'numpy', 'mujoco', 'numba', 'pydantic', 'scipy'} & set(sys.modules)))"
    )
    words = [sys.executable, "-c", code]
    found = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert found.strip() == "[]"


def test_every_name_is_there_and_documented() -> None:
    assert set(dynresp.__all__) == set(dir(dynresp))
    for name in dynresp.__all__:
        value = getattr(dynresp, name)
        if name != "__version__":
            assert value.__doc__, name
            assert value.__name__ == name


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(inspect.getfile(dynresp)).read_text(encoding="utf-8"))
    imported = {
        (node.module, alias.asname)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dynresp.")
        for alias in node.names
    }
    assert imported == {(home, name) for name, home in dynresp._HOMES.items()}


def test_saving_keeps_files_of_others(tmp_path: Path) -> None:
    walk = dynresp.load_motion("builtin:walk")
    write_npz(walk, tmp_path / "motion.npz", default_character())
    before = (tmp_path / "motion.npz").read_bytes()
    ball = dynresp.Ball(time=0.8, mass=6, speed=8, from_deg=180)
    response = dynresp.hit(tmp_path / "motion.npz", ball, library="builtin")
    for write in (["motion.npz"], ["motion.bvh"]):
        (tmp_path / "motion.bvh").write_text("mine")
        with pytest.raises(dynresp.UsageError, match="another folder"):
            response.save(tmp_path, write=write, overwrite=write == ["motion.npz"])
        assert (tmp_path / "motion.npz").read_bytes() == before
        assert (tmp_path / "motion.bvh").read_text() == "mine"
        assert not (tmp_path / "result.json").exists()


def test_an_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Bal'"):
        dynresp.Bal  # noqa: B018


@pytest.mark.parametrize(
    "module",
    [
        dynresp,
        dynresp.front_door,
        dynresp.experiments.one_hit,
        dynresp.motion.character,
        dynresp.physics.impacts,
        dynresp.response.runtime.crowd,
    ],
    ids=lambda m: m.__name__,
)
def test_the_examples_in_docstrings(module: object) -> None:
    result = doctest.testmod(module)  # type: ignore[arg-type]
    assert result.attempted
    assert not result.failed


class TestHit:
    def test_what_came_of_it(self, response: dynresp.HitResponse) -> None:
        assert response.outcome == "reaction"
        library = dynresp.load_library("builtin")
        assert response.reaction in [reaction.name for reaction in library.reactions]
        assert response.fps == 30.0
        assert len(response.poses) == len(response.motion)

    def test_a_motion_and_a_library_in_hand(self, response: dynresp.HitResponse) -> None:
        motion, library = dynresp.load_motion("builtin:walk"), dynresp.load_library("builtin")
        again = dynresp.hit(motion, BALL, library=library)
        np.testing.assert_array_equal(again.poses, response.poses)

    def test_full_search(self, response: dynresp.HitResponse) -> None:
        best = dynresp.hit("builtin:walk", BALL, library="builtin", budget="best")
        assert len(best.response.errors) > len(response.response.errors)

    def test_a_light_push_needs_no_reaction(self) -> None:
        push = dynresp.Push(time=1.0, force=20.0)
        light = dynresp.hit("builtin:walk", push, library="builtin")
        assert light.outcome == "carry on"
        assert light.reaction is None

    def test_a_miss(self) -> None:
        ball = dynresp.Ball(time=1.0, offset=3.0)
        assert dynresp.hit("builtin:walk", ball, library="builtin").outcome == "miss"

    def test_saved(self, response: dynresp.HitResponse, tmp_path: Path) -> None:
        content = response.save(tmp_path / "out", write=["motion.npz", "motion.bvh"])
        assert sorted(f.name for f in (tmp_path / "out").iterdir()) == [
            "motion.bvh",
            "motion.npz",
            "result.json",
        ]
        assert content["impact"]["mass_kg"] == 6
        assert content["impact"]["kind"] == "ball"
        written = json.loads((tmp_path / "out" / "result.json").read_text())
        assert written["happened"]["choice"] == response.reaction
        back = dynresp.load_motion(tmp_path / "out" / "motion.npz")
        # The result folder holds the motion from shortly before the hit on.
        np.testing.assert_allclose(back.poses, response.poses[-len(back) :], atol=1e-12)

    def test_saved_under_an_unknown_name(
        self, response: dynresp.HitResponse, tmp_path: Path
    ) -> None:
        with pytest.raises(dynresp.UsageError, match=r"unknown file 'film.png'"):
            response.save(tmp_path / "out", write=["film.png"])
        assert not (tmp_path / "out").exists()

    def test_shown(self, response: dynresp.HitResponse, monkeypatch: pytest.MonkeyPatch) -> None:
        opened: list[str] = []
        monkeypatch.setattr(webbrowser, "open", opened.append)
        path = response.show()
        assert opened == [path.as_uri()]
        assert "<html" in path.read_text(encoding="utf-8")[:2000].lower()

    @pytest.mark.parametrize(
        ("arguments", "error", "message"),
        [
            (("builtin:walk", "ball"), dynresp.UsageError, "expected a Ball, Punch, Push"),
            (("builtin:wlak", BALL), dynresp.UsageError, "Did you mean 'walk'"),
            (("nowhere.bvh", BALL), dynresp.MissingMotionDataError, "nowhere.bvh: no such motion"),
            (("builtin:walk", dynresp.Ball(time=60.0)), dynresp.SpecError, "time"),
        ],
    )
    def test_asked_wrongly(
        self, arguments: tuple[str, dynresp.Ball], error: type[Exception], message: str
    ) -> None:
        with pytest.raises(error, match=message):
            dynresp.hit(*arguments, library="builtin")

    def test_an_unknown_budget(self) -> None:
        with pytest.raises(dynresp.UsageError, match="unknown budget 'most'"):
            dynresp.hit("builtin:walk", BALL, library="builtin", budget="most")  # type: ignore[arg-type]


SPEC = """
[experiment]
name = "Three balls"
count = 3
show = 1
[base]
motion = "builtin:walk"
[[impact]]
kind = "ball"
time_s = 1.0
from_deg = { uniform = [0.0, 360.0] }
[library]
which = "builtin"
[output]
write = ["motion.npz"]
"""


def test_a_whole_experiment(tmp_path: Path) -> None:
    (tmp_path / "three.toml").write_text(SPEC)
    result = dynresp.run(tmp_path / "three.toml", seed=4)
    assert len(result) == 3
    assert [response.outcome for response in result].count("diverged") == 0
    assert len({tuple(response.poses[-1]) for response in result}) == 3
    summary = result.save(tmp_path / "out")
    assert summary["seed"] == 4
    assert (tmp_path / "out" / "table.csv").is_file()
    one = result[0].save(tmp_path / "one", write=["motion.npz"])
    assert one["impact"]["from_deg"] != 0.0


def test_avatars_walk_and_are_hit() -> None:
    graph = dynresp.build_graph("builtin")
    assert isinstance(graph, dynresp.MotionGraph)
    library = dynresp.load_library("builtin")
    avatars = dynresp.AvatarCrowd.wandering(graph, library, count=2, seed=3)
    assert all(isinstance(avatar, dynresp.Avatar) for avatar in avatars.avatars)
    avatars.avatars[0].hit(dynresp.Push(time=0.5, force=900.0, duration=0.3))
    shown = np.array([avatars.advance() for _ in range(60)])
    assert shown.shape == (60, 2, 59)
    assert np.isfinite(shown).all()
    assert avatars.avatars[0].responder.takeovers > 0
    assert avatars.avatars[1].responder.takeovers == 0


def test_characters_at_run_time() -> None:
    character, library = dynresp.Character(), dynresp.load_library("builtin")
    walk = dynresp.load_motion("builtin:walk").resampled(30.0)
    crowd = dynresp.Crowd(character, library, [walk, walk])
    crowd.responders[0].hit(dynresp.Ball(time=0.8, speed=9.0, from_deg=20.0))
    shown = np.array([crowd.advance() for _ in range(45)])
    assert not np.array_equal(shown[-1, 0], shown[-1, 1])
