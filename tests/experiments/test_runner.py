import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynresp.experiments.experiment_reader import read_experiment
from dynresp.experiments.runner import chosen_hits, prepare_run, run_experiment
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.readers.npz import read_npz
from dynresp.response.response_settings import SettingsTable, response_config, settings_record
from dynresp.results.result_json import to_json
from dynresp.support.errors import DynrespError, MissingMotionDataError, SpecError, UnknownNameError

from .samples import write_world

SMALL = 'write = ["motion.npz", "alignment.png"]\n'


@pytest.fixture
def world(tmp_path: Path, character: Character) -> Path:
    return write_world(tmp_path, character).parent


def run(world: Path, out: str = "out", seed: int | None = None) -> dict[str, Any]:
    experiment = read_experiment(world / "experiment.toml")
    prepared = prepare_run(experiment, world, world / "motions", seed, threads=1)
    return run_experiment(prepared, world / out)


def edit(world: Path, old: str, new: str) -> None:
    file = world / "experiment.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


def test_a_hit_is_answered_and_written(world: Path, character: Character) -> None:
    edit(world, "[output]\n", "[output]\n" + SMALL)
    content = run(world)
    text = (world / "out" / "result.json").read_text(encoding="utf-8")
    assert text == to_json(content) + "\n"
    happened = content["happened"]
    assert happened["outcome"] in ("reaction", "carry on")
    assert happened["contact"]["body"] in character.body_names
    # The ball is due after a second, of which the whole is shown.
    assert happened["contact"]["time_s"] == pytest.approx(1.0, abs=0.1)
    assert set(happened["errors_m"]) == {
        "bend_back", "bend_back_mirrored", "bend_forward", "bend_forward_mirrored", "carry_on",
    }  # fmt: skip
    assert content["files"] == {"motion.npz": "written", "alignment.png": "written"}
    motion = read_npz(world / "out" / "motion.npz", character)
    assert len(motion) == content["motion"]["frames"]
    at = happened["alignment"]
    assert at["exit_frame"] < at["blend_end_frame"] < len(motion)
    assert content["quality"]["root_jump_m"] < 0.01
    # Until contact the character plays the base motion.
    base = read_npz(world / "stand.npz", character)
    contact = int(happened["contact"]["time_s"] * 30)
    np.testing.assert_allclose(motion.poses[: contact - 6], base.poses[: contact - 6])


def test_the_same_seed_gives_the_same_bytes(world: Path) -> None:
    edit(world, "[output]\n", "[output]\n" + SMALL)
    edit(world, "mass_kg = 6", "mass_kg = { uniform = [3, 8] }")
    first, again, other = run(world, "a"), run(world, "b"), run(world, "c", seed=4)
    for name in ("result.json", "motion.npz"):
        assert (world / "a" / name).read_bytes() == (world / "b" / name).read_bytes()
    assert first == again
    assert first["seed"] == 3
    assert other["seed"] == 4
    assert other["impact"]["mass_kg"] != first["impact"]["mass_kg"]


def test_a_miss_goes_on_with_the_base_motion(world: Path, character: Character) -> None:
    edit(world, "from_deg = 10", "from_deg = 10\nheight_m = 2.4")
    edit(world, "[output]\n", "[output]\n" + SMALL)
    (world / "out").mkdir()
    (world / "out" / "alignment.png").write_bytes(b"of an earlier run")
    record = {"files": {"alignment.png": "written"}, "versions": {"dynresp": "0.1.0"}}
    (world / "out" / "result.json").write_text(json.dumps(record))
    content = run(world)
    assert content["happened"] == {"outcome": "miss"}
    assert content["quality"] is None
    assert "nothing was aligned" in content["files"]["alignment.png"]
    assert not (world / "out" / "alignment.png").exists()
    motion, base = read_npz(world / "out" / "motion.npz"), read_npz(world / "stand.npz")
    first = round(content["motion"]["starts_in_base_at_s"] * 30)
    expected = base.poses[first : first + len(motion)]
    np.testing.assert_allclose(motion.poses, expected, atol=1e-12)


