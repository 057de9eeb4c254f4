"""The examples in the docstrings of the runs."""

import doctest
from pathlib import Path
from types import ModuleType

import pytest

from dynresp.avatar_runs import chance_run, choice_run, hit_run, sketch_run


@pytest.mark.slow
@pytest.mark.parametrize(
    "module", [chance_run, choice_run, hit_run, sketch_run], ids=lambda m: m.__name__
)
def test_examples(module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = doctest.testmod(module)
    assert result.attempted
    assert not result.failed
    (folder,) = tmp_path.iterdir()
    assert (folder / "result.json").is_file()
