"""Run all examples and keep their pictures for the gallery: `python docs/draw_examples.py`."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
PICTURES = DOCS / "images" / "examples"
WIDTH, COLOURS = 1000, 128  # small enough for a repository

if __name__ == "__main__":
    PICTURES.mkdir(parents=True, exist_ok=True)
    # With built-in motion only, so that everybody gets these pictures.
    environment = {**os.environ, "DYNRESP_MOTIONS": ""}
    with tempfile.TemporaryDirectory() as folder:
        for script in sorted((DOCS.parent / "examples").glob("*.py")):
            print(script.stem, flush=True)
            words = [sys.executable, str(script), folder]
            subprocess.run(words, check=True, env=environment, stdout=subprocess.DEVNULL)
            with Image.open(Path(folder) / f"{script.stem}.png") as picture:
                small = picture.convert("RGB")
                small.thumbnail((WIDTH, 2 * WIDTH), Image.Resampling.LANCZOS)
                small.quantize(COLOURS).save(PICTURES / f"{script.stem}.png", optimize=True)
