"""The picture of an avatar that follows somebody in a video.

The first rows show moments of the video, with the outline of the person, and the avatar at the same
moments. The time line shows what the person did as it was recognised, which action was chosen for
the avatar, and what the avatar did. The last rows show an example of each action.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view.action_pictures import PIXEL_M, pose_picture
from dynresp.view.body_shapes import Color, mix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK = (0.14, 0.15, 0.18)
_FAINT_INK = (0.48, 0.51, 0.55)
_NOTHING = (0.90, 0.91, 0.92)
_COLORS: tuple[Color, ...] = (
    (0.16, 0.42, 0.70), (0.85, 0.40, 0.13), (0.20, 0.58, 0.40), (0.55, 0.34, 0.62),
    (0.83, 0.66, 0.16), (0.72, 0.22, 0.32), (0.35, 0.66, 0.72), (0.55, 0.42, 0.30),
    (0.86, 0.52, 0.68), (0.45, 0.52, 0.20), (0.35, 0.35, 0.55), (0.60, 0.62, 0.65),
)  # fmt: skip
_DPI = 150
# Moments that are shown, and a moment's width on paper [inch].
_MOMENTS, _COLUMN = 7, 1.75
_LEFT, _RIGHT, _GAP = 0.85, 0.25, 0.12
# Heights on paper [inch]: heading, names of the moments, avatars, the time line, and its axis.
_HEADING, _NAMES, _AVATARS, _LINE, _AXIS = 0.75, 0.28, 1.75, 0.85, 0.55
# An example of an action with its words: height, and least width [inch].
_EXAMPLES, _WORDS, _EXAMPLE_WIDTH = 1.35, 0.5, 1.5
# At least this share of the width and height of the pictures is shown.
_LEAST_PART = 0.35
# Height of the part of the world that a figure shows [m].
_TALL = 2.0


@dataclass(frozen=True, eq=False)
class VideoMoment:
    """A moment of the video.

    Attributes:
        time_s: Time in the video [s].
        picture: (h, w, 3) blue green red.
        mask: (h, w) 255 where the person is.
    """

    time_s: float
    picture: npt.NDArray[np.uint8]
    mask: npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ActionTimeline:
    """Actions over time, by their numbers; None where there is none.

    Attributes:
        times_s: (k,) end of each step [s].
        person: (k,) what the person did, as recognised.
        chosen: (k,) what was chosen for the avatar.
        avatar: (k,) what it did.
    """

    times_s: Sequence[float]
    person: Sequence[int | None]
    chosen: Sequence[int | None]
    avatar: Sequence[int | None]


@dataclass(frozen=True, eq=False)
class VideoControlStory:
    """What the picture shows.

    Attributes:
        motion: Of the avatar, in the video's time.
        moments: Of the video; seven of them are shown.
        line: Actions over time.
        poses: (K, 59) an example of each action.
        words: (K,) what each action is.
    """

    motion: Motion
    moments: Sequence[VideoMoment]
    line: ActionTimeline
    poses: FloatArray
    words: Sequence[str]


def letter(number: int) -> str:
    """Name of an action: A, B, C and so on."""
    return chr(ord("A") + number)


def write_video_control(
    watched: VideoControlStory, path: Path | str, title: str, subtitle: str
) -> None:
    """Write the picture as a PNG; the file is whole or not there.

    Args:
        watched: What the picture shows.
        path: The file; missing folders are made.
        title: First line.
        subtitle: Second line.

    Raises:
        DynrespError: The file cannot be written.
    """
    figure = _Sheet(watched).figure(title, subtitle)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


class _Sheet:
    """One picture while it is drawn. Lengths are inches, from the upper left corner."""

    def __init__(self, watched: VideoControlStory) -> None:
        self.watched = watched
        self.moments = _evenly(watched.moments, _MOMENTS)
        self.part = _part(self.moments)
        height, width = (int(cut.stop - cut.start) for cut in self.part)
        # Pictures of a telephone held upright are high; they keep their shape within bounds.
        self.pictures = min(_COLUMN * height / width, 2.4)
        self.width = _LEFT + _MOMENTS * (_COLUMN + _GAP) - _GAP + _RIGHT
        room = self.width - _LEFT - _RIGHT
        self.in_row = min(len(watched.poses), int((room + _GAP) / (_EXAMPLE_WIDTH + _GAP)))
        rows = math.ceil(len(watched.poses) / self.in_row)
        self.top_line = _HEADING + _NAMES + self.pictures + _AVATARS + 0.35
        self.top_examples = self.top_line + _LINE + _AXIS
        self.height = self.top_examples + rows * (_EXAMPLES + _WORDS) + 0.05

    def figure(self, title: str, subtitle: str) -> Figure:
        """Lay out and draw."""
        require("matplotlib")
        from matplotlib.figure import Figure

        figure = Figure((self.width, self.height), dpi=_DPI, facecolor="white")
        for text, down, size, weight, color in (
            (title, 0.32, 13, "bold", _INK),
            (subtitle, 0.56, 9.5, "normal", _FAINT_INK),
        ):
            figure.text(0.15 / self.width, 1.0 - down / self.height, text, fontsize=size,
                        fontweight=weight, color=color, parse_math=False)  # fmt: skip
        self._label(figure, "person", _HEADING + _NAMES + 0.5 * self.pictures)
        self._label(figure, "avatar", _HEADING + _NAMES + self.pictures + 0.5 * _AVATARS)
        for number, moment in enumerate(self.moments):
            self._moment(figure, number, moment)
        self._time_line(figure)
        for number, pose in enumerate(self.watched.poses):
            self._example(figure, number, pose)
        return figure

    def _axes(
        self,
        figure: Figure,
        left: float,
        top: float,
        width: float,
        height: float,
        bare: bool = True,
    ) -> Axes:
        axes = figure.add_axes(
            (
                left / self.width,
                1.0 - (top + height) / self.height,
                width / self.width,
                height / self.height,
            )
        )
        if bare:
            axes.set_axis_off()
        return axes

    def _label(self, figure: Figure, text: str, down: float) -> None:
        figure.text((_LEFT - 0.12) / self.width, 1.0 - down / self.height, text, ha="right",
                    va="center", fontsize=9, color=_FAINT_INK)  # fmt: skip

    def _moment(self, figure: Figure, number: int, moment: VideoMoment) -> None:
        """Draw a picture of the video, and the avatar below it."""
        left = _LEFT + number * (_COLUMN + _GAP)
        top = _HEADING + _NAMES
        at = self._step(moment.time_s)
        line = self.watched.line
        axes = self._axes(figure, left, top, _COLUMN, self.pictures)
        axes.imshow(moment.picture[self.part][..., ::-1], interpolation="bilinear")
        mask = moment.mask[self.part] > 127
        # A person who fills the whole part has no outline.
        if mask.any() and not mask.all():
            for color, wide in (((1.0, 1.0, 1.0), 2.4), (_color(line.person[at]), 1.4)):
                axes.contour(mask, levels=[0.5], colors=[color], linewidths=wide)
        axes.set_title(f"{number + 1}   {moment.time_s:.1f} s", fontsize=8.5, color=_INK, pad=3)
        below = self._axes(figure, left, top + self.pictures + 0.06, _COLUMN, _AVATARS - 0.06)
        _stand(below, self.watched.motion.sample(np.array([moment.time_s]))[0], _COLUMN)
        for cell, what in ((axes, line.person[at]), (below, line.avatar[at])):
            if what is not None:
                _badge(cell, what)

    def _step(self, time_s: float) -> int:
        """The step of the time line at a time."""
        times = np.asarray(self.watched.line.times_s)
        return min(int(np.searchsorted(times, time_s - 1e-6)), len(times) - 1)

    def _time_line(self, figure: Figure) -> None:
        line = self.watched.line
        rows = (("person seen", line.person), ("chosen", line.chosen), ("avatar", line.avatar))
        width = self.width - _LEFT - _RIGHT
        axes = self._axes(figure, _LEFT, self.top_line, width, _LINE, bare=False)
        ends = np.asarray(line.times_s)
        begins = np.concatenate([[0.0], ends[:-1]])
        for row, (_, numbers) in enumerate(rows):
            runs = _runs(begins, ends, numbers)
            axes.broken_barh(
                [(begin, end - begin) for begin, end, _ in runs],
                (-row - 0.4, 0.8),
                facecolors=[_color(number) for *_, number in runs],
            )
            for begin, end, number in runs:
                # A letter where there is room for one.
                if number is not None and (end - begin) / ends[-1] * width > 0.16:
                    axes.text(0.5 * (begin + end), -row, letter(number), ha="center", va="center",
                              fontsize=8, fontweight="bold", color="white",
                              bbox={"boxstyle": "square,pad=0.1", "fc": _color(number),
                                    "ec": "none"})  # fmt: skip
        for number, moment in enumerate(self.moments):
            axes.axvline(moment.time_s, color=_INK, lw=0.8, ls=(0, (2, 2)))
            axes.text(moment.time_s, 0.55, f"{number + 1}", ha="center", va="bottom", fontsize=8,
                      color=_INK)  # fmt: skip
        axes.set_yticks([0, -1, -2], [name for name, _ in rows], fontsize=8, color=_FAINT_INK)
        axes.set_xlim(0.0, float(ends[-1]))
        axes.set_ylim(-2.5, 0.5)
        axes.tick_params(axis="x", colors=_FAINT_INK, labelsize=8)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("time [s]; grey: nobody seen yet", fontsize=8, color=_FAINT_INK, labelpad=1)
        for side in axes.spines.values():
            side.set_visible(False)

    def _example(self, figure: Figure, number: int, pose: FloatArray) -> None:
        """Draw a pose that stands for an action, with its letter and its words."""
        row, column = divmod(number, self.in_row)
        step = (self.width - _LEFT - _RIGHT + _GAP) / self.in_row
        wide = min(step - _GAP, 2.2)
        left, top = _LEFT + column * step, self.top_examples + row * (_EXAMPLES + _WORDS)
        axes = self._axes(figure, left, top, wide, _EXAMPLES)
        _stand(axes, pose, wide * _AVATARS / _EXAMPLES)
        _badge(axes, number)
        words = self.watched.words[number].replace(", ", ",\n")
        axes.text(0.5, -0.04, words, transform=axes.transAxes, ha="center",
                  va="top", fontsize=8, color=_INK)  # fmt: skip


def _color(number: int | None) -> Color:
    return _NOTHING if number is None else _COLORS[number % len(_COLORS)]


def _badge(axes: Axes, number: int) -> None:
    """The letter of an action, white on its colour, in the upper left corner."""
    axes.text(0.03, 0.97, letter(number), transform=axes.transAxes, ha="left", va="top",
              fontsize=8.5, fontweight="bold", color="white",
              bbox={"boxstyle": "round,pad=0.25", "fc": _color(number), "ec": "none"})  # fmt: skip


def _stand(axes: Axes, pose: FloatArray, width: float) -> None:
    """Draw a person in a pose, to one scale, in the middle and on a line."""
    picture = pose_picture(pose)
    high, wide = picture.shape[:2]
    axes.imshow(picture, interpolation="bilinear")
    half = 0.5 * _TALL / PIXEL_M * width / (_AVATARS - 0.06)
    axes.set_xlim(0.5 * wide - half, 0.5 * wide + half)
    axes.set_ylim(high + 0.03 / PIXEL_M, high + 0.03 / PIXEL_M - _TALL / PIXEL_M)
    axes.axhline(high, color=mix(_FAINT_INK, (1, 1, 1), 0.5), lw=0.8, zorder=0)


def _part(moments: Sequence[VideoMoment]) -> tuple[slice, slice]:
    """Rows and columns of the pictures that hold the person with a margin, in the same shape."""
    if not moments:
        return slice(0, 3), slice(0, 4)
    mask = np.max([moment.mask for moment in moments], axis=0) > 127
    sides = []
    for axis in (1, 0):
        there = np.flatnonzero(mask.any(axis=axis))
        sides.append((int(there[0]), int(there[-1]) + 1, mask.shape[1 - axis]))
    # As large a share of the height as of the width: the pictures keep their shape.
    share = max(max((1.3 * (high - low)) / of for low, high, of in sides), _LEAST_PART)
    parts = []
    for low, high, of in sides:
        long = min(of, math.ceil(share * of))
        begin = min(max((low + high - long) // 2, 0), of - long)
        parts.append(slice(begin, begin + long))
    return parts[0], parts[1]


def _evenly(moments: Sequence[VideoMoment], count: int) -> list[VideoMoment]:
    """Up to `count` of the moments, evenly spaced."""
    if len(moments) <= count:
        return list(moments)
    return [moments[int(k)] for k in np.linspace(0, len(moments) - 1, count).round()]


def _runs(
    begins: FloatArray, ends: FloatArray, numbers: Sequence[int | None]
) -> list[tuple[float, float, int | None]]:
    """Consecutive steps of one action joined: begin, end and action of each."""
    out: list[tuple[float, float, int | None]] = []
    for begin, end, number in zip(begins.tolist(), ends.tolist(), numbers, strict=True):
        if out and out[-1][2] == number:
            out[-1] = (out[-1][0], end, number)
        else:
            out.append((begin, end, number))
    return out
