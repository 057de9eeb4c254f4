import json
import tomllib
from pathlib import Path

import pytest

from dynresp.datasets.dataset_spec import DatasetSpec, plain
from dynresp.datasets.dataset_spec_reader import parse_dataset_spec, read_dataset_spec
from dynresp.specs.toml_reader import MAX_FILE_BYTES
from dynresp.specs.values import Choice, Uniform
from dynresp.support.errors import SpecError
from dynresp.support.paths import example_specs

from .samples import PLAN, plan

EXAMPLES = sorted((example_specs("datasets")).glob("*.toml"))


def test_a_whole_file_is_understood() -> None:
    found = plan()
    assert found.plan.count == 20
    assert [base.title for base in found.base] == ["builtin:walk", "builtin:idle"]
    assert [base.weight for base in found.base] == [2.0, 1.0]
    ball, push = found.impact
    assert ball.phase == Uniform(0.0, 1.0)
    assert ball.hit.kind == "ball"
    assert ball.hit.speed_m_s == Uniform(4.0, 14.0)
    assert push.weight == 0.5
    assert push.hit.target == Choice(("chest", "pelvis"))
    assert found.library.which == "builtin"


def test_there_are_examples() -> None:
    names = {file.stem for file in EXAMPLES}
    assert {"builtin_walk", "core_walk_balls", "core_idle_balls", "core_guard_balls"} <= names


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda f: f.stem)
def test_the_examples_are_right(file: Path) -> None:
    found = read_dataset_spec(file)
    for base in found.base:
        assert base.motion.startswith("builtin:") or base.otherwise is not None


def test_count_and_seed_of_the_command_line_count() -> None:
    changed = plan().changed(7, 8)
    assert (changed.plan.count, changed.plan.seed) == (7, 8)
    assert plan().changed(None, None) == plan()


@pytest.mark.parametrize("text", [PLAN, *(f.read_text(encoding="utf-8") for f in EXAMPLES)])
def test_a_plan_in_plain_words_is_the_same_plan(text: str) -> None:
    found = parse_dataset_spec(tomllib.loads(text))
    again = json.loads(json.dumps(plain(found)))
    assert DatasetSpec.model_validate(again) == found


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('kind = "ball"', 'kind = "bal"', "impact 1.kind: expected one of ball, punch, push, got"),
        ('kind = "ball"', 'kind = "strike"', "expected one of ball, punch, push, got 'strike'"),
        ('kind = "ball"\n', "", "impact 1.kind is missing; expected one of ball"),
        (
            'kind = "ball"',
            'kind = "ball"\ntime_s = 2',
            "impact 1: a dataset spec has no time_s, got 2",
        ),
        ("mass_kg", "mas_kg", "impact 1.mas_kg is not a key of [[impact]] of kind 'ball'"),
        ("mass_kg", "mas_kg", "did you mean 'mass_kg'"),
        ("mass_kg", "hit", "impact 1.hit is not a key of [[impact]] of kind 'ball'"),
        ("force_n", "forc", "impact 2.forc is not a key"),
        ("[50.0, 900.0]", "[50.0, 1e9]", "impact 2.force_n: expected a number from 1 to 10000 N"),
        ("weight = 0.5", "phase = 2", "impact 2.phase: expected a number from 0 to 1 (a share)"),
        ("weight = 0.5", "weight = 0", "impact 2.weight: expected a number from 1e-06 to 1e+06"),
        ('"pelvis"', '"pelivs"', "impact 2.target: unknown body 'pelivs'. Did you mean 'pelvis'?"),
        ("[[impact]]\nkind", "[impact]\nkind", "not valid TOML"),
        ("count = 20", "count = 0", "plan.count: expected a whole number from 1 to 10000000"),
        ("count = 20", "", "plan.count is missing; give the number of samples"),
        ('name = "A test"', "", "plan.name is missing; describe the samples"),
        ('[plan]\nname = "A test"\nseed = 5\ncount = 20', "", "plan is missing; add [plan]"),
        ("seed = 5", "sed = 5", "plan.sed is not a key of [plan] (did you mean 'seed'?)"),
        ('"builtin:idle"', '"builtin:walk"', "two [[base]] tables have the name 'builtin:walk'"),
        ('"builtin:idle"', "3", "base 2.motion: expected text in quotes, got 3"),
        ("weight = 2", "mirrored = 1", "base 1.mirrored: expected true or false, got 1"),
        ("weight = 2", "stat_s = 1", "base 1.stat_s is not a key of [base]"),
        ("[library]", "[librery]", "librery is not a key of the file (did you mean 'library'?)"),
        ("[library]", "[experiment]\n[library]", "experiment is not a key of the file"),
        ("[library]", "[settings]\nblend_s = 9\n[library]", "settings.blend_s: expected a number"),
    ],
)
def test_wrong_values_are_refused(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in PLAN
    file = tmp_path / "file.toml"
    file.write_text(PLAN.replace(old, new), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_dataset_spec(file)
    message = str(caught.value)
    assert message.startswith(str(file))
    assert expected in message
    assert "pydantic" not in message


def test_one_table_needs_no_number() -> None:
    content = tomllib.loads(PLAN)
    content["impact"] = [{"kind": "ball", "mass_kg": -1}]
    with pytest.raises(SpecError, match=r"dataset spec: impact\.mass_kg: expected"):
        parse_dataset_spec(content)


@pytest.mark.parametrize("key", ["base", "impact"])
def test_lists_of_tables(key: str) -> None:
    content = tomllib.loads(PLAN)
    with pytest.raises(SpecError, match=rf"write \[\[{key}\]\]"):
        parse_dataset_spec({**content, key: content[key][0]})
    with pytest.raises(SpecError, match=rf"{key}: expected at least 1 table \[\[{key}\]\], got 0"):
        parse_dataset_spec({**content, key: []})
    many = [content[key][0]] * 101
    with pytest.raises(SpecError, match=rf"at most 100 tables \[\[{key}\]\], got 101"):
        parse_dataset_spec({**content, key: many})
    with pytest.raises(SpecError, match=f"{key}: expected"):
        parse_dataset_spec({**content, key: 3})
    with pytest.raises(SpecError, match=f"{key} 2: expected a table"):
        parse_dataset_spec({**content, key: [content[key][0], 3]})


def test_many_mistakes_are_counted() -> None:
    content = tomllib.loads(PLAN)
    with pytest.raises(SpecError, match="and 12 more"):
        parse_dataset_spec({**content, **{f"key{i}": 1 for i in range(20)}})


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"\xff\xfe", "is not text in UTF-8"),
        (b"= 3", "is not valid TOML"),
        (b"a = " + b"[" * 100_000, "is not valid TOML"),
        (b"#" * (MAX_FILE_BYTES + 1), "is larger than 4096 KiB"),
        (b"", "plan is missing"),
    ],
)
def test_a_file_that_is_no_dataset_spec(tmp_path: Path, content: bytes, expected: str) -> None:
    file = tmp_path / "p.toml"
    file.write_bytes(content)
    with pytest.raises(SpecError, match=expected):
        read_dataset_spec(file)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file; expected a dataset spec"):
        read_dataset_spec(tmp_path / "p.toml")
