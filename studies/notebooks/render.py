"""Run notebooks and write them with their figures: `python studies/notebooks/render.py [NAME ...]`.

This is the full study, unless DYNRESP_STUDY says otherwise; README.md says what it needs.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import jupytext
import nbformat
from nbconvert.preprocessors import ExecutePreprocessor

from dynresp.support.files import replacing

FOLDER = Path(__file__).resolve().parent
MOST_BYTES = 1_500_000
"""A notebook that is larger is not written."""


def sources() -> dict[str, Path]:
    """The notebooks in percent format by name; other Python files have no such header."""
    files = sorted(FOLDER.glob("*.py"))
    return {file.stem: file for file in files if file.read_text().startswith("# ---\n# jupyter:")}


def render(source: Path) -> None:
    """Run a notebook from top to bottom and write the `.ipynb` beside it.

    Raises:
        CellExecutionError: A cell failed.
        ValueError: The notebook has become too large.
    """
    notebook = jupytext.read(source)
    ExecutePreprocessor(timeout=3600).preprocess(notebook, {"metadata": {"path": str(FOLDER)}})
    for number, cell in enumerate(notebook.cells):
        # No chance and no clock: the same figures make the same file.
        cell.id = f"cell-{number}"
        cell.metadata.pop("execution", None)
    text = nbformat.writes(notebook, nbformat.current_nbformat)
    if len(text) > MOST_BYTES:
        raise ValueError(
            f"{source.stem} has become {len(text)} bytes; expected at most {MOST_BYTES}"
        )
    with replacing(source.with_suffix(".ipynb")) as temporary:
        temporary.write_text(text + "\n")


def main() -> None:
    """Render the notebooks named, or all."""
    os.environ.setdefault("DYNRESP_STUDY", "full")
    known = sources()
    parser = argparse.ArgumentParser(description="Run notebooks and write them with their figures.")
    parser.add_argument("names", nargs="*", choices=[*known, []], metavar="NAME")
    for name in parser.parse_args().names or known:
        start = time.monotonic()
        render(known[name])
        print(f"{name}: {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
