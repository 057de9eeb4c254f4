"""The ground plan of a story: the path of the character, obstacles and lines, from above."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dynresp.motion import rotations
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view.body_shapes import BLOCK_COLOR, BOUNDS_COLOR, CAPSULE_COLOR, PATH_COLORS, mix
from dynresp.view.story import Block, MovingCapsule, Story, row_at

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_TRACK = (0.80, 0.30, 0.14)
_DPI = 150
# Longer side of the picture, and least shorter one [inch].
_LONG, _SHORT = 10.0, 4.0
# Heights of the heading and of the legend [inch].
_HEADING, _LEGEND = 0.55, 0.35
# Arrows show where the character faces: their interval [s], their largest number, and their length
# as a share of the longer side.
_ARROW_S, _MOST_ARROWS, _ARROW = 1.0, 80, 0.03


def write_ground_plan(story: Story, path: Path | str, marks: Sequence[float] = ()) -> None:
    """Write the plan of a story as a PNG; the file is whole or not there.

    It shows the bounds of the world, lines on the ground, blocks and bars, and the path of the main
    character's pelvis with its start, its end, and arrows that show where the character faces: one
    a second in a short walk.

    Args:
        story: What is shown.
        path: The file; missing folders are made.
        marks: Times [s] at which the path gets a dot, such as jumps.

    Raises:
        DynrespError: The file cannot be written.
    """
    require("matplotlib")
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    track = story.motion.root_positions[:, :2]
    corners = [_corners(block) for block in story.blocks]
    bars = [bar for rod in story.capsules if (bar := _bar(rod)) is not None]
    outline = [] if story.outline is None else [story.outline]
    lines = [line.points for line in story.paths]
    points = np.concatenate([track, *lines, *corners, *bars, *outline])
    low, high = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    wide, deep = high - low
    scale = _LONG / max(wide, deep)
    size = (max(_SHORT, wide * scale), max(_SHORT, deep * scale) + _HEADING + _LEGEND)
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
        # Higher blocks are darker, but light enough for the path that is drawn over them.
        highest = max(1e-6, *(block.top for block in story.blocks))
        tops = [max(block.top, 0.0) / highest for block in story.blocks]
        light = mix(BLOCK_COLOR, (1.0, 1.0, 1.0), 0.75)
        shades = [mix(light, BLOCK_COLOR, top) for top in tops]
        patches = PatchCollection([Polygon(c) for c in corners], facecolors=shades)
        patches.set_edgecolor((1.0, 1.0, 1.0, 0.5))
        patches.set_linewidth(0.4)
        axes.add_collection(patches)
    for number, bar in enumerate(bars):
        axes.plot(*bar.T, color=CAPSULE_COLOR, lw=3.0, alpha=0.6, solid_capstyle="round",
                  label="bars" if number == 0 else None)  # fmt: skip
    for points in outline:
        axes.plot(*points.T, color=BOUNDS_COLOR, lw=2.5, label="bounds")
    for line, color in zip(story.paths, itertools.cycle(PATH_COLORS), strict=False):
        axes.plot(*line.points.T, color=color, lw=3.5, alpha=0.45, label=line.name,
                  solid_capstyle="round")  # fmt: skip
    axes.plot(*track.T, color=_TRACK, lw=1.3, label="pelvis")
    interval = max(_ARROW_S, story.duration / _MOST_ARROWS)
    step = max(1, round(interval * story.motion.fps))
    yaws = np.asarray(rotations.yaw_of(story.motion.root_quaternions[::step]))
    axes.quiver(*track[::step].T, np.cos(yaws), np.sin(yaws), angles="xy", scale_units="xy",
                scale=1.0 / (_ARROW * max(wide, deep)), width=0.0022, color=_INK,
                zorder=3)  # fmt: skip
    if len(marks):
        at = track[[story.frame_at(float(mark)) for mark in marks]]
        axes.plot(*at.T, ls="", marker="o", ms=2.2, color=_INK, alpha=0.5, label="jump")
    axes.plot(*track[0], ls="", marker="o", ms=7, mfc="white", mec=_TRACK, mew=1.5, label="start")
    axes.plot(*track[-1], ls="", marker="s", ms=7, color=_TRACK, label="end")
    side = 0.12 / size[0]
    figure.text(side, 1 - 0.1 / size[1], story.title, va="top", fontweight="bold", color=_INK,
                fontsize=11, parse_math=False)  # fmt: skip
    figure.text(side, 1 - 0.32 / size[1], story.subtitle, va="top", fontsize=8.5,
                color=_FAINT_INK, parse_math=False)  # fmt: skip
    figure.legend(loc="lower right", ncols=8, frameon=False, fontsize=8, labelcolor=_INK,
                  borderaxespad=0.3, columnspacing=1.4, handlelength=1.6)  # fmt: skip
    engine = figure.get_layout_engine()
    assert engine is not None
    low, free = _LEGEND / size[1], 1.0 - (_HEADING + _LEGEND) / size[1]
    engine.set(rect=(0.0, low, 1.0, free))  # type: ignore[call-arg]
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _corners(block: Block) -> np.ndarray:
    """(4, 2) the corners of a block on the ground."""
    x, y = block.half_sizes[:2]
    turn = rotations.from_yaw(block.yaw)
    local = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return rotations.rotate(turn, local)[:, :2] + np.array(block.center[:2])


def _bar(rod: MovingCapsule) -> np.ndarray | None:
    """(2, 2) the ends of a capsule at the first frame, from above; None if it is absent."""
    at = row_at(rod.positions, 0)
    if at is None:
        return None
    along = rotations.rotate(rod.quaternions[0], np.array([0.0, 0.0, rod.half_length]))
    return np.stack([at - along, at + along])[:, :2]
