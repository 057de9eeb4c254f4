"""Every notebook runs from top to bottom."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
@pytest.mark.slow
def test_a_notebook_runs(path: Path) -> None:
    mpl.use("Agg")
    runpy.run_path(str(path))


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
def test_a_notebook_has_its_rendering(path: Path) -> None:
    assert path.with_suffix(".ipynb").is_file()
