import json
from pathlib import Path

import pytest

from dynresp.cli.train import with_elapsed
from dynresp.response.prediction.classifier_file import load_classifier

from ..learning.samples import CHOICES, dataset, write_dataset
from .conftest import Command


@pytest.fixture(scope="module")
def hits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("hits"), dataset(240))


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another library's."""
    return write_dataset(
        tmp_path_factory.mktemp("other"), dataset(60, library="o", library_identity="0" * 16)
    )


def test_train_and_evaluate(hits: Path, tmp_path: Path, dynresp: Command) -> None:
    model, out = tmp_path / "models" / "tiny.skops", tmp_path / "out"
    done = dynresp("train", hits, "--out", model, "--slices", "0,0.1", "--held-out", 0.2, "--json")
    assert done.exit_code == 0, done.stderr
    reported = json.loads(done.stdout)
    assert reported["file"] == str(model)
    assert reported["classes"] == list(CHOICES)
    assert reported["slices_s"] == [0.0, 0.1]
    assert "fitting the exact model" in done.stderr
    classifier = load_classifier(model)
    assert classifier.trained_on.held_out == 0.2

    done = dynresp("evaluate", model, hits, "--out", out, "--json")
    assert done.exit_code == 0, done.stderr
    judged = json.loads(done.stdout)
    for key in ("accuracy", "top2_accuracy", "regret", "regret_top2", "per_strategy", "latency_us"):
        assert key in judged
    held_out = reported["models"]["exact"]["held_out"]
    assert judged["accuracy"] == pytest.approx(held_out["accuracy"], abs=1e-6)
    assert judged["samples"] == held_out["samples"]
    assert json.loads((out / "evaluation.json").read_text(encoding="utf-8")) == judged
    assert (out / "confusion.png").exists()
    assert (out / "per_strategy.csv").exists()

    done = dynresp("evaluate", model, hits)
    for word in ("held-out samples", "exact", "reduced", "nearest neighbours", "random", "us alone",
                 "alone", "side_fall"):  # fmt: skip
        assert word in done.stdout


def test_without_a_name_the_model_goes_where_it_is_found(
    hits: Path, tmp_path: Path, dynresp: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path))
    words = ("--vector", "small", "--classes", "strategies", "--samples", 120, "--seed", 4)
    done = dynresp("train", hits, *words)
    assert done.exit_code == 0, done.stderr
    file = tmp_path / "classifiers" / "0123456789abcdef.skops"
    assert str(file) in done.stdout
    for word in ("120 samples", "3 strategies", "two best", "held out", "support vectors"):
        assert word in done.stdout
    classifier = load_classifier(file)
    assert classifier.grouping == "strategies"
    assert (classifier.trained_on.seed, classifier.trained_on.samples) == (4, 120)


def test_what_is_asked_wrongly(hits: Path, other: Path, tmp_path: Path, dynresp: Command) -> None:
    model = tmp_path / "model.skops"
    (tmp_path / "file").write_text("")
    wrong = {
        ("train", tmp_path, "--out", model): "holds no dataset",
        ("train", hits, "--out", tmp_path / "model.pkl"): ".skops",
        ("train", hits, "--out", tmp_path / "file" / "m.skops"): "--out",
        ("train", hits, "--out", model, "--slices", "soon"): "--slices",
        ("train", hits, "--out", model, "--slices", "0.05"): "slices are some of",
        ("evaluate", model, hits): "no such file",
        ("evaluate", hits / "manifest.json", hits): "zip archive",
        ("evaluate", model, hits, "--out", tmp_path / "file"): "is a file",
    }
    for words, message in wrong.items():
        done = dynresp(*words)
        assert done.exit_code == 2, done.stderr
        assert message in done.stderr
        assert "Traceback" not in done.stderr
    assert not model.exists()
    assert dynresp("train", hits, "--out", model, "--slices", "0").exit_code == 0
    done = dynresp("evaluate", model, other)
    assert done.exit_code == 2
    assert "trained for the library 'tiny'" in done.stderr


def test_a_long_stage_is_reported_now_and_then() -> None:
    reported: list[str] = []
    times = iter([0.0, 5.0, 25.0, 26.0, 50.0, 51.0])
    report = with_elapsed(lambda stage, done, of: reported.append(stage), lambda: next(times))
    for stage in ["fitting"] * 5 + ["judging"]:
        report(stage, 0, 1)
    assert reported == ["fitting", "fitting, 25 s", "fitting, 50 s", "judging"]
