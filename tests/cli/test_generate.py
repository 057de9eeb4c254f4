import json
import subprocess
import sys
from collections import deque
from pathlib import Path

import pytest

from dynresp.cli.generate import _duration, _rate_text, _text, _with_rate

from ..datasets.samples import files, write_plan
from .conftest import Command


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    return write_plan(tmp_path)


def test_it_explains_itself(dynresp: Command) -> None:
    result = dynresp("generate", "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith("Usage: dynresp generate")
    for option in ("--out", "--count", "--seed", "--workers", "--scheduler", "--motions", "--json"):
        assert option in result.stdout


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; import dynresp.cli.app; "
        "print([m for m in ('pyarrow', 'distributed', 'numpy', 'pydantic') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_dataset_from_a_plan(plan: Path, tmp_path: Path, dynresp: Command) -> None:
    out = tmp_path / "out"
    words = ("generate", plan, "--out", out, "--motions", tmp_path, "--count", 6, "--workers", 1)
    result = dynresp(*words, "--shard-size", 4, "--json")
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert (content["samples"], content["shards"], content["shards_made"]) == (6, 2, 2)
    assert content["hits"] + content["misses"] + content["diverged"] == 6
    assert content["folder"] == str(out)
    for stage in ("loading motions ...", "starting workers ...", "labelling, "):
        assert stage in result.stderr
    before = files(out)
    result = dynresp(*words)
    assert result.stdout.startswith("6 samples in 2 shards\n")
    assert "made       0 shards" in result.stdout
    assert files(out) == before


def test_built_in_motions_that_stand_in_are_text(
    tmp_path: Path, dynresp: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dynresp.datasets import generation as making
    from dynresp.support.errors import DynrespError

    def stopped(*given: object) -> None:
        raise DynrespError("stopped")

    plan = write_plan(tmp_path)
    text = plan.read_text(encoding="utf-8").replace('which = "builtin"', 'which = "core"')
    plan.write_text(text.replace('"builtin:walk"', '"walk.bvh"\nor = "builtin:walk"'), "utf-8")
    monkeypatch.setattr(making, "_make", stopped)
    result = dynresp("generate", plan, "--out", tmp_path / "out", "--motions", tmp_path)
    assert result.exit_code == 1
    assert (
        "built-in motions take the place of motion capture that is not on this machine "
        "(walk.bvh, core)" in result.stderr
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--workers", "2", "--scheduler", "tcp://a:1"), "give only one of them"),
        (("--count", "0"), "--count"),
        (("--seed", "-1"), "--seed"),
        (("--shard-size", "0"), "--shard-size"),
        (("--workers", "0"), "--workers"),
        (("--motions", "/no/such/folder"), "does not exist"),
    ],
)
def test_wrong_arguments_are_refused(
    plan: Path, tmp_path: Path, dynresp: Command, words: tuple[str, ...], message: str
) -> None:
    result = dynresp("generate", plan, "--out", tmp_path / "out", *words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


def test_one_is_no_plural() -> None:
    content = {"samples": 1, "shards": 1, "hits": 0, "misses": 1, "diverged": 0, "shards_made": 1,
               "shards_remade": 0, "samples_per_s": None, "folder": "out"}  # fmt: skip
    assert _text(content).splitlines()[:3] == [
        "1 sample in 1 shard",
        "  outcomes   0 hits, 1 miss, 0 diverged",
        "  made       1 shard",
    ]


def test_a_wrong_plan_says_which_key(plan: Path, tmp_path: Path, dynresp: Command) -> None:
    plan.write_text(plan.read_text().replace("weight = 2", "weight = -2"), encoding="utf-8")
    result = dynresp("generate", plan, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert f"dynresp: {plan}: base 1.weight: expected a number from" in result.stderr
    assert not (tmp_path / "out").exists()


def test_rate_and_time_left() -> None:
    seen = deque([(10.0, 100), (20.0, 900)])
    assert _rate_text("labelling", 900, 8900, seen, counted=False) == (
        "labelling, 80 samples/s, 1 min 40 s left"
    )
    assert _rate_text("labelling", 100, 200, deque([(1.0, 5)]), counted=True) == (
        "labelling, 100 of 200"
    )
    assert _duration(7.2) == "7 s"
    assert _duration(7265) == "2 h 01 min"


def test_lines_are_few(monkeypatch: pytest.MonkeyPatch) -> None:
    from dynresp.cli import generate

    now = 0.0
    monkeypatch.setattr(generate.time, "monotonic", lambda: now)
    stages: list[str] = []
    report = _with_rate(lambda stage, done, of: stages.append(stage))
    report("starting workers", 0, 9000)
    for second in range(90):
        now = float(second)
        report("labelling", 100 * second, 9000)
    assert list(dict.fromkeys(stages)) == [
        "starting workers",
        "labelling, 0 of 9000",
        "labelling, 2000 of 9000, 100 samples/s, 1 min 10 s left",
        "labelling, 4000 of 9000, 100 samples/s, 50 s left",
        "labelling, 6000 of 9000, 100 samples/s, 30 s left",
        "labelling, 8000 of 9000, 100 samples/s, 10 s left",
    ]
