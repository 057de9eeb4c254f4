"""What is said of many responses: a row for each, and how good they are together."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.experiments.response_record import OUTCOMES, outcome
from dynresp.physics.drawn_hits import Hit
from dynresp.response.response import Response
from dynresp.response.response_quality import Quality
from dynresp.support.files import replacing

FIGURES = tuple(item.name for item in fields(Quality))
"""Names of the quality figures."""


@dataclass(frozen=True)
class Target:
    """What a figure shall reach.

    Attributes:
        figure: Its name.
        limit: It shall be at most this.
        share: In at least this share of the responses.
    """

    figure: str
    limit: float
    share: float


TARGETS = (
    Target("speed_step_ratio", 1.5, 0.95),
    Target("root_jump_m", 0.01, 0.95),
    Target("root_jump_deg", 1.0, 0.95),
    Target("root_shake_m", 0.01, 0.95),
    Target("root_shake_deg", 1.0, 0.95),
    Target("foot_skate_blend_m", 0.02, 1.0),
    Target("foot_depth_m", 0.02, 0.95),
    Target("body_depth_m", 0.04, 0.95),
    # A share of one half: the median. Wholly under physics, and until the blend has ended.
    Target("free_physics_s", 0.5, 0.5),
    Target("physics_s", 0.5, 0.5),
)
"""What responses shall reach; `docs/quality.md` explains the figures."""


def row(hit: Hit, response: Response, quality: Quality | None) -> dict[str, Any]:
    """One response as a row of the table; what it has not is left out."""
    cells: dict[str, Any] = {"hit": hit.number, **hit.asked, "outcome": outcome(response)}
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
    """Write rows as CSV, empty where a row has no such cell.

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
    """Outcomes, choices, and the figures of all responses together.

    Returns:
        `outcomes` and `choices` count; `figures` gives the median, the 95th percentile and the
        largest of each figure over the responses that have it; `targets` says for each target the
        share of those responses that are within it; `diverged` lists the hits that diverged, with
        all that was asked of them.
    """
    measured = [cells for cells in rows if FIGURES[0] in cells]
    outcomes = Counter(cells["outcome"] for cells in rows)
    choices = Counter(cells["choice"] for cells in rows if "choice" in cells)
    figures: dict[str, Any] = {}
    for name in FIGURES if measured else ():
        values = np.array([cells[name] for cells in measured])
        p50, p95 = (float(np.percentile(values, p)) for p in (50, 95))
        figures[name] = {"p50": p50, "p95": p95, "max": float(values.max())}
    return {
        "responses": len(rows),
        "measured": len(measured),
        "outcomes": {name: outcomes[name] for name in OUTCOMES},
        "choices": dict(sorted(choices.items(), key=lambda item: (-item[1], item[0]))),
        "figures": figures,
        "targets": [_judge(target, measured) for target in TARGETS] if measured else [],
        "diverged": [cells for cells in rows if cells["outcome"] == "diverged"],
    }


def _judge(target: Target, measured: Sequence[dict[str, Any]]) -> dict[str, Any]:
    within = float(np.mean([cells[target.figure] <= target.limit for cells in measured]))
    return {
        "figure": target.figure,
        "limit": target.limit,
        "share_wanted": target.share,
        "share_within": within,
        "met": within >= target.share,
    }
