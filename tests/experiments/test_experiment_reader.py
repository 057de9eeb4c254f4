import tomllib
from pathlib import Path

import pytest

from dynresp.experiments.experiment_reader import parse_experiment, read_experiment
from dynresp.specs.toml_reader import MAX_FILE_BYTES
from dynresp.specs.values import Choice, Uniform
from dynresp.support.errors import SpecError
from dynresp.support.paths import example_specs

GOOD = """\
[experiment]
name = "x"
count = 2

[base]
motion = "builtin:walk"
start_s = 1

[[impact]]
kind = "ball"
time_s = { uniform = [1, 2] }
target = { choice = ["head", "chest"] }

[settings]
blend_s = 0.4

[output]
write = ["motion.npz"]
video_size_px = [640, 480]
"""

STRIKE = """\
[experiment]
name = "x"

[base]
motion = "builtin:idle"

[[impact]]
kind = "strike"
time_s = 2

[impact.striker]
motion = "a/strike.bvh"
hit_s = 1.5

[impact.striker.or]
motion = "builtin:punch"
hit_s = 0.4
side = "left"
"""


def changed(old: str, new: str, text: str = GOOD) -> dict[str, object]:
    assert old in text
    return tomllib.loads(text.replace(old, new))


def test_a_whole_file_is_understood() -> None:
    experiment = parse_experiment(tomllib.loads(GOOD))
    impact = experiment.impact[0]
    assert impact.time_s == Uniform(1.0, 2.0)
    assert impact.target == Choice(("head", "chest"))
    assert impact.from_deg == 0.0
    assert experiment.base.start_s == 1.0
    assert experiment.settings.blend_s == 0.4
    assert experiment.output.write == ("motion.npz",)
    assert experiment.library.which == "core"


def test_a_strike_has_a_striker_and_another_for_want_of_it() -> None:
    impact = parse_experiment(tomllib.loads(STRIKE)).impact[0]
    assert impact.striker.hit_s == 1.5
    assert impact.striker.side == "right"
    assert impact.striker.otherwise.hit_s == 0.4
    assert impact.striker.otherwise.side == "left"


def test_a_motion_for_want_of_the_first_can_be_one_name() -> None:
    content = changed("start_s = 1", 'or = "builtin:idle"')
    base = parse_experiment(content).base
    assert base.otherwise is not None
    assert base.otherwise.motion == "builtin:idle"


