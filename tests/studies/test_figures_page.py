"""Studies as a command, their results, and the page that is made from them."""

import json
from pathlib import Path

import pytest

from dynresp.support.errors import DynrespError
from studies import command, figures_page
from studies.catalogue import STUDIES
from studies.results import StudyResult, all_results
from studies.study import Columns, Options, Study, Target

MADE = Study(
    "made",
    "a study of the tests",
    "no time",
    lambda options: {"one": {"frames": 12_345, "share": 0.25, "rule": "-"}, "other": {"frames": 7}},
    (Target("share", "at least 30 %", at_least=0.3), Target("frames", "at least 7", at_least=7)),
    notes=("How to read it.",),
)


def result(columns: Columns, quick: bool = False) -> StudyResult:
    return StudyResult("made", "python -m studies made", "2026-12-01", "a machine", quick, columns)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> StudyResult:
    monkeypatch.setitem(STUDIES, "made", MADE)
    return result(MADE.measure(Options()))


class TestTargets:
    def test_limits_are_met_at_their_value(self) -> None:
        columns = {"a": {"x": 1.0}, "b": {"x": 2.0}, "c": {"y": 9.0}}
        assert Target("x", "", at_least=1.0).missed_by(columns) == []
        assert Target("x", "", at_least=1.5).missed_by(columns) == ["a"]
        assert Target("x", "", at_most=1.5).missed_by(columns) == ["b"]
        assert Target("x", "", at_most=0.5, column="b").missed_by(columns) == ["b"]

    def test_a_target_can_be_another_value(self) -> None:
        target = Target("arrived", "all", at_least="paths")
        columns = {"a": {"arrived": 5, "paths": 5}, "b": {"arrived": 4, "paths": 5}}
        assert target.missed_by(columns) == ["b"]


def test_the_report_is_a_table_with_a_column_for_each_thing() -> None:
    lines = MADE.to_text(MADE.measure(Options()), "a machine").splitlines()
    assert lines[0] == "made: a study of the tests"
    assert lines[2].split() == ["one", "other", "target"]
    assert lines[3].split() == ["frames", "12,345", "7", "at", "least", "7"]
    assert lines[4].split()[:3] == ["share", "0.25", "-"]
    assert lines[4].endswith("at least 30 %, missed by one")
    assert lines[-1].strip() == "How to read it."


class TestResults:
    def test_a_result_is_read_as_it_was_written(self, tmp_path: Path, made: StudyResult) -> None:
        made.write(tmp_path / "made.json")
        assert all_results(tmp_path) == {"made": made}

    @pytest.mark.parametrize("text", ["", "[]", '{"study": "made"}'])
    def test_what_is_no_result_is_refused(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "made.json").write_text(text)
        with pytest.raises(DynrespError, match="is no result of a study"):
            all_results(tmp_path)


class TestPage:
    def test_fields_are_filled(self, made: StudyResult) -> None:
        template = (
            "{{ made.one.frames | ,.0f }} {{made.one.share|.1%}} {{ made.one.rule }} "
            "{{ made.target.frames }}, {{ made.target.share }}"
        )
        assert figures_page.page(template, {"made": made}) == (
            "12,345 25.0 % - at least 7, at least 30 %: **missed**"
        )

    def test_missed_targets_are_listed(self, made: StudyResult) -> None:
        lines = figures_page.page("{{ missed }}", {"made": made}).splitlines()
        assert lines[2:] == ["| made | `share` | 0.25 (one) | at least 30 % |"]

    def test_each_result_says_what_measured_it(self, made: StudyResult) -> None:
        lines = figures_page.page("{{ sources }}", {"made": made}).splitlines()
        assert lines[2:] == ["| made | `python -m studies made` | 2026-12-01 | a machine |"]

    @pytest.mark.parametrize(
        "field", ["made.one.nothing", "made.third.frames", "none.one.frames", "made.target.rule"]
    )
    def test_what_was_not_measured_is_refused(self, made: StudyResult, field: str) -> None:
        with pytest.raises(DynrespError, match="which no result holds"):
            figures_page.page(f"{{{{ {field} }}}}", {"made": made})

    def test_quick_results_are_refused(self, made: StudyResult) -> None:
        with pytest.raises(DynrespError, match="quick run"):
            figures_page.page("", {"made": result(made.columns, quick=True)})

    def test_the_committed_page_is_what_the_committed_results_give(self) -> None:
        assert figures_page.PAGE.read_text() == figures_page.page(), (
            "run `python -m studies docs` and commit docs/figures.md"
        )

    def test_every_result_is_of_a_study_and_every_study_has_a_result(self) -> None:
        assert set(all_results()) == set(STUDIES)


class TestCommand:
    def test_studies_are_listed(self, capsys: pytest.CaptureFixture[str]) -> None:
        command.main([])
        out = capsys.readouterr().out
        assert all(name in out for name in STUDIES)

    def test_a_result_is_written(
        self, tmp_path: Path, made: StudyResult, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "made.json"
        command.main(["made", "--json", str(path), "--seed", "3", "--quick"])
        content = json.loads(path.read_text())
        assert content["command"] == "python -m studies made --seed 3 --quick"
        assert content["quick"]
        assert content["columns"]["one"]["frames"] == 12_345
        assert "missed by one" in capsys.readouterr().out

    def test_errors_are_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("DYNRESP_DATASETS", raising=False)
        with pytest.raises(SystemExit, match="error: this study needs the dataset"):
            command.main(["choosing"])
