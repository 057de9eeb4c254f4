"""Every notebook runs from top to bottom, and its rendering is of what it says now."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest

from dynresp.support.errors import UsageError

FOLDER = Path(__file__).parents[2] / "studies" / "notebooks"
NOTEBOOKS = [
    path for path in sorted(FOLDER.glob("*.py")) if path.read_text().startswith("# ---\n# jupyter:")
]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The small study, without motion capture; its datasets are made once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYNRESP_STUDY", "small")
        patch.setenv("DYNRESP_DATASETS", str(tmp_path_factory.mktemp("datasets")))
        patch.setenv("DYNRESP_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("DYNRESP_MOTIONS", raising=False)
        patch.syspath_prepend(FOLDER)
        import study

        yield study
        del sys.modules["study"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.slow
def test_a_notebook_runs(path: Path, study: ModuleType) -> None:
    from matplotlib import pyplot as plt

    mpl.use("Agg")
    try:
        with mpl.rc_context():
            runpy.run_path(str(path))
    finally:
        plt.close("all")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_rendering_is_of_its_notebook(path: Path) -> None:
    import jupytext

    rendered = jupytext.read(path.with_suffix(".ipynb"))
    source = jupytext.read(path)
    assert [cell.source for cell in rendered.cells] == [cell.source for cell in source.cells]
    assert any(cell.get("outputs") for cell in rendered.cells)
    assert path.with_suffix(".ipynb").stat().st_size < 1_500_000


def test_the_full_study_says_what_makes_a_missing_dataset(
    study: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "FULL", True)
    monkeypatch.setattr(study, "folder", lambda: tmp_path)
    with pytest.raises(UsageError, match=r"core_idle_balls\.toml --out .*idle"):
        study.dataset.__wrapped__("idle")
    with pytest.raises(UsageError, match=r"full_walk_balls\.toml --out .*full --count 15000"):
        study.dataset.__wrapped__("full")
    with pytest.raises(UsageError, match=r"dynresp train .*walk --out .*walk\.skops"):
        study.classifier.__wrapped__()


def test_a_table_is_aligned(study: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    study.table(("name", "share"), [("a", study.percent(0.5)), ("longer", study.percent(1.0))])
    assert capsys.readouterr().out.splitlines() == [
        "name      share",
        "------  -------",
        "a        50.0 %",
        "longer  100.0 %",
    ]
