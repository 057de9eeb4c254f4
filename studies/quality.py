"""Quality of the responses to 500 random balls, and the targets that they have to reach."""

from __future__ import annotations

import csv
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dynresp.response.response import CARRY_ON
from dynresp.support.paths import example_specs
from studies.dynresp_command import run_dynresp
from studies.study import Columns, Options, Study, Target, Value

SPEC = example_specs("experiments") / "balls_500.toml"
"""500 random balls at a walking person."""
LIMITS = {
    "speed_step_ratio": (1.5, 0.95),
    "root_jump_m": (0.01, 0.95),
    "root_jump_deg": (1.0, 0.95),
    "root_shake_m": (0.01, 0.95),
    "root_shake_deg": (1.0, 0.95),
    "foot_depth_m": (0.02, 0.95),
    "body_depth_m": (0.04, 0.95),
    # A share of one half: the median.
    "free_physics_s": (0.5, 0.5),
    "physics_s": (0.5, 0.5),
    "foot_skate_blend_m": (0.02, 1.0),
}
"""For each figure its limit, and the share of the responses that has to be within it."""
FIGURES = (*LIMITS, "foot_skate_m", "foot_skate_worst_m")
"""All figures that are kept; `docs/quality.md` explains them."""


def measure(options: Options) -> Columns:
    """Answer the balls with the full search, and summarise the figures of all responses."""
    spec = without_pictures()
    if options.quick:
        spec = spec.replace("count = 500", "count = 10")
    options.say("answering the balls")
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / SPEC.name, Path(folder) / "out"
        file.write_text(spec)
        words = ["run", str(file), "--budget", "best", "--out", str(out)]
        if options.seed:
            words += ["--seed", str(options.seed)]
        if options.motions:
            words += ["--motions", str(options.motions)]
        run_dynresp(words)
        with (out / "table.csv").open(encoding="utf-8", newline="") as table:
            return summarised(list(csv.DictReader(table)))


def without_pictures() -> str:
    """The text of the spec, with no hit shown in pictures."""
    return SPEC.read_text().replace("show = 3", "show = 0")


def summarised(rows: Sequence[Mapping[str, str]]) -> dict[str, dict[str, Value]]:
    """Columns: counts of the hits; median, 95th percentile and largest of each figure; shares.

    Args:
        rows: Of `table.csv`, a row for each hit; cells are empty where there is no such figure.
    """
    measured = [row for row in rows if row.get(FIGURES[0])]
    reacted = [row for row in measured if row["choice"] != CARRY_ON]
    outcomes = Counter(row["outcome"] for row in rows)
    columns: dict[str, dict[str, Value]] = {
        "hits": {
            "thrown": len(rows),
            "reactions": len(reacted),
            "carried_on": len(measured) - len(reacted),
            "missed": outcomes["miss"],
            "diverged": outcomes["diverged"],
        }
    }
    for name in ("median", "p95", "largest", "share_within", "share_within_of_reactions"):
        columns[name] = {}
    for figure in FIGURES:
        values, own = (np.array([float(r[figure]) for r in part]) for part in (measured, reacted))
        columns["median"][figure] = float(np.median(values))
        columns["p95"][figure] = float(np.percentile(values, 95))
        columns["largest"][figure] = float(values.max())
        if figure in LIMITS:
            limit = LIMITS[figure][0]
            columns["share_within"][figure] = float(np.mean(values <= limit))
            columns["share_within_of_reactions"][figure] = float(np.mean(own <= limit))
    return columns


def _words(limit: float, share: float) -> str:
    if share == 0.5:
        return f"at most {limit:g} in half"
    return f"at most {limit:g} in {'all' if share == 1.0 else f'{share:.0%}'.replace('%', ' %')}"


STUDY = Study(
    "quality",
    "how smooth and physical the responses to 500 random balls are",
    "1 min",
    measure,
    tuple(
        Target(figure, _words(limit, share), at_least=share, column="share_within")
        for figure, (limit, share) in LIMITS.items()
    ),
)