@pytest.mark.parametrize(
    "file", sorted(example_specs("experiments").glob("*.toml")), ids=lambda f: f.stem
)
def test_the_examples_are_right(file: Path) -> None:
    experiment = read_experiment(file)
    assert experiment.base.otherwise is not None, "an example must run without motion capture"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('kind = "ball"', 'kind = "bal"', "impact.kind: expected one of ball, punch, push, strike"),
        ('kind = "ball"', 'kind = "bal"', "did you mean 'ball'"),
        ('kind = "ball"\n', "", "impact.kind is missing; expected one of ball"),
        ("[[impact]]", "[impact]", "write [[impact]], with two brackets"),
        ("time_s", "tim_s", "impact.tim_s is not a key of [[impact]] of kind 'ball'"),
        ("time_s", "tim_s", "did you mean 'time_s'"),
        ("time_s", "tim_s", "impact.time_s is missing; say when it hits"),
        ("[1, 2]", "[2, 1]", "uniform takes [least, greatest] in this order, got [2, 1]"),
        (
            "[1, 2]",
            "[1, 1e9]",
            "impact.time_s: expected a number from 0 to 3600 s, got 1000000000.0",
        ),
        ("[1, 2]", "[1]", "uniform takes [least, greatest], got [1]"),
        ("uniform", "normal", "{ uniform = [least, greatest] } or { choice = [...] }"),
        ("{ uniform = [1, 2] }", "true", "expected a number from 0 to 3600 s, got True"),
        ("{ uniform = [1, 2] }", "nan", "expected a number from 0 to 3600 s, got nan"),
        ("{ uniform = [1, 2] }", '"now"', "expected a number from 0 to 3600 s, got 'now'"),
        ('"chest"]', '"chset"]', "impact.target: unknown body 'chset'. Did you mean 'chest'?"),
        ('["head", "chest"]', "[]", "choice takes a list of at least one value"),
        ('{ choice = ["head", "chest"] }', "3", "expected a name in quotes, got 3"),
        ('["motion.npz"]', '["motion"]', "output.write: expected 'motion.npz', 'motion.bvh'"),
        ("[640, 480]", "[641, 480]", "output.video_size_px: expected [width, height], two even"),
        ("[640, 480]", "[640]", "two even whole numbers from 64 to 4096, got [640]"),
        ("[640, 480]", "640", "two even whole numbers from 64 to 4096, got 640"),
        ('["motion.npz"]', '"motion.npz"', "output.write: expected a list in brackets"),
        ('name = "x"', 'name = ""', "experiment.name: expected at least one character, got ''"),
        ('name = "x"', "name = 3", "experiment.name: expected text in quotes, got 3"),
        ('name = "x"', "seed = -1", "experiment.name is missing"),
        ('name = "x"', "seed = -1", "experiment.seed: expected a whole number from 0 to"),
        ("count = 2", "count = 2.5", "experiment.count: expected a whole number from 1 to"),
        ('[experiment]\nname = "x"\ncount = 2', "", "experiment is missing; add [experiment]"),
        ("start_s = 1", "start_s = 3\nstop_s = 2", "stop_s must be above start_s, got 2 and 3"),
        ("start_s = 1", 'up = "w"', "base.up: expected 'x', 'y' or 'z', got 'w'"),
        ("start_s = 1", "mirrored = 1", "base.mirrored: expected true or false, got 1"),
        ("start_s = 1", "or = 3", "base.or: expected a table [base.or], got 3"),
        ("start_s = 1", 'or = { motion = "a", foo = 1 }', "base.or.foo is not a key of [base.or]"),
        ("start_s = 1", 'otherwise = "a"', "base.otherwise is not a key of [base]"),
        ("[settings]", "[setting]", "setting is not a key of the file (did you mean 'settings'?)"),
        ("blend_s = 0.4", "blend_s = 9", "settings.blend_s: expected a number from 0.05 to 2 s"),
        ("[settings]", '[[impact]]\nkind = "push"\n[settings]', "takes one [[impact]]"),
    ],
)
def test_wrong_values_are_refused(old: str, new: str, expected: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse_experiment(changed(old, new), "file.toml")
    message = str(caught.value)
    assert message.startswith("file.toml:")
    assert expected in message
    assert "pydantic" not in message


def test_many_mistakes_are_counted() -> None:
    extra = "".join(f"key{i} = 1\n" for i in range(20))
    with pytest.raises(SpecError, match="and 12 more"):
        parse_experiment(changed("start_s = 1\n", extra))


def test_a_strike_needs_its_striker() -> None:
    with pytest.raises(SpecError, match=r"impact\.striker is missing"):
        parse_experiment(changed('kind = "ball"', 'kind = "strike"'))
    with pytest.raises(SpecError, match=r"impact\.striker\.hit_s is missing; say when the fist"):
        parse_experiment(changed("hit_s = 1.5", "", STRIKE))
    with pytest.raises(SpecError, match=r"striker\.hits is not a key of \[impact\.striker\]"):
        parse_experiment(changed("hit_s = 1.5", "hit_s = 1.5\nhits = 2", STRIKE))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"\xff\xfe", "is not text in UTF-8"),
        (b"= 3", "is not valid TOML"),
        (b"a = " + b"[" * 100_000, "is not valid TOML"),
        (b"#" * (MAX_FILE_BYTES + 1), "is larger than 4096 KiB"),
        (b"", "experiment is missing"),
    ],
)
def test_a_file_that_is_no_experiment(tmp_path: Path, content: bytes, expected: str) -> None:
    file = tmp_path / "e.toml"
    file.write_bytes(content)
    with pytest.raises(SpecError, match=expected):
        read_experiment(file)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file; expected an experiment file"):
        read_experiment(tmp_path / "e.toml")
    with pytest.raises(SpecError, match="expected an experiment file"):
        read_experiment(tmp_path)
