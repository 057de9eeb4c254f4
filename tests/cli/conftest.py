"""A folder with everything an experiment needs, and the command line."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from dynresp.cli.app import app
from dynresp.motion.character import Character

from ..experiments.samples import write_world

Command = Callable[..., Result]


@pytest.fixture
def world(tmp_path: Path, character: Character) -> Path:
    return write_world(tmp_path, character).parent


@pytest.fixture
def dynresp(monkeypatch: pytest.MonkeyPatch) -> Command:
    """Runs a command in this process."""
    monkeypatch.delenv("DYNRESP_MOTIONS", raising=False)

    def run(*words: object) -> Result:
        return CliRunner().invoke(app, [str(word) for word in words], prog_name="dynresp")

    return run
