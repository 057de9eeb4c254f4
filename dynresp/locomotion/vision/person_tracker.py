"""Find the person in each picture, and give features at the database's frame rate."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.vision.segmentation import Mask, Picture, Segmenter
from dynresp.locomotion.vision.silhouette_features import Measures, measure
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

# The size of a person in the picture is the median over this time [s].
_SIZE_S = 1.0
# Speeds begin again for a person who was not seen for this long [s].
_LOST_S = 0.5


class PersonTracker:
    """Finds the person in pictures, and gives rows of features as a table has them.

    Attributes:
        mask: The last silhouette; None if nobody was there, and while the room is learnt.
        pictures: Number of pictures so far.
    """

    def __init__(self, table: ViewTable, fps: float) -> None:
        """Wait for the first picture.

        Args:
            table: What the database's frames look like.
            fps: Pictures per second of the video.

        Raises:
            UsageError: The frame rate is not above 0.
        """
        if not 0.0 < fps < np.inf:
            raise UsageError(f"fps must be above 0, got {fps}")
        self.mask: Mask | None = None
        self.pictures = 0
        self._table = table
        self._fps = fps
        self._segmenter = Segmenter(min(fps, table.fps))
        # What was measured, one entry for each frame of the database.
        kept = max(table.span, round(_SIZE_S * table.fps)) + 1
        self._seen: deque[Measures] = deque(maxlen=kept)
        self._ticks = 0
        self._missed = 0

    def see(self, picture: Picture) -> list[npt.NDArray[np.float32]]:
        """Look at the next picture.

        If the video has more pictures a second than the database has frames, some pictures are
        passed over. If it has fewer, one picture stands for several frames.

        Returns:
            Rows (d,) as in the table, one for each frame of the database; none if the picture is
            passed over, the room is still being learnt, or nobody is there.

        Raises:
            MotionError: It is not a picture, or its size differs from the first one's.
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
        # After a person was hidden for a moment, speeds still need an entry for every frame.
        self._seen.extend([measured] * (self._missed if self._seen else 0))
        self._missed = 0
        rows = []
        for _ in range(due):
            self._seen.append(measured)
            rows.append(self._table.row(self._now()))
        return rows

    def _now(self) -> FloatArray:
        """(m,) what is measured now: the shape, the centre's speeds [radii/s], growth [1/s]."""
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
    """The features of one picture.

    Attributes:
        time_s: When the picture's time ends; the first picture begins at 0 [s].
        rows: See `PersonTracker.see`.
        mask: The person's silhouette; None if nobody is seen.
    """

    time_s: float
    rows: list[npt.NDArray[np.float32]]
    mask: Mask | None


def track_person(
    pictures: Iterable[Picture], fps: float, table: ViewTable
) -> Iterator[PictureFeatures]:
    """Give the features of each picture as it comes.

    Args:
        pictures: See `Segmenter.segment`; the first second shows the empty room.
        fps: Pictures per second.
        table: What the database's frames look like.

    Raises:
        UsageError: The frame rate is not above 0.
        MotionError: One of them is not a picture, or its size differs from the first one's.
    """
    tracker = PersonTracker(table, fps)
    for count, picture in enumerate(pictures, start=1):
        rows = tracker.see(picture)
        yield PictureFeatures(count / fps, rows, tracker.mask)