def test_a_batch_is_summed_up(world: Path) -> None:
    edit(world, "seed = 3", "seed = 3\ncount = 6\nshow = 2")
    edit(world, "time_s = 1.0", "time_s = { uniform = [0.5, 2.5] }")
    edit(world, "[output]\n", "[output]\n" + SMALL)
    summary = run(world)
    assert summary["responses"] == 6
    assert sum(summary["outcomes"].values()) == 6
    with (world / "out" / "table.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["hit"] for row in rows] == [str(i) for i in range(6)]
    times = [float(row["time_s"]) for row in rows]
    assert all(0.5 <= time <= 2.5 for time in times)
    assert len(set(times)) == 6
    ratios = [float(row["speed_step_ratio"]) for row in rows if row["speed_step_ratio"]]
    assert summary["metrics"]["speed_step_ratio"]["max"] == pytest.approx(max(ratios), abs=1e-6)
    assert summary["metrics"]["speed_step_ratio"]["p50"] == pytest.approx(
        np.median(ratios), abs=1e-6
    )
    assert "targets" not in summary
    assert summary["shown"] == chosen_hits(3, 6, 2)
    for number in summary["shown"]:
        folder = world / "out" / f"hit_{number:05d}"
        alone = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        assert alone["hit"] == number
        assert alone["impact"]["time_s"] == pytest.approx(times[number], abs=1e-6)


def test_a_divergence_is_reported_and_takes_no_other_down(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dynresp.experiments import runner
    from dynresp.physics.trace import Divergence
    from dynresp.response.responder import Responder
    from dynresp.response.response import Response

    def respond(self: Responder, hits: list[tuple[Motion, Any]], tell: Any) -> list[Response]:
        responses = respond_well(self, hits, tell)
        first = responses[0]
        short = first.motion.slice(0, first.start + 5)
        return [
            Response(short, first.start, first.prepared, diverged=Divergence(4, "BADQACC")),
            *responses[1:],
        ]

    respond_well = runner.Responder.respond
    monkeypatch.setattr(runner.Responder, "respond", respond)
    edit(world, "[output]\n", "[output]\n" + SMALL)
    alone = run(world, "alone")
    assert alone["happened"]["outcome"] == "diverged"
    assert alone["happened"]["diverged"]["warning"] == "BADQACC"
    edit(world, "seed = 3", "seed = 3\ncount = 3\nshow = 3")
    summary = run(world, "batch")
    assert summary["outcomes"]["diverged"] == 1
    assert summary["diverged"][0]["hit"] == 0
    assert summary["diverged"][0]["mass_kg"] == 6.0
    assert summary["measured"] == 2


def test_a_strike_shows_the_second_character(world: Path, character: Character) -> None:
    edit(world, 'kind = "ball"', 'kind = "strike"\n')
    edit(world, "mass_kg = 6\nspeed_m_s = 7\n", "")
    edit(world, "[library]", '[impact.striker]\nmotion = "stand.npz"\nhit_s = 1.0\n\n[library]')
    edit(world, "[output]\n", '[output]\nwrite = ["motion.npz"]\n')
    content = run(world)
    assert content["striker"]["motion"] == "stand.npz"
    assert content["impact"]["kind"] == "strike"


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("time_s = 1.0", "time_s = 0.1", SpecError, r"impact\.time_s: the impact is due at 0\.1 s"),
        ("time_s = 1.0", "time_s = 9.0", SpecError, r"it can be from 0\.2 to 4 s"),
        ('"stand.npz"', '"gone.bvh"', MissingMotionDataError, r"base\.motion: 'gone\.bvh' is not"),
        ('"stand.npz"', '"../gone.bvh"', DynrespError, "no such file"),
        ('"stand.npz"', '"builtin:wlak"', UnknownNameError, "Did you mean 'walk'"),
        ('"stand.npz"', '"stand.npz"\nstart_s = 9', SpecError, r"base\.start_s: .*at most 4\.00 s"),
        ('"stand.npz"', '"stand.npz"\nstop_s = 9', SpecError, r"base\.stop_s: .* got 9"),
        ('"library.toml"', '"libary"', UnknownNameError, "unknown library 'libary'"),
        ('"library.toml"', '"gone.toml"', SpecError, "gone.toml"),
    ],
)
def test_what_does_not_fit_is_refused(
    world: Path, old: str, new: str, error: type[DynrespError], message: str
) -> None:
    edit(world, old, new)
    with pytest.raises(error, match=message):
        run(world)
    assert not (world / "out").exists()


def test_the_other_motion_is_taken_for_want_of_the_first(world: Path) -> None:
    edit(world, '"stand.npz"', '"gone.bvh"\nor = "stand.npz"')
    edit(world, "[output]\n", '[output]\nwrite = ["motion.npz"]\n')
    base = run(world)["base"]
    assert base["motion"] == "stand.npz"
    assert base["instead_of"] == "gone.bvh"


def test_settings_reach_their_place() -> None:
    given = {"blend_s": 0.5, "second_pass": True, "exit_min_s": 0.2, "exit_max_s": 0.7,
             "window_s": 0.4, "entry_step_s": 0.1, "entry_max_s": 0.3, "remaining_s": 0.9,
             "graze_speed_m_s": 0.4, "carry_on_max_error_m": 2.0, "carry_on_s": 1.0,
             "substeps": 10}  # fmt: skip
    assert set(given) == set(SettingsTable.model_fields)
    config = response_config(SettingsTable(**given))
    assert config.transition.blend_s == 0.5
    assert config.transition.second_pass
    assert config.window.exit_min_s == 0.2
    assert config.window.exit_max_s == 0.7
    assert config.window.window_s == 0.4
    assert config.window.entry_step_s == 0.1
    assert config.entry_max_s == 0.3
    assert config.remaining_s == 0.9
    assert config.graze_speed == 0.4
    assert config.carry_on_max_error == 2.0
    assert config.carry_on_s == 1.0
    assert config.physics.substeps == 10
    reported = settings_record(config)
    assert {key: reported[key] for key in given} == given
    with pytest.raises(SpecError, match=r"settings\.exit_max_s"):
        response_config(SettingsTable(exit_min_s=0.6, exit_max_s=0.2))


