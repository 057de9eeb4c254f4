"""How long `dynresp demo` takes, the first time after an install and later, and 500 hits."""

from __future__ import annotations

import os
import resource
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from studies.dynresp_command import run_dynresp
from studies.quality import without_pictures
from studies.study import Columns, Options, Study, Target, Value


def measure(options: Options) -> Columns:
    """Run the demo three times, with a cache that is empty at first and no motion capture.

    Then answer 500 balls, with the cache and the motion capture of this machine.
    """
    columns: dict[str, dict[str, Value]] = {}
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        # numba keeps compiled code in the cache folder, too, so that the first run compiles.
        environment = {
            **{k: v for k, v in os.environ.items() if k != "DYNRESP_MOTIONS"},
            "DYNRESP_CACHE": str(home / "cache"),
            "NUMBA_CACHE_DIR": str(home / "numba"),
        }
        for name in ("first", "second", "third"):
            options.say(f"running the demo, {name} time")
            columns[name] = _timed(["demo", "--out", str(home / name)], environment)
        if not options.quick:
            options.say("answering 500 balls")
            spec = home / "balls.toml"
            spec.write_text(without_pictures())
            columns["500_hits"] = _timed(["run", str(spec), "--out", str(home / "balls")])
    return columns


def _timed(words: Sequence[str], environment: Mapping[str, str] | None = None) -> dict[str, Value]:
    """Wall and processor time of a command of dynresp [s]."""
    before, start = _children_cpu_s(), time.perf_counter()
    run_dynresp(words, environment)
    return {"wall_s": time.perf_counter() - start, "cpu_s": _children_cpu_s() - before}


def _children_cpu_s() -> float:
    """Processor time of all child processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


STUDY = Study(
    "demo",
    "processor and wall time of `dynresp demo`, with an empty cache and after, and of 500 hits",
    "1 min",
    measure,
    (
        Target("cpu_s", "at most 15 s", at_most=15.0, column="first"),
        Target("cpu_s", "at most 5 s", at_most=5.0, column="second"),
        Target("cpu_s", "at most 5 s", at_most=5.0, column="third"),
    ),
)
