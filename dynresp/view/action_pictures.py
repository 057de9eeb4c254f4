"""The picture of a few actions to choose from: their paths from above, and a pose of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view import body_shapes as shapes
from dynresp.view import raster

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_COLORS = ((0.16, 0.42, 0.70), (0.85, 0.40, 0.13), (0.20, 0.58, 0.40), (0.55, 0.34, 0.62))
_DPI = 130
_SIZE = (11.0, 6.2)  # [inch]
_PLAN = (0.06, 0.09, 0.41, 0.82)
# On the plan: margin, arrow, radius of a number, and distances of numbers from ends [inch].
_MARGIN, _ARROW, _RADIUS = 0.45, 0.3, 0.14
_REACHES = (0.25, 0.32, 0.4, 0.5, 0.65, 0.8)
PIXEL_M = 0.006
"""Size of a pixel of `pose_picture` [m]."""
# The camera stands this far to the side of the figure's front, and looks down this far [rad].
_ASIDE, _DOWN = np.radians(30.0), np.radians(12.0)


def write_action_pictures(
    actions: Sequence[tuple[FloatArray, FloatArray]], words: Sequence[str], path: Path | str
) -> None:
    """Write the picture of actions as a PNG; the file is whole or not there.

    Args:
        actions: For each its path, (s, 4) x, y, z [m] and yaw [rad], and a pose (59,) that stands
            for it.
        words: What each action is.
        path: The file; missing folders are made.

    Raises:
        DynrespError: The file cannot be written.
    """
    require("matplotlib")
    from matplotlib.figure import Figure

    count = len(actions)
    figure = Figure(_SIZE, dpi=_DPI, facecolor="white")
    _draw_plan(figure.add_axes(_PLAN), [path for path, _ in actions])
    for number, (_, pose) in enumerate(actions):
        color = _COLORS[number % len(_COLORS)]
        cell = figure.add_axes(_cell(number, count))
        cell.set_axis_off()
        picture = pose_picture(pose)
        cell.imshow(picture, interpolation="nearest")
        # All figures to one scale.
        middle = picture.shape[1] / 2
        half = 0.75 / PIXEL_M
        cell.set_xlim(middle - half, middle + half)
        cell.set_ylim(picture.shape[0], picture.shape[0] - 2.0 / PIXEL_M)
        cell.set_title(f"{number + 1}", color=color, fontsize=13, fontweight="bold", pad=2)
        cell.text(0.5, -0.02, words[number].replace(", ", ",\n"), transform=cell.transAxes,
                  ha="center", va="top", fontsize=7.5, color=_INK)  # fmt: skip
    figure.text(0.06, 0.95, "Actions to choose from", fontsize=12, fontweight="bold", color=_INK)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _draw_plan(axes: Axes, paths: Sequence[FloatArray]) -> None:
    """Draw paths from above, each with its number near its end, where there is room."""
    points = np.concatenate([path[:, :2] for path in paths])
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.array(_PLAN[2:]) * _SIZE
    # Metres per inch: all paths with a margin, and at least 1.5 m across.
    scale = max(float(((high - low) / (size - 2.0 * _MARGIN)).max()), 1.5 / float(size.min()))
    corner = 0.5 * (low + high) - 0.5 * scale * size
    axes.set_xlim(corner[0], corner[0] + scale * size[0])
    axes.set_ylim(corner[1], corner[1] + scale * size[1])
    axes.grid(color=(0.9, 0.91, 0.92), lw=0.6)
    axes.tick_params(colors=_FAINT_INK, labelsize=7)
    axes.set_xlabel("x [m]", fontsize=8, color=_FAINT_INK)
    axes.set_ylabel("y [m]", fontsize=8, color=_FAINT_INK)
    count, arrow = len(paths), _ARROW * scale
    for number, path in enumerate(paths):
        color = _COLORS[number % len(_COLORS)]
        # Where paths coincide, the wider ones show beside those drawn over them.
        axes.plot(*path[:, :2].T, color=color, lw=1.6 + 1.3 * (count - 1 - number))
    start = paths[0][0]
    _arrow(axes, start, 1.2 * arrow, _INK)
    axes.plot(*start[:2], ls="", marker="o", ms=9, mfc="white", mec=_INK, mew=1.5)
    ends = np.array([path[-1] for path in paths])
    tips = ends[:, :2] + arrow * np.column_stack([np.cos(ends[:, 3]), np.sin(ends[:, 3])])
    occupied = np.concatenate([points, tips, 0.5 * (tips + ends[:, :2])])
    badges = _free_places((ends[:, :2] - corner) / scale, (occupied - corner) / scale, size)
    for number, (end, badge) in enumerate(zip(ends, corner + scale * badges, strict=True)):
        color = _COLORS[number % len(_COLORS)]
        axes.plot(*np.column_stack([end[:2], badge]), color=color, lw=0.8)
        _arrow(axes, end, arrow, color)
        axes.plot(*end[:2], ls="", marker="o", ms=6, color=color, mec="white")
        round_it = {"boxstyle": "circle,pad=0.22", "fc": "white", "ec": color, "lw": 1.4}
        x, y = (float(v) for v in badge)
        axes.text(x, y, f"{number + 1}", color=color, fontsize=10, fontweight="bold",
                  ha="center", va="center", bbox=round_it, zorder=5)  # fmt: skip


def _free_places(ends: FloatArray, occupied: FloatArray, size: FloatArray) -> FloatArray:
    """(k, 2) free places for numbers near ends (k, 2), on a sheet of a size [inch].

    Args:
        ends: (k, 2) the points that the numbers belong to.
        occupied: (p, 2) points that the numbers should not cover.
        size: (2,) of the sheet.
    """
    angles = np.arange(24) * np.pi / 12.0
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    places: list[FloatArray] = []
    for end in ends:
        tried = (end + np.array(_REACHES)[:, None, None] * around).reshape(-1, 2)
        far = np.repeat(_REACHES, len(angles))
        to_others = np.linalg.norm(tried[:, None] - occupied, axis=2).min(axis=1)
        cost = far + 10.0 * np.maximum(_RADIUS - to_others, 0.0)
        if places:
            to_badges = np.linalg.norm(tried[:, None] - np.array(places), axis=2).min(axis=1)
            cost += 100.0 * np.maximum(2.2 * _RADIUS - to_badges, 0.0)
        beside = np.maximum(_RADIUS - tried, tried + _RADIUS - size).max(axis=1)
        cost += 100.0 * np.maximum(beside, 0.0)
        places.append(tried[int(np.argmin(cost))])
    return np.array(places)


def _arrow(axes: Axes, at: FloatArray, length: float, color: shapes.Color) -> None:
    """Draw an arrow in the direction of yaw [rad] at (4,) x, y, z [m], yaw."""
    x, y, _, yaw = (float(v) for v in at)
    tip = (x + length * math.cos(yaw), y + length * math.sin(yaw))
    style = {"arrowstyle": "-|>", "color": color, "lw": 1.5, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", tip, (x, y), arrowprops=style)


def _cell(number: int, count: int) -> tuple[float, float, float, float]:
    """Where a figure is drawn: in two columns on the right."""
    rows = max(1, -(-count // 2))
    row, column = divmod(number, 2)
    height = 0.86 / rows
    return (0.52 + 0.235 * column, 0.95 - (row + 1) * height + 0.09, 0.22, height - 0.13)


def pose_picture(pose: FloatArray) -> npt.NDArray[np.uint8]:
    """A person in a pose, seen from the front and a little from the side.

    Args:
        pose: (59,).

    Returns:
        (height, width, 4) red, green, blue, alpha, 0 to 255; a pixel is `PIXEL_M` wide.
    """
    from dynresp.motion import rotations

    character = default_character()
    solids = shapes.character_solids(character)
    states = character.kinematics(pose[None])
    meshes = shapes.place(solids, states, 0, shapes.phase_colors(solids, None, 0.0))
    yaw = float(rotations.yaw_of(pose[3:7])) + np.pi - _ASIDE
    view = raster.Projection.looking(yaw, float(_DOWN))
    layer = raster.draw(meshes, view, PIXEL_M)
    canvas = raster.Canvas(layer.left, layer.top, layer.rgba.shape[1], layer.rgba.shape[0])
    canvas.paste(layer, 0, 0, 1.0)
    return canvas.picture()
