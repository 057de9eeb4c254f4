"""Pictures of a person: from a video file, or from a camera at an even rate."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from dynresp.locomotion.vision.segmentation import Picture
from dynresp.locomotion.vision.video_reader import Video
from dynresp.support.errors import UsageError
from dynresp.support.extras import require

_CAMERA = re.compile(r"camera(?::(\d{1,3}))?")

Clock = Callable[[], float]
"""Returns the time [s] since any fixed moment."""


def open_source(text: str) -> tuple[Video, bool]:
    """Open what the user named.

    Args:
        text: A video file, or "camera" or "camera:N".

    Returns:
        The open video, and whether it is a camera.

    Raises:
        UsageError: It names a camera without a number.
        MotionFileError: It cannot be opened.
        MissingExtraError: OpenCV is not installed.
    """
    require("cv2")
    # FFmpeg would write to standard error as well what the errors here say.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    camera = _CAMERA.fullmatch(text)
    if camera is not None:
        return Video(int(camera[1] or 0)), True
    if text.startswith("camera:"):
        raise UsageError(
            f"expected camera or camera:N, such as camera:1 for the second one, got {text[:60]!r}; "
            "write ./ before the name of a file"
        )
    return Video(Path(text)), False


def evenly(
    pictures: Iterable[Picture], fps: float, clock: Clock = time.monotonic
) -> Iterator[Picture]:
    """Pictures of a camera at an even rate.

    A camera delivers fewer pictures than it says when it is dark, and none while the computer is
    busy. A picture is repeated until the next one is there, and one that comes too early is left
    out, so that the number of pictures gives the time. After a break of a second or more (the
    computer slept) time goes on where it stopped.

    Args:
        pictures: What the camera delivers; each is waited for.
        fps: The rate wanted [1/s].
        clock: Returns the time [s].
    """
    begun: float | None = None
    given = 0
    for picture in pictures:
        now = clock()
        begun = now - 1.0 / fps if begun is None else begun
        due = int((now - begun) * fps + 1e-6) - given
        if due > fps:
            begun += (due - 1) / fps
            due = 1
        for _ in range(due):
            yield picture
        given += max(due, 0)


def later(
    pictures: Iterable[Picture],
    wait_s: float,
    report: Callable[[float], None],
    clock: Clock = time.monotonic,
) -> Iterator[Picture]:
    """Pictures of a camera without those of the first seconds.

    Args:
        pictures: What the camera delivers.
        wait_s: How long to throw pictures away [s].
        report: Called with how much of that time has passed [s].
        clock: Returns the time [s].
    """
    begun = clock()
    for picture in pictures:
        passed = clock() - begun
        if passed < wait_s:
            report(passed)
        else:
            yield picture
