"""Foreground segmentation: where in a picture the person is.

A mixture of Gaussians for each pixel learns the room (OpenCV's MOG2). What fits none of them is
foreground, unless it is the room darkened by a shadow. Light that moves over the room would be
foreground, too. So every picture is first divided by how much brighter each part of it is than the
learnt room: a smooth field, measured outside the person. The room is not learnt where the person
is, so that a person who stands still does not become part of the room.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.support.errors import MotionError
from dynresp.support.extras import require

Picture = npt.NDArray[np.uint8]
"""(height, width, 3) blue green red, as in OpenCV."""
Mask = npt.NDArray[np.uint8]
"""(height, width) not 0 inside a silhouette."""

EMPTY_ROOM_S = 1.0
"""A video begins with the empty room, for this long [s]."""
LONGEST_SIDE = 320
"""Pictures are shrunk until no side is longer [pixels]."""
# Squared distance from the room's colour, in variances, beyond which a pixel is foreground.
_THRESHOLD = 25.0
# A shadow darkens the room to this share, at most.
_SHADOW = 0.55
# Once the room is known, it learns this share of every so many pictures: it changes slowly, and
# learning takes time.
_LEARN_SHARE, _LEARN_EVERY = 0.02, 4
# Cells across the picture in which light is measured.
_LIGHT_CELLS = 16
# A person covers at least this share of the picture.
_MIN_SHARE = 0.001


class Segmenter:
    """Finds the person in the pictures of one camera that stands still."""

    def __init__(self, fps: float) -> None:
        """Begin with the empty room.

        Args:
            fps: Pictures per second.
        """
        require("cv2")
        import cv2

        self._empty_frames = max(2, round(EMPTY_ROOM_S * fps))
        self._seen = 0
        self._room: Any = cv2.createBackgroundSubtractorMOG2(
            history=500, varThreshold=_THRESHOLD, detectShadows=True
        )
        self._room.setShadowThreshold(_SHADOW)
        self._mask: Mask | None = None
        self._background: Picture | None = None
        self._uncovered: Picture = np.empty((0, 0, 3), dtype=np.uint8)

    def segment(self, picture: Picture) -> Mask | None:
        """Look at the next picture.

        Args:
            picture: (height, width, 3) of bytes, blue green red as in OpenCV.

        Returns:
            (h, w) 255 where the person is, else 0, of the shrunk picture; None while the room is
            being learnt, and if nobody is seen.

        Raises:
            MotionError: It is not such a picture, or its size differs from the first one's.
        """
        small = self._shrunk(picture)
        if self._background is not None:
            if small.shape != self._background.shape:
                raise MotionError(
                    f"all pictures of a video must have one size, got {small.shape[:2]} after "
                    f"{self._background.shape[:2]} (rows, columns)"
                )
            small = self._in_known_light(small)
        self._seen += 1
        if self._seen <= self._empty_frames:
            self._room.apply(small, learningRate=1.0 / self._seen)
            self._background = self._room.getBackgroundImage()
            self._uncovered = small
            return None
        raw = self._room.apply(small, learningRate=0.0)
        mask = self._person(raw)
        covered = np.zeros(raw.shape, dtype=np.uint8) if mask is None else _grown(mask, 9)
        # Behind the person, keep what was last seen of the room: only the room is learnt.
        self._uncovered = np.where(covered[..., None] > 0, self._uncovered, small)
        if self._seen % _LEARN_EVERY == 0:
            self._room.apply(self._uncovered, learningRate=_LEARN_SHARE)
            self._background = self._room.getBackgroundImage()
        self._mask = mask
        return mask

    def _shrunk(self, picture: Picture) -> Picture:
        import cv2

        is_bytes = isinstance(picture, np.ndarray) and picture.dtype == np.uint8
        if not is_bytes or picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape:
            given = getattr(picture, "shape", type(picture).__name__)
            raise MotionError(
                f"a picture must be (rows, columns, 3) of bytes, blue green red, got {given}"
            )
        factor = LONGEST_SIDE / max(picture.shape[:2])
        if factor >= 1.0:
            return picture
        size = (max(1, round(picture.shape[1] * factor)), max(1, round(picture.shape[0] * factor)))
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def _in_known_light(self, small: Picture) -> Picture:
        """The picture as it would be in the light in which the room was learnt."""
        import cv2

        assert self._background is not None
        height, width = small.shape[:2]
        cells = (_LIGHT_CELLS, max(2, _LIGHT_CELLS * height // width))
        weight = np.ones((height, width), dtype=np.float32)
        if self._mask is not None:
            weight[_grown(self._mask, 15) > 0] = 0.0

        def coarse(image: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
            mean = cv2.resize(image, cells, interpolation=cv2.INTER_AREA)
            return np.asarray(cv2.GaussianBlur(mean, (0, 0), 1.0), dtype=np.float32)

        now = coarse(small.astype(np.float32).sum(axis=2) * weight)
        then = coarse(self._background.astype(np.float32).sum(axis=2) * weight)
        room_share = coarse(weight)
        # Cells that show only the person have no measured light: the room's is kept there.
        gain = (now + 1e-3) / (then + 1e-3)
        gain = np.where(room_share > 0.05, gain, 1.0).astype(np.float32)
        field = cv2.resize(gain, (width, height), interpolation=cv2.INTER_CUBIC)
        field = np.clip(field, 0.2, 5.0)
        return np.clip(small / field[..., None] + 0.5, 0, 255).astype(np.uint8)

    def _person(self, raw: Mask) -> Mask | None:
        """The largest connected part of the foreground, without specks and holes."""
        import cv2

        found = np.where(raw == 255, 255, 0).astype(np.uint8)
        found = np.asarray(cv2.medianBlur(found, 3), dtype=np.uint8)
        for operation, size in ((cv2.MORPH_OPEN, 3), (cv2.MORPH_CLOSE, 5)):
            found = np.asarray(cv2.morphologyEx(found, operation, _disc(size)), dtype=np.uint8)
        # A belt or a background of the same colour may cut the person into parts.
        joined = cv2.morphologyEx(found, cv2.MORPH_CLOSE, _disc(11))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
        if count < 2:
            return None
        largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        person = np.where(labels == largest, found, 0).astype(np.uint8)
        if cv2.countNonZero(person) < _MIN_SHARE * person.size:
            return None
        return person


def _disc(size: int) -> Mask:
    import cv2

    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), dtype=np.uint8)


def _grown(mask: Mask, size: int) -> Mask:
    import cv2

    return np.asarray(cv2.dilate(mask, _disc(size)), dtype=np.uint8)
