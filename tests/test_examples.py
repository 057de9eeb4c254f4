"""Every example runs as a user runs it, and draws its picture."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

FOLDER = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))


def test_there_are_some() -> None:
    assert len(SCRIPTS) >= 10


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda f: f.stem)
def test_it_runs(script: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "DYNRESP_MOTIONS": "", "MPLBACKEND": "agg"}
    words = [sys.executable, str(script), str(tmp_path / "out")]
    done = subprocess.run(
        words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "out" / f"{script.stem}.png") as picture:
        colours = picture.convert("RGB").getcolors(1 << 24)
    assert colours is not None
    assert len(colours) > 50
    # It writes nowhere but to the folder that was named.
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda f: f.stem)
def test_it_is_short_and_uses_the_front_door_alone(script: Path) -> None:
    text = script.read_text(encoding="utf-8")
    assert 15 <= len(text.splitlines()) <= 80
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    froms = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [module for module in froms if module and module.startswith("dynresp")]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda f: f.stem)
def test_the_gallery_has_its_picture(script: Path) -> None:
    picture = FOLDER.parent / "docs" / "images" / "examples" / f"{script.stem}.png"
    assert picture.stat().st_size < 300_000
