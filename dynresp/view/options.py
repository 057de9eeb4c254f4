"""The picture of a few actions to choose from: their ways from above, and where they lead."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.files import replacing
from dynresp.motion.character import default_character
from dynresp.motion.rotations import FloatArray
from dynresp.view import raster, shapes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_COLORS = ((0.16, 0.42, 0.70), (0.85, 0.40, 0.13), (0.20, 0.58, 0.40), (0.55, 0.34, 0.62))
_DPI = 130
_PIXEL = 0.006  # [m]
# The camera stands a little to the side of where a figure faces, and looks down a little [rad].
_ASIDE, _DOWN = np.radians(30.0), np.radians(12.0)


def write_options(
    actions: Sequence[tuple[FloatArray, FloatArray]], words: Sequence[str], path: Path | str
) -> None:
    """Write the picture of actions as a PNG; the file is whole or not there.

    Args:
        actions: For each its way, (s, 4) x, y, z [m] and yaw [rad], and the pose (59,) that stands
            for it.
        words: What each is, in words.
        path: The file; missing folders are made.

    Raises:
        DynrespError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    count = len(actions)
    figure = Figure((11.0, 6.2), dpi=_DPI, facecolor="white")
    plan = figure.add_axes((0.05, 0.09, 0.42, 0.82))
    plan.set_aspect("equal", adjustable="datalim")
    plan.grid(color=(0.9, 0.91, 0.92), lw=0.6)
    plan.tick_params(colors=_FAINT_INK, labelsize=7)
    plan.set_xlabel("x [m]", fontsize=8, color=_FAINT_INK)
    plan.set_ylabel("y [m]", fontsize=8, color=_FAINT_INK)
    start = actions[0][0][0]
    for number, (way, pose) in enumerate(actions):
        color = _COLORS[number % len(_COLORS)]
        plan.plot(*way[:, :2].T, color=color, lw=2.0)
        _arrow(plan, way[-1], 0.3, color)
        x, y = (float(v) for v in way[-1, :2])
        plan.text(x, y, f" {number + 1}", color=color, fontsize=13, fontweight="bold")
        cell = figure.add_axes(_cell(number, count))
        cell.set_axis_off()
        picture = _figure_of(pose)
        cell.imshow(picture, interpolation="nearest")
        # A column of all figures' width, so that they are of one size.
        middle = picture.shape[1] / 2
        half = 0.75 / _PIXEL
        cell.set_xlim(middle - half, middle + half)
        cell.set_ylim(picture.shape[0], picture.shape[0] - 2.0 / _PIXEL)
        cell.set_title(f"{number + 1}", color=color, fontsize=13, fontweight="bold", pad=2)
        cell.text(0.5, -0.02, words[number].replace(", ", ",\n"), transform=cell.transAxes,
                  ha="center", va="top", fontsize=7.5, color=_INK)  # fmt: skip
    plan.plot(*start[:2], ls="", marker="o", ms=8, mfc="white", mec=_INK, mew=1.5)
    _arrow(plan, start, 0.35, _INK)
    figure.text(0.05, 0.95, "Actions to choose from", fontsize=12, fontweight="bold", color=_INK)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _arrow(axes: Axes, at: FloatArray, length: float, color: shapes.Color) -> None:
    """An arrow that shows where one faces at (4,) x, y, z [m] and yaw [rad]."""
    x, y, _, yaw = (float(v) for v in at)
    tip = (x + length * math.cos(yaw), y + length * math.sin(yaw))
    style = {"arrowstyle": "-|>", "color": color, "lw": 1.5}
    axes.annotate("", tip, (x, y), arrowprops=style)


def _cell(number: int, count: int) -> tuple[float, float, float, float]:
    """Place of a figure: two columns on the right."""
    rows = max(1, -(-count // 2))
    row, column = divmod(number, 2)
    height = 0.86 / rows
    return (0.52 + 0.235 * column, 0.95 - (row + 1) * height + 0.09, 0.22, height - 0.13)


def _figure_of(pose: FloatArray) -> npt.NDArray[np.uint8]:
    """A person in a pose, seen from ahead and a little aside, as an RGBA picture."""
    from dynresp.motion import rotations

    character = default_character()
    solids = shapes.character_solids(character)
    states = character.kinematics(pose[None])
    meshes = shapes.place(solids, states, 0, shapes.phase_colors(solids, None, 0.0))
    yaw = float(rotations.yaw_of(pose[3:7])) + np.pi - _ASIDE
    view = raster.Projection.looking(yaw, float(_DOWN))
    layer = raster.draw(meshes, view, _PIXEL)
    canvas = raster.Canvas(layer.left, layer.top, layer.rgba.shape[1], layer.rgba.shape[0])
    canvas.lay(layer, 0, 0, 1.0)
    return canvas.picture()
