"""The plan: a way over the ground as seen from above."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dynresp.files import replacing
from dynresp.motion import rotations
from dynresp.view.shapes import BLOCK_COLOR, PATH_COLOR, mix
from dynresp.view.story import Block, Story

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_OTHER_PATH = (0.25, 0.62, 0.45)
_TRACK = (0.80, 0.30, 0.14)
_DPI = 150
# Longer side of the picture, and least shorter one [inch].
_LONG, _SHORT = 10.0, 4.0
# An arrow in this interval shows where the character faces [s], about as long [m].
_ARROW_S, _ARROW_M = 1.0, 0.3


def write_plan(story: Story, path: Path | str, marks: Sequence[float] = ()) -> None:
    """Write the plan of a story as a PNG; the file is whole or not there.

    It shows the ways drawn on the ground, the blocks, the way of the main character's pelvis with
    arrows that show where it faces, second by second, its start and its end.

    Args:
        story: What is shown.
        path: The file; missing folders are made.
        marks: Times [s] at which the way is marked by a dot, such as its jumps.

    Raises:
        DynrespError: The file cannot be written.
    """
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    track = story.motion.root_positions[:, :2]
    corners = [_corners(block) for block in story.blocks]
    points = np.concatenate([track, *(line.points for line in story.paths), *corners])
    low, high = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    wide, deep = high - low
    scale = _LONG / max(wide, deep)
    size = (max(_SHORT, wide * scale), max(_SHORT, deep * scale) + 0.6)
    figure = Figure(size, dpi=_DPI, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.grid(color=(0.9, 0.91, 0.92), lw=0.6)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_color(_FAINT_INK)
    axes.tick_params(colors=_FAINT_INK, labelsize=7)
    axes.set_xlabel("x [m]", fontsize=8, color=_FAINT_INK)
    axes.set_ylabel("y [m]", fontsize=8, color=_FAINT_INK)
    if corners:
        # The higher a block the darker.
        highest = max(1e-6, *(block.top for block in story.blocks))
        tops = [max(block.top, 0.0) / highest for block in story.blocks]
        shades = [mix(BLOCK_COLOR, (0, 0, 0), 0.4 * top) for top in tops]
        patches = PatchCollection([Polygon(c) for c in corners], facecolors=shades)
        patches.set_edgecolor((1.0, 1.0, 1.0, 0.5))
        patches.set_linewidth(0.4)
        axes.add_collection(patches)
    for line, color in zip(story.paths, itertools.cycle((PATH_COLOR, _OTHER_PATH)), strict=False):
        axes.plot(*line.points.T, color=color, lw=3.5, alpha=0.45, label=line.name,
                  solid_capstyle="round")  # fmt: skip
    axes.plot(*track.T, color=_TRACK, lw=1.3, label="pelvis")
    step = max(1, round(_ARROW_S * story.motion.fps))
    yaws = np.asarray(rotations.yaw_of(story.motion.root_quaternions[::step]))
    axes.quiver(*track[::step].T, np.cos(yaws), np.sin(yaws), angles="xy", scale_units="xy",
                scale=1.0 / _ARROW_M, width=0.0022, color=_INK, zorder=3)  # fmt: skip
    if len(marks):
        at = track[[story.frame_at(float(mark)) for mark in marks]]
        axes.plot(*at.T, ls="", marker="o", ms=2.2, color=_INK, alpha=0.5, label="jump")
    axes.plot(*track[0], ls="", marker="o", ms=7, mfc="white", mec=_TRACK, mew=1.5, label="start")
    axes.plot(*track[-1], ls="", marker="s", ms=7, color=_TRACK, label="end")
    figure.suptitle(story.title, x=0.02, ha="left", fontsize=11, fontweight="bold", color=_INK,
                    parse_math=False)  # fmt: skip
    axes.set_title(story.subtitle, loc="left", fontsize=8.5, color=_FAINT_INK, parse_math=False)
    figure.legend(loc="outside lower right", ncols=6, frameon=False, fontsize=8, labelcolor=_INK)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _corners(block: Block) -> np.ndarray:
    """(4, 2) the corners of a block on the ground."""
    x, y = block.half_sizes[:2]
    turn = rotations.from_yaw(block.yaw)
    local = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return rotations.rotate(turn, local)[:, :2] + np.array(block.center[:2])
