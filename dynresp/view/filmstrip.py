"""The filmstrip: one picture of a whole story, drawn without any graphics hardware.

The upper picture shows the character at chosen moments, side by side, with labels. The lower
picture is smaller: the same figures where they really were, with the paths of the balls and a
ruler. If the figures stand clear of each other anyway, and the path is not too long, one picture
does for both.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view import body_shapes as shapes
from dynresp.view import raster
from dynresp.view.body_shapes import PHASE_COLORS
from dynresp.view.label_layout import place_labels, spread_figures
from dynresp.view.scene_solids import SceneSolids
from dynresp.view.story import PHASE_NAMES, Story
from dynresp.view.story_moments import Moment, camera_yaw, choose_moments, main_direction

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_FLOOR = (0.80, 0.83, 0.86)
_DPI = 200
# Half the height of the strip of floor in the picture [m].
_FLOOR_DEPTH = 0.26
# Heights of what is not figures, and the margin at the sides [inch].
_HEADING, _LABELS, _TIMES, _CAPTION, _RULER = 0.62, 0.55, 0.38, 0.24, 0.30
_MARGIN = 0.15
# What is no higher than this [m] is on the ground, and there is floor under it.
_GROUND = 0.01
# How far below and above the figures what stands there is shown [m].
_BEYOND = 2.5
# A block whose middle is this near to a figure [m] is drawn with it.
_UNDERFOOT = 0.5
# The camera stands so far ahead of the character's side, and looks down so far [rad].
_TURN, _ELEVATION = np.radians(24.0), np.radians(11.0)
# Share of a figure's width that its neighbour may cover.
_OVERLAP = 0.10
# Figures stay where they were if none has to be moved further than this [m] to stand clear, and if
# the whole path is no wider than that [m].
_LEAST_SHIFT, _WIDEST = 0.25, 14.0
# Where figures are moved, none stands farther from its neighbour than this [m].
_GAP = 0.6
# Things within this distance of the pelvis are drawn with a figure [m].
_NEAR = 0.6
# How opaque the earliest figure is where figures overlap.
_FAINTEST = 0.5
# Scale of the lower picture in that of the upper one.
_LOWER_SCALE = 0.6
# The upper picture shows at least this width [m].
_NARROWEST = 5.6
# Width of a letter of the subtitle [inch].
_LETTER = 0.0605


def write_filmstrip(
    story: Story, path: Path | str, *, moments: int = 8, width_px: int = 1920
) -> None:
    """Write the filmstrip of a story as a PNG; the file is whole or not there.

    Args:
        story: What is shown.
        path: The file; missing folders are made.
        moments: How many figures are drawn; more where there are more events.
        width_px: Width of the picture.

    Raises:
        DynrespError: The file cannot be written.
    """
    figure = _Strip(story, moments, width_px).figure()
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


class _Strip:
    """One filmstrip while it is drawn. Lengths are metres in the picture's frame."""

    def __init__(self, story: Story, moments: int, width_px: int) -> None:
        self.story = story
        self.width_px = width_px
        self.solids = SceneSolids(story)
        self.moments = choose_moments(story, moments)
        self.yaw = camera_yaw(story, float(_TURN))
        self.view = raster.Projection.looking(self.yaw, float(_ELEVATION))
        prints = np.stack([self.solids.ground_point(moment.frame) for moment in self.moments])
        self.prints = self.view.screen(prints)[:, :2]
        """(moments, 2) point of the floor below each figure, in the picture."""

    def figure(self) -> Figure:
        """Lay out and draw."""
        require("matplotlib")
        from matplotlib.figure import Figure

        extents = np.array([self._extent(moment) for moment in self.moments])
        far = float(extents[:, 1].max() - extents[:, 0].min()) > _WIDEST
        # With two characters a figure is a pair; a gap keeps the pairs apart.
        overlap = -_OVERLAP if self.story.others else _OVERLAP
        moved_apart = far or bool(spread_figures(extents[:, :2], overlap)[-1] > _LEAST_SHIFT)
        offsets = np.zeros((len(self.moments), 2))
        if moved_apart:
            shifts = spread_figures(extents[:, :2], overlap, _GAP)
            offsets = np.stack([shifts, -self.prints[:, 1]], axis=1)
        shifted = extents + np.repeat(offsets, 2, axis=1)
        left, right = float(shifted[:, 0].min()) - 0.12, float(shifted[:, 1].max()) + 0.12
        spare = max(_NARROWEST - (right - left), 0.0) / 2
        upper = _Panel(
            left - spare,
            float(shifted[:, 3].max()) + 0.06,
            min(float(shifted[:, 2].min()) - 0.08, -_FLOOR_DEPTH),
            (right - left + 2 * spare) / self.width_px,
            self.width_px,
        )
        panels = [upper]
        if moved_apart:
            panels.append(self._lower_panel(extents, upper.pixel))
        labels = _LABELS if any(moment.events for moment in self.moments) else _TIMES
        parts = [_HEADING, upper.height / _DPI, labels]
        parts[2:2] = [] if moved_apart else [_RULER]
        parts += [_CAPTION, panels[1].height / _DPI, _RULER] if moved_apart else []
        height = sum(parts)
        figure = Figure((self.width_px / _DPI, height), dpi=_DPI, facecolor="white")
        ends = 1.0 - np.cumsum(parts) / height
        for panel, top in zip(panels, (ends[0], ends[-3]), strict=False):
            panel.open(figure, top)
        if moved_apart:
            self._figures(upper, offsets, _NEAR)
        self._true_positions(panels[-1])
        self._labels(figure, upper, offsets, ends[1 if moved_apart else 2], height)
        self._heading(figure, height)
        if moved_apart:
            figure.text(_MARGIN / figure.get_figwidth(), ends[2] - 0.04 / height,
                        "true positions; above, moved apart", va="top", fontsize=7.5,
                        color=_FAINT_INK)  # fmt: skip
        return figure

    def _lower_panel(self, extents: FloatArray, pixel: float) -> _Panel:
        """The smaller picture: the figures where they really were, and what stands there.

        Args:
            extents: (moments, 4) left, right, bottom and top of the figures.
            pixel: Size of a pixel of the upper picture [m].
        """
        left, right = float(extents[:, 0].min()), float(extents[:, 1].max())
        pixel = max(pixel / _LOWER_SCALE, (right - left + 0.6) / self.width_px)
        half, middle = 0.5 * self.width_px * pixel, 0.5 * (left + right)
        lowest, highest = float(extents[:, 2].min()), float(extents[:, 3].max())
        low, high = lowest, highest
        for mesh in (*self.solids.blocks(), *self.solids.bars(), *self.solids.edge()):
            x, y, _ = self.view.screen(mesh.vertices).T
            if x.max() > middle - half and x.min() < middle + half:
                low, high = min(low, float(y.min())), max(high, float(y.max()))
        ball = self._lowest_ball(middle - half, middle + half)
        low = min(max(low, lowest - _BEYOND), max(ball, lowest - 1.0))
        high = min(high, highest + _BEYOND)
        return _Panel(middle - half, high + 0.06, low - 0.1, pixel, self.width_px)

    def _extent(self, moment: Moment) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of what is drawn at a moment."""
        meshes = self.solids.meshes(moment.frame, None, 0.0, _NEAR)
        meshes += self.solids.underfoot(moment.frame, _UNDERFOOT)
        points = self.view.screen(np.concatenate([mesh.vertices for mesh in meshes]))
        (left, bottom, _), (right, top, _) = points.min(axis=0), points.max(axis=0)
        return float(left), float(right), float(bottom), float(top)

    def _figures(
        self, panel: _Panel, offsets: FloatArray, within: float, faintest: float = 1.0
    ) -> None:
        """Draw the figures in the order of time, later ones on top, all shadows below."""
        fade = np.linspace(faintest, 1.0, len(self.moments))
        shadows, figures = panel.canvas(), panel.canvas()
        at = (self.prints + offsets)[:, 1]
        static = [] if np.isfinite(within) else self.solids.static()
        for mesh in static:
            low = mesh.vertices[mesh.vertices[:, 2] <= _GROUND]
            at = np.append(at, np.clip(self.view.screen(low)[:, 1], panel.bottom, panel.top))
        self._floor(panel, shadows, float(at.min()), float(at.max()))
        if static:
            bars = self.solids.bars()
            if bars:
                shadow = raster.floor_shadow(bars, self.yaw, float(_ELEVATION), panel.pixel)
                shadows.paste(shadow, 0, 0, 0.5)
            figures.paste(raster.draw(static, self.view, panel.pixel, canvas=figures))
        for moment, offset, alpha in zip(self.moments, offsets, fade, strict=True):
            meshes = self.solids.meshes(moment.frame, moment.phase, 0.9, within)
            right, up = (round(float(x) / panel.pixel) for x in offset)
            shadow = raster.floor_shadow(meshes, self.yaw, float(_ELEVATION), panel.pixel)
            shadows.paste(shadow, right, up, 0.5 * float(alpha))
            if not static:
                meshes += self.solids.underfoot(moment.frame, _UNDERFOOT)
            figures.paste(raster.draw(meshes, self.view, panel.pixel), right, up, float(alpha))
        panel.show(shadows, 1.0)
        panel.show(figures, 4.0)
        for ball in self.story.spheres:
            present = np.flatnonzero(~np.isnan(ball.positions[: len(self.story.motion), 0]))
            hit, shift = self._hit(ball.positions), np.zeros(2)
            if hit is None:
                continue
            if np.isfinite(within):
                # In the shifted frame of the figure that it hits.
                shift = offsets[hit]
                frame = self.moments[hit].frame
                reach = [self.solids.distance(at, frame) for at in ball.positions[present]]
                present = present[np.array(reach) <= 1.5 * within]
            path = self.view.screen(ball.positions[present])[:, :2] + shift
            panel.axes.plot(*path.T, color=shapes.BALL_COLOR, lw=1.2, alpha=0.7, zorder=3.0)

    def _lowest_ball(self, left: float, right: float) -> float:
        """How low in the picture a ball is drawn between two edges."""
        lowest = 0.0
        for ball in self.story.spheres:
            frames = [m.frame for m in self.moments if m.frame < len(ball.positions)]
            x, y, _ = self.view.screen(ball.positions[frames]).T
            seen = y[(x > left) & (x < right)]
            lowest = min(lowest, *(seen - ball.radius)) if len(seen) else lowest
        return lowest

    def _hit(self, positions: FloatArray) -> int | None:
        """The moment at which a ball is nearest to the character, None if it is at none."""
        nearest, best = np.inf, None
        for number, moment in enumerate(self.moments):
            if moment.frame < len(positions) and np.isfinite(positions[moment.frame, 0]):
                away = self.solids.states.centers[moment.frame] - positions[moment.frame]
                distance = float(np.linalg.norm(away, axis=1).min())
                # The first of several that are about as near: it is the contact.
                if distance < nearest - 0.15:
                    nearest, best = distance, number
        return best

    def _true_positions(self, panel: _Panel) -> None:
        """Draw the figures where they were, and a ruler that begins where the character began."""
        nowhere = np.zeros((len(self.moments), 2))
        self._figures(panel, nowhere, np.inf, _FAINTEST)
        step = float(self.view.screen([*main_direction(self.story), 0.0])[0])
        origin = float(self.view.screen(self.solids.ground_point(0))[0])
        axes, bottom, inch = panel.axes, panel.bottom, panel.pixel * _DPI
        axes.plot([panel.left, panel.right], [bottom, bottom], color=_FAINT_INK, lw=0.8,
                  clip_on=False)  # fmt: skip
        for metre in np.arange(
            np.ceil((panel.left - origin) / step + 0.2), (panel.right - origin) / step - 0.2
        ):
            x = origin + metre * step
            axes.plot([x, x], [bottom, bottom - 0.05 * inch], color=_FAINT_INK, lw=0.8,
                      clip_on=False)  # fmt: skip
            axes.text(x, bottom - 0.08 * inch, f"{metre + 0.0:.0f} m", ha="center", va="top",
                      fontsize=6.5, color=_FAINT_INK)  # fmt: skip

    def _labels(
        self, figure: Figure, panel: _Panel, offsets: FloatArray, top: float, height: float
    ) -> None:
        """Write times and events under the feet, pushed apart where they would overlap."""
        inches = figure.get_figwidth()
        anchors = (self.prints[:, 0] + offsets[:, 0] - panel.left) / (panel.right - panel.left)
        words = [" · ".join(moment.events) for moment in self.moments]
        times = [f"{moment.time_s:.2f} s" for moment in self.moments]
        pairs = zip(words, times, strict=True)
        widths = np.array([max(0.064 * len(a), 0.082 * len(b)) + 0.08 for a, b in pairs]) / inches
        centers = place_labels(anchors, widths)
        y = top - 0.12 / height
        for moment, word, time, anchor, center in zip(
            self.moments, words, times, anchors, centers, strict=True
        ):
            if abs(anchor - center) > 0.1 / inches:
                figure.add_artist(_line(figure, (anchor, top), (center, y + 0.01 / height)))
            figure.text(center, y, time, ha="center", va="top", fontsize=8.5,
                        color=_INK, fontweight="bold")  # fmt: skip
            color = _INK if moment.phase is None else PHASE_COLORS[moment.phase]
            figure.text(center, y - 0.17 / height, word, ha="center", va="top", fontsize=8,
                        color=shapes.mix(color, (0.0, 0.0, 0.0), 0.2),
                        parse_math=False)  # fmt: skip

    def _heading(self, figure: Figure, height: float) -> None:
        """Title and subtitle to the left, the colours of the phases to the right of the latter."""
        from matplotlib.lines import Line2D

        side = _MARGIN / figure.get_figwidth()
        title = self.story.title
        figure.text(side, 1 - 0.12 / height, title, va="top", fontweight="bold", color=_INK,
                    fontsize=min(12.0, 12.0 * 88 / max(len(title), 1)),
                    parse_math=False)  # fmt: skip
        shown = {moment.phase for moment in self.moments}
        names = [name for name in PHASE_NAMES if name in shown]
        # The subtitle gets smaller where it would run into the legend.
        legend = sum(0.36 + _LETTER * len(name) for name in names)
        room = figure.get_figwidth() - 3 * _MARGIN - legend
        size = 8.5 * min(1.0, room / (_LETTER * max(len(self.story.subtitle), 1)))
        figure.text(side, 1 - 0.36 / height, self.story.subtitle, va="top", fontsize=size,
                    color=_FAINT_INK, parse_math=False)  # fmt: skip
        handles = [
            Line2D([], [], ls="", marker="o", ms=5.5, color=PHASE_COLORS[name], label=name)
            for name in names
        ]
        if handles:
            figure.legend(handles=handles, ncols=len(handles), frameon=False, fontsize=8.5,
                          loc="upper right", bbox_to_anchor=(1 - 0.4 * side, 1 - 0.29 / height),
                          borderaxespad=0.0, handletextpad=0.1, columnspacing=1.1,
                          labelcolor=_INK)  # fmt: skip

    def _floor(self, panel: _Panel, canvas: raster.Canvas, low: float, high: float) -> None:
        """A strip of floor between two heights that fades before and behind them."""
        y = panel.top - (np.arange(panel.height) + 0.5) * panel.pixel
        rise = (y - np.clip(y, low, high)) / _FLOOR_DEPTH
        alpha = 0.6 * np.clip(1.0 - rise**2, 0.0, 1.0)
        canvas.rgba[:] = (alpha[:, None] * np.array([*_FLOOR, 1.0]))[:, None]


class _Panel:
    """A part of the picture over its whole width: in metres, on whole pixels."""

    def __init__(self, left: float, top: float, bottom: float, pixel: float, width: int) -> None:
        self.pixel, self.width = pixel, width
        self._first, self._top = round(left / pixel), round(top / pixel)
        self.height = self._top - round(bottom / pixel)
        self.left, self.right = self._first * pixel, (self._first + width) * pixel
        self.top, self.bottom = self._top * pixel, (self._top - self.height) * pixel

    def open(self, figure: Figure, top: float) -> None:
        """Make its axes, from a share of the figure's height downwards."""
        share = self.height / _DPI / figure.get_figheight()
        self.axes: Axes = figure.add_axes((0.0, top - share, 1.0, share))
        self.axes.set_axis_off()
        self.axes.set_autoscale_on(False)
        self.axes.set_xlim(self.left, self.right)
        self.axes.set_ylim(self.bottom, self.top)

    def canvas(self) -> raster.Canvas:
        """An empty canvas that covers it."""
        return raster.Canvas(self._first, self._top, self.width, self.height)

    def show(self, canvas: raster.Canvas, above: float) -> None:
        """Put a canvas of its own into the figure."""
        self.axes.add_artist(_pixels(self.axes, canvas)).set_zorder(above)


def _pixels(axes: Axes, canvas: raster.Canvas) -> Artist:
    """An image whose pixels are those of the figure; `imshow` would sample them once more."""
    from matplotlib.artist import Artist

    class Pixels(Artist):
        def draw(self, renderer: Any) -> None:
            corner = axes.bbox.p0.round()
            # Renderers take the lowest row first.
            renderer.draw_image(renderer.new_gc(), *corner, canvas.picture()[::-1])

    return Pixels()


def _line(figure: Figure, a: tuple[float, float], b: tuple[float, float]) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D(
        (a[0], b[0]), (a[1], b[1]), transform=figure.transFigure, color=_FAINT_INK, lw=0.6
    )
