"""Plots of the alignment: the mismatch over all exits and entries, and of all reactions.

Figures are made as objects and drawn by matplotlib's Agg; its global state is never touched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError
from dynresp.support.extras import require
from dynresp.support.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

_COLORS = "viridis_r"
_CHOSEN = "#d6402b"
_INK = "#23272e"
_BAR, _OTHER_BAR = "#379c78", "#b9c2cb"
_DPI = 150
# At most this many bars; the chosen reaction is always shown.
_MOST_BARS = 24


@dataclass(frozen=True)
class RankedReaction:
    """The mismatch of one reaction.

    Attributes:
        name: Of the reaction.
        error: Its least mismatch (window error).
    """

    name: str
    error: float


def write_alignment(
    path: Path | str,
    surface: npt.ArrayLike,
    exit_times_s: npt.ArrayLike,
    entry_times_s: npt.ArrayLike,
    chosen_exit_s: float,
    chosen_entry_s: float,
    title: str = "",
    *,
    unit: str = "",
    ranking: Sequence[RankedReaction] = (),
    chosen_name: str = "",
) -> None:
    """Write the mismatch (window error) over all exits and entries of one reaction, as a PNG.

    A map with contour lines and, beside it, the same as a surface in space (Zordan et al. 2007,
    colour plate); the chosen pair is marked in both. With a ranking, a third panel compares the
    reactions. Pairs that are not allowed have errors that are not finite; they stay blank.

    Args:
        path: The file; missing folders are made.
        surface: (exits, entries) window errors, at least one of them finite.
        exit_times_s: (exits,) time of each exit from physics [s], rising.
        entry_times_s: (entries,) time of each entry, in the reaction's clip [s], rising.
        chosen_exit_s: Exit of the chosen pair [s].
        chosen_entry_s: Entry of the chosen pair [s].
        title: First line.
        unit: Unit of the error, or empty.
        ranking: The least error of each reaction, in any order.
        chosen_name: Name in the ranking of the reaction that was chosen.

    Raises:
        MotionError: Shapes that do not fit, times that do not rise, or no finite error.
        DynrespError: The file cannot be written.
    """
    errors = np.asarray(surface, dtype=np.float64)
    exits = np.asarray(exit_times_s, dtype=np.float64)
    entries = np.asarray(entry_times_s, dtype=np.float64)
    if errors.shape != (len(exits), len(entries)) or errors.size == 0:
        raise MotionError(
            f"the error surface must be ({len(exits)}, {len(entries)}), exits by entries, "
            f"got {errors.shape}"
        )
    if not np.isfinite(errors).any():
        raise MotionError("the error surface holds no finite error; there is nothing to show")
    for what, times in (("exit", exits), ("entry", entries)):
        if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
            raise MotionError(f"{what} times must be finite and rise")
    errors = np.where(np.isfinite(errors), errors, np.nan)
    chosen = (chosen_exit_s, chosen_entry_s)
    label = "mismatch (window error)" + (f" [{unit}]" if unit else "")
    figure = _figure(13.2 if ranking else 9.6, 4.4)
    columns = (1.15, 1.0, 0.85) if ranking else (1.15, 1.0)
    grid = figure.add_gridspec(1, len(columns), width_ratios=columns)
    _map(figure, figure.add_subplot(grid[0]), errors, exits, entries, chosen, label)
    _space(figure, grid[1], errors, exits, entries, chosen)
    if ranking:
        _bars(figure.add_subplot(grid[2]), ranking, chosen_name, label)
    _heading(figure, title)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _heading(figure: Figure, title: str) -> None:
    # Dollar signs in a title are no mathematics.
    figure.suptitle(title, x=0.012, ha="left", fontsize=11, fontweight="bold", color=_INK,
                    parse_math=False)  # fmt: skip


def _figure(width: float, height: float) -> Figure:
    require("matplotlib")
    from matplotlib.figure import Figure

    return Figure((width, height), dpi=_DPI, facecolor="white", layout="constrained")


def _map(
    figure: Figure,
    axes: Axes,
    errors: FloatArray,
    exits: FloatArray,
    entries: FloatArray,
    chosen: tuple[float, float],
    label: str,
) -> None:
    """Draw errors as colours, with contour lines if the surface has two dimensions."""
    image = axes.pcolormesh(
        _edges(entries), _edges(exits), np.ma.masked_invalid(errors), cmap=_COLORS
    )
    low, high = np.nanmin(errors), np.nanmax(errors)
    if min(errors.shape) > 1 and high > low:
        # Lines at even shares of the cells: more in the valley than on the slopes.
        levels = np.unique(np.nanquantile(errors, np.linspace(0.02, 0.9, 9)))
        axes.contour(
            entries, exits, np.ma.masked_invalid(errors), levels=levels, colors="white",
            linewidths=0.6, alpha=0.7,
        )  # fmt: skip
    exit_s, entry_s = chosen
    axes.axhline(exit_s, color=_CHOSEN, lw=0.8, alpha=0.7)
    axes.axvline(entry_s, color=_CHOSEN, lw=0.8, alpha=0.7)
    axes.plot(entry_s, exit_s, "o", ms=8, mfc=_CHOSEN, mec="white", mew=1.4, zorder=5)
    left = entry_s <= 0.5 * (entries[0] + entries[-1])
    below = exit_s <= 0.5 * (exits[0] + exits[-1])
    axes.annotate(
        f"exit {exit_s:.2f} s, entry {entry_s:.2f} s",
        (entry_s, exit_s), xytext=(9 if left else -9, 9 if below else -9),
        textcoords="offset points", ha="left" if left else "right",
        va="bottom" if below else "top", fontsize=8, color=_INK,
        bbox={"boxstyle": "round,pad=0.25", "fc": "white", "ec": "none", "alpha": 0.85},
    )  # fmt: skip
    axes.set_xlabel("entry: time in the reaction [s]", fontsize=8.5)
    axes.set_ylabel("exit: time under physics after contact [s]", fontsize=8.5)
    axes.tick_params(labelsize=8)
    bar = figure.colorbar(image, ax=axes, pad=0.02)
    bar.set_label(label, fontsize=8.5, parse_math=False)
    bar.ax.tick_params(labelsize=8)


def _space(
    figure: Figure,
    cell: SubplotSpec,
    errors: FloatArray,
    exits: FloatArray,
    entries: FloatArray,
    chosen: tuple[float, float],
) -> None:
    """Draw the same as a surface in space, seen so that the valley is visible."""
    axes: Any = figure.add_subplot(cell, projection="3d")
    if min(errors.shape) > 1:
        x, y = np.meshgrid(entries, exits)
        axes.plot_surface(
            x, y, errors, cmap=_COLORS, rcount=60, ccount=90, linewidth=0, antialiased=True,
            vmin=np.nanmin(errors), vmax=np.nanmax(errors),
        )  # fmt: skip
    else:
        axes.plot(
            np.broadcast_to(entries, errors.size), np.broadcast_to(exits, errors.size),
            errors.ravel(), color=_INK,
        )  # fmt: skip
    exit_s, entry_s = chosen
    i, j = int(np.argmin(np.abs(exits - exit_s))), int(np.argmin(np.abs(entries - entry_s)))
    if np.isfinite(errors[i, j]):
        axes.plot([entry_s], [exit_s], [errors[i, j]], "o", ms=7, mfc=_CHOSEN, mec="white",
                  zorder=10)  # fmt: skip
    axes.computed_zorder = False
    axes.view_init(elev=32, azim=-62)
    axes.set_xlabel("entry [s]", fontsize=7.5, labelpad=-4)
    axes.set_ylabel("exit [s]", fontsize=7.5, labelpad=-4)
    axes.tick_params(labelsize=7, pad=-2)
    axes.locator_params(nbins=5)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor("#f4f6f8")


def _bars(axes: Axes, ranking: Sequence[RankedReaction], chosen_name: str, label: str) -> None:
    """Draw one bar for each reaction, the best at the top, the chosen one in colour."""
    ranked = sorted((r for r in ranking if np.isfinite(r.error)), key=lambda r: r.error)
    if not ranked:
        raise MotionError("no reaction with a finite error; there is nothing to show")
    shown = ranked[:_MOST_BARS]
    if chosen_name not in {reaction.name for reaction in shown}:
        kept = [reaction for reaction in ranked if reaction.name == chosen_name]
        shown = shown[: _MOST_BARS - len(kept)] + kept
    rows = np.arange(len(shown))
    colors = [_BAR if reaction.name == chosen_name else _OTHER_BAR for reaction in shown]
    errors = [reaction.error for reaction in shown]
    axes.barh(rows, errors, color=colors, height=0.72)
    names = [_short(reaction.name) for reaction in shown]
    axes.set_yticks(rows, names, fontsize=7.5, parse_math=False)
    for tick, reaction in zip(axes.get_yticklabels(), shown, strict=True):
        tick.set_fontweight("bold" if reaction.name == chosen_name else "normal")
    for row, error in zip(rows, errors, strict=True):
        axes.text(error, float(row), f" {error:.3g}", va="center", fontsize=7, color=_INK)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.set_xlim(0, 1.16 * max(max(errors), 1e-12))
    axes.set_xlabel(label, fontsize=8.5, parse_math=False)
    axes.tick_params(axis="x", labelsize=8)
    axes.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    if len(shown) < len(ranked):
        axes.set_title(f"{len(shown)} of {len(ranked)} reactions", fontsize=7.5, loc="right")


def _short(name: str) -> str:
    return name if len(name) <= 42 else name[:41] + "…"


def _edges(times: FloatArray) -> FloatArray:
    """Borders of the cells around times, half way between neighbours."""
    if len(times) == 1:
        return np.asarray(times[0] + np.array([-0.5, 0.5]) / 30.0)
    middle = 0.5 * (times[1:] + times[:-1])
    return np.concatenate([[2 * times[0] - middle[0]], middle, [2 * times[-1] - middle[-1]]])
