"""Read pictures from a video file or a camera, of limited size and number."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.locomotion.vision.segmentation import Picture
from dynresp.support.errors import MotionFileError
from dynresp.support.extras import require
from dynresp.support.inputs import note_input

MAX_SIDE = 8192
"""Largest number of pixels along a side of a picture."""
MAX_FRAMES = 1_000_000
"""Largest number of pictures of a video: nine hours at 30 a second."""
# Frame rates that are believed of a file or a camera [1/s]; and that of a camera that gives no such
# rate.
_FPS_RANGE = (1.0, 1000.0)
_USUAL_FPS = 30.0


class Video:
    """An open video; use it in a `with` block.

    Attributes:
        name: What was opened, for messages.
        fps: Pictures per second, as the file or camera says; 30 for a camera that does not say.
        length: Number of pictures, as the file says; None for a camera or if the file does not say.
    """

    def __init__(self, source: Path | str | int) -> None:
        """Open a file, or a camera by its number (0 is the first).

        Raises:
            MotionFileError: It cannot be opened, is not a video, its name is not UTF-8, or its
                pictures are too large.
        """
        require("cv2")
        import cv2

        is_camera = isinstance(source, int)
        self.name = f"camera {source}" if is_camera else str(source)
        if not is_camera and not Path(self.name).is_file():
            what = "is a folder" if Path(self.name).is_dir() else "no such file"
            raise MotionFileError(
                f"{self.name}: {what}; give a video file, or a camera (such as camera:0)"
            )
        if not is_camera:
            note_input(Path(self.name))
        # OpenCV crashes on a name that Python cannot encode.
        try:
            self.name.encode()
        except UnicodeEncodeError:
            escaped = self.name.encode(errors="backslashreplace").decode()
            raise MotionFileError(f"{escaped}: the name is not UTF-8; rename the file") from None
        # OpenCV writes to standard error what it cannot read; the errors below say that.
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            self._capture: Any = cv2.VideoCapture(source if isinstance(source, int) else self.name)
        finally:
            cv2.utils.logging.setLogLevel(level)
        if not self._capture.isOpened():
            self._capture.release()
            help_text = (
                "check that it is plugged in and that no other program uses it"
                if is_camera
                else "expected a video that OpenCV reads, such as MP4 (H.264), AVI (MJPG) or WebM"
            )
            raise MotionFileError(f"{self.name}: cannot be opened; {help_text}")
        width, height = (
            int(self._capture.get(which))
            for which in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        )
        if max(width, height) > MAX_SIDE:
            self._capture.release()
            raise MotionFileError(
                f"{self.name}: its pictures have {width} x {height} pixels; expected at most "
                f"{MAX_SIDE} along a side, make them smaller"
            )
        length = float(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self.length = int(length) if not is_camera and 1.0 <= length <= MAX_FRAMES else None
        fps = float(self._capture.get(cv2.CAP_PROP_FPS))
        low, high = _FPS_RANGE
        if math.isfinite(fps) and low <= fps <= high:
            self.fps = fps
        elif is_camera:
            self.fps = _USUAL_FPS
        else:
            self._capture.release()
            raise MotionFileError(
                f"{self.name}: says that it has {fps:g} pictures a second; expected {low:g} to "
                f"{high:g}"
            )

    def __enter__(self) -> Video:
        """The video itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self._capture.release()

    def __iter__(self) -> Iterator[Picture]:
        """The pictures (height, width, 3), blue green red, as bytes.

        Raises:
            MotionFileError: There are no pictures or too many, or one is too large.
        """
        for count in range(MAX_FRAMES):
            found, picture = self._capture.read()
            if not found:
                if count == 0:
                    raise MotionFileError(f"{self.name}: holds no picture that can be read")
                return
            if max(picture.shape[:2]) > MAX_SIDE:
                raise MotionFileError(
                    f"{self.name}: picture {count} has {picture.shape[1]} x {picture.shape[0]} "
                    f"pixels; expected at most {MAX_SIDE} along a side"
                )
            yield np.asarray(picture, dtype=np.uint8)
        raise MotionFileError(f"{self.name}: has more than {MAX_FRAMES:,} pictures; shorten it")
