"""How probable each frame of the database is to be what a person before a camera does now.

The paper compares the last seconds of video with motions that the avatar could do next, and so it
is late by the time that matching takes (three seconds, section 5.3). Here every new picture
changes the probabilities at once, with a hidden Markov model: its states are the frames of the
database, each from every viewpoint. A frame is followed by the next one of its clip, a little
faster or slower. Now and then the person begins something else, anywhere in the database, and
faces the camera as before.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.support.arrays import frozen
from dynresp.support.errors import UsageError

STAY_CHANCE = 0.12
"""Chance that a frame is followed by itself, if nothing else begins."""
SKIP_CHANCE = 0.2
"""Chance that one frame of the clip is left out, if nothing else begins."""
CHANGE_CHANCE = 0.2
"""Chance in each frame that the person begins something else."""
TURN_CHANCE = 0.2
"""Chance in each frame that a neighbouring viewpoint fits better."""
USUAL_SQUARED_DISTANCE = 1.5
"""Squared distance that is usual between rows of moments that count as alike; see `ViewTable`."""
# When something else begins, this share of the belief about the heading goes to the neighbour at
# each side, and this share to all directions alike.
_NEIGHBOUR, _ANYWHERE = 0.225, 0.1


class Belief:
    """The belief about one person.

    Attributes:
        table: What the frames look like.
        states: (n, views) float32, how probable each frame from each viewpoint is; sums to 1.
    """

    def __init__(self, database: MotionDatabase, table: ViewTable) -> None:
        """Begin with all states equally probable.

        Args:
            database: The frames.
            table: What they look like.

        Raises:
            UsageError: The table is of another database.
        """
        if len(table.rows) != len(database):
            raise UsageError(
                f"the table is of {len(table.rows)} frames, the database has {len(database)}; "
                "make the table of this database"
            )
        # Numba takes a third of a second to import.
        from dynresp.locomotion.vision.belief_kernel import FrameViews, StepChances

        self.table = table
        count = table.views.count
        yaw = database.planar[:, 3:4] / table.views.step
        self._headings = frozen((np.round(np.arange(count) - yaw) % count).astype(np.uint16))
        starts = np.array([clip.start for clip in database.clips])[database.clip_of]
        past = frozen(np.minimum(np.arange(len(database)) - starts, 2).astype(np.uint8))
        self._frames = FrameViews(table.rows, self._headings, past)
        goes_on = 1.0 - CHANGE_CHANCE
        self._chances = StepChances(
            stay=np.float32(STAY_CHANCE * goes_on),
            advance=np.float32((1.0 - STAY_CHANCE - SKIP_CHANCE) * goes_on),
            skip=np.float32(SKIP_CHANCE * goes_on),
            turn=np.float32(TURN_CHANCE),
            exponent_scale=np.float32(0.5 / USUAL_SQUARED_DISTANCE),
        )
        self._scratch = np.empty((len(database), count), dtype=np.float32)
        self._after = np.empty_like(self._scratch)
        self.states = np.full(self._after.shape, 1.0 / self._after.size, dtype=np.float32)

    def see(self, row: npt.ArrayLike) -> None:
        """Take in what is seen one frame of the database later.

        Args:
            row: (d,) as `ViewTable.row` gives it.
        """
        from dynresp.locomotion.vision.belief_kernel import belief_step_kernel

        fresh = self.headings
        fresh = (1.0 - 2.0 * _NEIGHBOUR - _ANYWHERE) * fresh + _NEIGHBOUR * (
            np.roll(fresh, 1) + np.roll(fresh, -1)
        )
        # Each direction is that of one viewpoint of every frame.
        fresh = (fresh + _ANYWHERE / len(fresh)) * (CHANGE_CHANCE / len(self.states))
        belief_step_kernel(
            self._frames, self._chances, frozen(np.array(row, dtype=np.float32)),
            fresh.astype(np.float32), self._scratch, self.states, self._after,
        )  # fmt: skip
        self.states, self._after = self._after, self.states

    @property
    def frames(self) -> npt.NDArray[np.float32]:
        """(n,) how probable each frame is, over all viewpoints."""
        return np.asarray(self.states.sum(axis=1), dtype=np.float32)

    @property
    def headings(self) -> npt.NDArray[np.float64]:
        """(views,) how the person faces the camera.

        Entry k is the probability that the camera looks in the direction k steps to the left of
        where the person faces. In entry 0 the camera sees the person's back.
        """
        count = self.table.views.count
        summed = np.bincount(self._headings.ravel(), self.states.ravel(), minlength=count)
        return np.asarray(summed, dtype=np.float64)
