"""Pictures of the notebook on time alignment: landscapes, quality and regret, stages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d import Axes3D
from study import BLUE, GREEN, GREY, INK, ORANGE, RED

from dynresp.bench.measure import BenchResult
from dynresp.motion.rotations import FloatArray
from dynresp.response.alignment.alignment_result import Alignment
from dynresp.response.alignment.error_surface import AlignmentSurface

_STAGE_COLOURS = {
    "physics": GREY,
    "bodies": "#5f6770",
    "choice": GREEN,
    "search": ORANGE,
    "rewind": RED,
}


@dataclass(frozen=True, eq=False)
class Sampled:
    """The times at which an alignment samples a landscape.

    Attributes:
        exits_s: One for each set of entries.
        entries_s: Of every set.
    """

    exits_s: FloatArray
    entries_s: FloatArray

    @classmethod
    def of(
        cls, exits: Sequence[int], entries: tuple[int, int], step_s: float, fps: float
    ) -> Sampled:
        """The samples between the first and the last exit, and the first and the last entry."""
        rows = _spaced(exits[0], exits[-1], step_s * fps) / fps
        return cls(rows, _spaced(*entries, step_s * fps) / fps)


def _spaced(first: int, last: int, step: float) -> FloatArray:
    """Frames from first to last, none farther from the next than a step."""
    return np.linspace(first, last, math.ceil((last - first) / step) + 1)


def landscape_in_space(space: Axes3D, found: AlignmentSurface, title: str) -> None:
    """Draw window errors over exit and entry."""
    x, y = np.meshgrid(found.entries_s, found.exits_s)
    space.plot_surface(x, y, found.errors, cmap="viridis_r", rcount=40, ccount=40, linewidth=0)
    space.set(xlabel="entry [s]", ylabel="exit [s]", zlabel="window error [m]", title=title)
    space.view_init(elev=30, azim=-60)
    space.set_box_aspect(None, zoom=0.88)


def way_down(
    ax: Axes, found: AlignmentSurface, sampled: Sampled, path_s: FloatArray, at: Alignment
) -> None:
    """Draw a landscape from above, with what an alignment looked at and how it went down.

    Args:
        ax: Where.
        found: The landscape.
        sampled: Where it is sampled.
        path_s: (k, 2) exit and entry, step by step [s].
        at: The alignment that was found.
    """
    exits, entries = path_s.T
    rows, columns = sampled.exits_s, sampled.entries_s
    image = ax.pcolormesh(
        found.entries_s, found.exits_s, found.errors, cmap="viridis_r", shading="nearest"
    )
    for k, row in enumerate(rows):
        seen = {"mfc": "white", "mec": INK} if k < at.sets else {"mfc": "none", "mec": "white"}
        ax.plot(columns, np.full(len(columns), row), "o", ms=5, mew=0.8, clip_on=False, **seen)
    ax.plot(entries, exits, "-", color=RED, lw=1.6)
    ax.plot(entries[0], exits[0], "o", color="white", mec=RED, mew=1.6, ms=7, clip_on=False)
    ax.plot(entries[-1], exits[-1], "o", color=RED, mec="white", mew=1.0, ms=8, clip_on=False)
    ax.set(
        xlabel="entry: time in the reaction [s]",
        ylabel="exit: time after contact [s]",
        title=f"{at.error:.3f} m after {at.evaluations} errors, "
        f"{found.errors.min():.3f} m of {found.errors.size}",
    )
    ax.figure.colorbar(image, ax=ax, pad=0.02)


def quality_against_speed(measured: Mapping[tuple[str, bool], BenchResult]) -> None:
    """Draw how many alignments are good over their time, by sampling, with and without BFGS."""
    _, ax = plt.subplots(figsize=(7.5, 3.8))
    for refine, colour, label, side in (
        (False, GREY, "best sample", -15),
        (True, GREEN, "with BFGS", 8),
    ):
        own = {name: r for (name, other), r in measured.items() if other == refine}
        own = {
            name.partition(",")[0]: r
            for name, r in own.items()
            if name.count(",") == 0 or "paper" in name
        }
        near = [100 * r.more["within_2_percent"] for r in own.values()]
        ax.plot([r.value for r in own.values()], near, "o-", ms=8, lw=1, color=colour, label=label)
        for (name, r), share in zip(own.items(), near, strict=True):
            ax.annotate(
                name,
                (r.value, share),
                xytext=(0, side),
                textcoords="offset points",
                ha="center",
                fontsize=8.5,
            )
    ax.axhline(95, color=INK, lw=0.8, ls=":")
    ax.set(
        ylim=(None, 108),
        xlabel="time of one alignment [us]",
        ylabel="within 2 % of the exhaustive error [%]",
        title="Alignment: quality against speed, by the distance of the samples",
    )
    ax.legend(loc="lower right")


def regret_against_budget(points: Mapping[str, tuple[float, float]]) -> None:
    """Draw mean regret [%] over the median time of a choice [ms], for seven choosers by name."""
    _, ax = plt.subplots(figsize=(8.5, 3.8))
    for (name, (ms, regret)), colour, marker in zip(
        points.items(), (GREEN, GREEN, BLUE, BLUE, ORANGE, RED, INK), "oossDoX", strict=True
    ):
        filled = "white" if "reduced" in name else colour
        ax.plot(ms, regret, marker, ms=10, color=colour, mfc=filled, label=name, ls="")
    ax.set(
        xlim=(0, None),
        ylim=(0, None),
        xlabel="time of a choice, median [ms]",
        ylabel="mean regret [%]",
        title="Regret against budget",
    )
    most_ms, most = ax.get_xlim()[1], ax.get_ylim()[1]
    ax.set(xlim=(0, 1.1 * most_ms), ylim=(-0.02 * most, 1.1 * most))
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def stages(took: Mapping[str, float], of_budgets: Mapping[str, Sequence[str]]) -> None:
    """Draw the stages of a response as bars.

    Args:
        took: Time of each stage [ms].
        of_budgets: The stages of each budget, in order.
    """
    _, ax = plt.subplots(figsize=(10, 2.8))
    for row, own in enumerate(of_budgets.values()):
        left = 0.0
        for name in own:
            ax.barh(row, took[name], left=left, color=_STAGE_COLOURS[name], height=0.6)
            left += took[name]
        ax.text(left, row, f"  {left:.1f} ms", va="center", fontsize=9)
    for name, colour in _STAGE_COLOURS.items():
        ax.barh(0, 0, color=colour, label=name)
    ax.set_yticks(range(len(of_budgets)), of_budgets)
    ax.set(xlabel="time in the frame of the hit [ms]", title="Stages of a response, by budget")
    ax.margins(x=0.08)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
