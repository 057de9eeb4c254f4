"""The table and the summary of a batch: a row for each hit, and metrics over all of them."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.experiments.response_record import OUTCOMES, outcome
from dynresp.physics.drawn_hits import Hit
from dynresp.response.response import Response
from dynresp.response.response_quality import Quality
from dynresp.support.files import replacing

METRICS = tuple(item.name for item in fields(Quality))
"""Names of the quality metrics; `docs/quality.md` explains them."""


def row(hit: Hit, response: Response, quality: Quality | None) -> dict[str, Any]:
    """One response as a row of the table, without the cells that it does not have."""
    cells: dict[str, Any] = {"hit": hit.number, **hit.values, "outcome": outcome(response)}
    if response.contact is not None:
        cells["body"] = response.contact.body
        cells["force_n"] = response.contact.force
    if response.exit is not None and response.contact_frame is not None:
        fps = response.motion.fps
        cells["speed_change_m_s"] = response.speed_change
        cells["graze"] = response.graze
        cells["choice"] = response.choice
        cells["error_m"] = response.error
        cells["exit_after_contact_s"] = (response.exit - response.contact_frame) / fps
        cells["entry_time_in_clip_s"] = (response.entry or 0) / fps
    if response.diverged is not None:
        cells["diverged"] = response.diverged.warning
    if quality is not None:
        cells.update(asdict(quality))
    return cells


def write_table(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write rows as CSV; a cell that a row does not have stays empty.

    Raises:
        DynrespError: The file cannot be written.
    """
    columns = dict.fromkeys(key for cells in rows for key in cells)
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(columns), lineterminator="\n")
        writer.writeheader()
        for cells in rows:
            shown = {k: round(v, 6) if isinstance(v, float) else v for k, v in cells.items()}
            writer.writerow(shown)


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Outcomes, choices, and the metrics of all responses together.

    Args:
        rows: Of the table.

    Returns:
        `outcomes` and `choices` count; `metrics` gives the median, the 95th percentile and the
        largest of each metric over the responses that have it; `diverged` lists the rows of the
        hits whose simulation diverged.
    """
    measured = [cells for cells in rows if METRICS[0] in cells]
    outcomes = Counter(cells["outcome"] for cells in rows)
    choices = Counter(cells["choice"] for cells in rows if "choice" in cells)
    metrics: dict[str, Any] = {}
    for name in METRICS if measured else ():
        values = np.array([cells[name] for cells in measured])
        p50, p95 = (float(np.percentile(values, p)) for p in (50, 95))
        metrics[name] = {"p50": p50, "p95": p95, "max": float(values.max())}
    return {
        "responses": len(rows),
        "measured": len(measured),
        "outcomes": {name: outcomes[name] for name in OUTCOMES},
        "choices": dict(sorted(choices.items(), key=lambda item: (-item[1], item[0]))),
        "metrics": metrics,
        "diverged": [cells for cells in rows if cells["outcome"] == "diverged"],
    }
