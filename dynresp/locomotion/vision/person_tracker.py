"""A person before a camera, picture by picture: rows of features at the database's rate."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.vision.segmentation import Mask, Picture, SegmentationConfig, Segmenter
from dynresp.locomotion.vision.silhouette_features import Measures, measure
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

# The size of a person in the picture is the median of so long [s].
_SIZE_S = 1.0
# Somebody who was not seen for so long has to be found anew [s].
_LOST_S = 0.5


class PersonTracker:
    """Finds the person in pictures and tells what is seen in the numbers of a table.

    Attributes:
        mask: The silhouette found last; None where there is nobody, and while the room is learnt.
        pictures: How many have come so far.
    """

    def __init__(
        self, table: ViewTable, fps: float, config: SegmentationConfig | None = None
    ) -> None:
        """Wait for the first picture.

        Args:
            table: What the database's frames look like.
            fps: Pictures per second of the video.
            config: How the person is told from the room.

        Raises:
            UsageError: The frame rate is not above 0.
        """
        if not 0.0 < fps < np.inf:
            raise UsageError(f"fps must be above 0, got {fps}")
        self.mask: Mask | None = None
        self.pictures = 0
        self._table = table
        self._fps = fps
        self._segmenter = Segmenter(min(fps, table.fps), config)
        # What was measured, one entry a frame of the database.
        kept = max(table.span, round(_SIZE_S * table.fps)) + 1
        self._seen: deque[Measures] = deque(maxlen=kept)
        self._ticks = 0
        self._missed = 0

    def see(self, picture: Picture) -> list[npt.NDArray[np.float32]]:
        """Look at the next picture.

        Of a video faster than the database only as many pictures are looked at as there are
        frames; of a slower one a picture stands for several frames.

        Returns:
            Rows (d,) as in the table, one a frame of the database; none where the picture is
            passed over, the room is still being learnt, or nobody is there.

        Raises:
            MotionError: It is no picture, or of another size than those before.
        """
        self.pictures += 1
        due = int(self.pictures * self._table.fps / self._fps + 1e-9) - self._ticks
        if due == 0:
            return []
        self._ticks += due
        self.mask = self._segmenter.segment(picture)
        measured = None if self.mask is None else measure(self.mask, self._table.config.shape)
        if measured is None:
            self._missed += due
            if self._missed > _LOST_S * self._table.fps:
                self._seen.clear()
            return []
        # Where somebody was hidden for a moment, the speeds need an entry for every frame.
        self._seen.extend([measured] * (self._missed if self._seen else 0))
        self._missed = 0
        rows = []
        for _ in range(due):
            self._seen.append(measured)
            rows.append(self._table.row(self._now()))
        return rows

    def _now(self) -> FloatArray:
        """What is measured now: the shape, the centre's speeds and growth."""
        now = self._seen[-1]
        before = self._seen[-1 - min(self._table.span, len(self._seen) - 1)]
        passed = max(min(self._table.span, len(self._seen) - 1), 1) / self._table.fps
        size = float(np.median([seen.radius for seen in self._seen]))
        motion = (
            (now.right - before.right) / (size * passed),
            (now.up - before.up) / (size * passed),
            float(np.log(now.radius / before.radius)) / passed,
        )
        return np.concatenate([now.shape, motion])


@dataclass(frozen=True, eq=False)
class PictureFeatures:
    """What one picture tells.

    Attributes:
        time_s: When its time ends, from the first picture on [s].
        rows: See `PersonTracker.see`.
        mask: The person's silhouette; None where nobody is seen.
    """

    time_s: float
    rows: list[npt.NDArray[np.float32]]
    mask: Mask | None


def track_person(
    pictures: Iterable[Picture],
    fps: float,
    table: ViewTable,
    segmentation: SegmentationConfig | None = None,
) -> Iterator[PictureFeatures]:
    """Look at pictures as they come, one sighting for each.

    Args:
        pictures: See `Segmenter`; the first second shows the room alone.
        fps: How many there are a second.
        table: What the database's frames look like.
        segmentation: How the person is told from the room.

    Raises:
        UsageError: The frame rate is not above 0.
        MotionError: A picture is none, or of another size than those before.
    """
    tracker = PersonTracker(table, fps, segmentation)
    for count, picture in enumerate(pictures, start=1):
        rows = tracker.see(picture)
        yield PictureFeatures(count / fps, rows, tracker.mask)
