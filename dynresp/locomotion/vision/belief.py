"""What somebody before a camera is doing now: a belief over all frames and viewpoints.

The paper compares a buffer of the past with motions that the avatar could do next, and so lags
behind by the time that matching takes (three seconds, section 5.3). Here every new picture is
weighed at once: a hidden Markov model whose states are the frames of the database, each from every
viewpoint. A frame is followed by the next one of its clip, a little faster or slower; now and then
something else begins, anywhere in the database, but with the person facing the camera as before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.support.errors import UsageError

# How the facing of the last moment is taken over to something new: a share goes to the neighbours
# at each side, and a share anywhere.
_NEIGHBOUR, _ANYWHERE = 0.225, 0.1


@dataclass(frozen=True)
class BeliefConfig:
    """How fast a belief changes.

    Attributes:
        slow: Chance that a frame is followed by itself.
        fast: Chance that one frame is left out.
        anew: Chance in each frame that something else begins.
        drift: Chance in each frame that the neighbouring viewpoint fits better.
        tolerance: Squared distance that is usual between moments that count as alike; see
            `ViewTable`.
    """

    slow: float = 0.12
    fast: float = 0.2
    anew: float = 0.2
    drift: float = 0.2
    tolerance: float = 1.5

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One of them makes no sense.
        """
        for name in ("slow", "fast", "anew", "drift"):
            if not 0.0 < getattr(self, name) < 0.5:
                raise UsageError(f"{name} must be between 0 and 0.5, got {getattr(self, name)}")
        if not 0.0 < self.tolerance < np.inf:
            raise UsageError(f"tolerance must be above 0, got {self.tolerance}")


class Belief:
    """The belief about one person.

    Attributes:
        table: What frames look like.
        states: (n, views) float32, how probable each frame from each viewpoint is; sums to 1.
    """

    def __init__(
        self, database: MotionDatabase, table: ViewTable, config: BeliefConfig | None = None
    ) -> None:
        """Know nothing yet.

        Raises:
            UsageError: The table is of another database.
        """
        if len(table.rows) != len(database):
            raise UsageError(
                f"the table is of {len(table.rows)} frames, the database has {len(database)}; "
                "make the table of this database"
            )
        self.table = table
        self._config = config = config or BeliefConfig()
        count = table.views.count
        yaw = database.planar[:, 3:4] / table.views.step
        self._headings = (np.round(np.arange(count) - yaw) % count).astype(np.uint16)
        starts = np.array([clip.start for clip in database.clips])[database.clip_of]
        self._past = np.minimum(np.arange(len(database)) - starts, 2).astype(np.uint8)
        goes_on = 1.0 - config.anew
        pace = np.array([config.slow, 1.0 - config.slow - config.fast, config.fast]) * goes_on
        self._pace = tuple(np.float32(share) for share in pace)
        self._scratch = np.empty((len(database), count), dtype=np.float32)
        self._after = np.empty_like(self._scratch)
        for array in (self._headings, self._past):
            array.flags.writeable = False
        self.states = np.full(self._after.shape, 1.0 / self._after.size, dtype=np.float32)

    def see(self, row: npt.ArrayLike) -> None:
        """A frame later, take in what is seen.

        Args:
            row: (d,) as `ViewTable.row` gives it.
        """
        # Numba takes a third of a second to import.
        from dynresp.locomotion.vision.belief_kernel import belief_step_kernel

        fresh = self.headings
        fresh = (1.0 - 2.0 * _NEIGHBOUR - _ANYWHERE) * fresh + _NEIGHBOUR * (
            np.roll(fresh, 1) + np.roll(fresh, -1)
        )
        # Each direction is that of one viewpoint of every frame.
        fresh = (fresh + _ANYWHERE / len(fresh)) * (self._config.anew / len(self.states))
        seen = np.array(row, dtype=np.float32)
        seen.flags.writeable = False
        belief_step_kernel(
            self.table.rows, seen, self._headings, self._past, fresh.astype(np.float32),
            self._pace, np.float32(self._config.drift), np.float32(0.5 / self._config.tolerance),
            self._scratch, self.states, self._after,
        )  # fmt: skip
        self.states, self._after = self._after, self.states

    @property
    def frames(self) -> npt.NDArray[np.float32]:
        """(n,) how probable each frame is, from wherever it is seen."""
        return np.asarray(self.states.sum(axis=1), dtype=np.float32)

    @property
    def headings(self) -> npt.NDArray[np.float64]:
        """(views,) how the person faces the camera.

        Entry k is how probable it is that the camera looks in the direction k steps to the left of
        where the person faces; so in entry 0 it looks at the back.
        """
        count = self.table.views.count
        summed = np.bincount(self._headings.ravel(), self.states.ravel(), minlength=count)
        return np.asarray(summed, dtype=np.float64)