def test_all_settings_in_force_are_recorded(world: Path) -> None:
    edit(world, "[output]\n", "[settings]\ngraze_speed_m_s = 0.1\n\n[output]\nwrite = []\n")
    content = run(world)
    assert content["settings"]["graze_speed_m_s"] == 0.1
    assert content["settings"]["blend_s"] == pytest.approx(1 / 3)
    assert content["settings"]["fixed"]["servo"]["damping_ratio"] > 0
    assert content["output"]["lead_in_s"] == 1.5
    assert content["happened"]["graze"] is False
    assert content["happened"]["speed_change_m_s"] > 0.1


def test_a_graze_is_reported(world: Path) -> None:
    edit(world, "[output]\n", "[settings]\ngraze_speed_m_s = 9.0\n\n[output]\nwrite = []\n")
    happened = run(world)["happened"]
    assert happened["outcome"] == "carry on"
    assert happened["graze"] is True


def test_a_window_longer_than_a_reaction_is_named(world: Path) -> None:
    library = world / "library.toml"
    text = library.read_text(encoding="utf-8")
    library.write_text(text.replace("[0, 60]", "[0, 20]"), encoding="utf-8")
    edit(world, "[output]\n", "[settings]\nwindow_s = 0.8\n\n[output]\nwrite = []\n")
    with pytest.raises(SpecError, match=r"settings\.window_s: reaction 'bend_back': has 20 frames"):
        run(world)


def test_a_ball_that_needs_longer_is_named_before_anything_is_simulated(world: Path) -> None:
    edit(world, "seed = 3", "seed = 3\ncount = 40")
    # A slow ball is let go 0.82 m away: it needs 0.41 s, fast ones 0.2 s.
    edit(world, "speed_m_s = 7", "speed_m_s = { choice = [2, 7] }")
    edit(world, "time_s = 1.0", "time_s = { choice = [0.3, 1.0] }")
    with pytest.raises(SpecError, match=r"impact\.time_s of hit \d+: the impact is due at 0\.3 s"):
        run(world)
    assert not (world / "out").exists()


def break_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    from dynresp.view import filmstrip

    def fail(*words: object) -> None:
        raise ValueError("Usage of double\nscripts")

    monkeypatch.setattr(filmstrip, "write_filmstrip", fail)


def test_a_picture_that_fails_costs_nothing_else(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_pictures(monkeypatch)
    edit(world, "[output]\n", '[output]\nwrite = ["filmstrip.png", "motion.npz", "motion.bvh"]\n')
    (world / "out" / "motion.bvh").mkdir(parents=True)
    content = run(world)
    assert content["files"]["motion.npz"] == "written"
    assert content["files"]["filmstrip.png"] == "failed: ValueError: Usage of double scripts"
    assert content["files"]["motion.bvh"].startswith("failed: cannot write")
    text = (world / "out" / "result.json").read_text(encoding="utf-8")
    assert json.loads(text)["files"] == content["files"]


def test_a_picture_that_fails_in_a_batch_is_in_the_summary(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_pictures(monkeypatch)
    edit(world, "seed = 3", "seed = 3\ncount = 2\nshow = 2")
    edit(world, "[output]\n", '[output]\nwrite = ["filmstrip.png"]\n')
    (world / "out" / "hit_00001" / "result.json").mkdir(parents=True)
    files = run(world)["files"]
    assert files["table.csv"] == "written"
    assert files["hit_00000/result.json"] == "written"
    assert files["hit_00000/filmstrip.png"].startswith("failed: ValueError")
    assert files["hit_00001/result.json"].startswith("failed: cannot write")


def test_all_files_of_a_folder_belong_together(world: Path) -> None:
    edit(world, "[output]\n", '[output]\nwrite = ["motion.npz"]\n')
    out = world / "out"
    run(world)
    edit(world, "seed = 3", "seed = 3\ncount = 9\nshow = 2")
    run(world)
    first = [f"hit_{n:05d}" for n in chosen_hits(3, 9, 2)]
    assert sorted(path.name for path in out.iterdir()) == [*first, "summary.json", "table.csv"]
    run(world, seed=4)
    second = [f"hit_{n:05d}" for n in chosen_hits(4, 9, 2)]
    assert second != first
    assert sorted(path.name for path in out.iterdir()) == [*second, "summary.json", "table.csv"]
    edit(world, "count = 9\nshow = 2", "count = 1")
    run(world)
    assert sorted(path.name for path in out.iterdir()) == ["motion.npz", "result.json"]


def test_shown_hits_are_chosen_by_the_seed() -> None:
    assert chosen_hits(1, 500, 3) == chosen_hits(1, 500, 3)
    assert chosen_hits(1, 500, 3) != chosen_hits(2, 500, 3)
    assert chosen_hits(1, 2, 3) == [0, 1]
    assert chosen_hits(1, 5, 0) == []
