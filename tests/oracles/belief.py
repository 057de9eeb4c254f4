"""One step of the hidden Markov model, state by state."""

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision import belief as settings
from dynresp.locomotion.vision.silhouette_table import ViewTable

FloatArray = npt.NDArray[np.float64]


def step(
    database: MotionDatabase, table: ViewTable, belief: FloatArray, row: FloatArray
) -> FloatArray:
    """The belief (n, views) a frame later."""
    stay, skip, change = settings.STAY_CHANCE, settings.SKIP_CHANCE, settings.CHANGE_CHANCE
    turn = settings.TURN_CHANCE
    n, views = belief.shape
    heading = np.round(np.arange(views) - database.planar[:, 3:4] / table.views.step) % views
    after = np.zeros_like(belief)
    for i in range(n):
        for v in range(views):
            for frames_on, chance in ((0, stay), (2, skip)):
                target = i + frames_on
                if target < n and database.clip_of[target] == database.clip_of[i]:
                    after[target, v] += (1 - change) * chance * belief[i, v]
            if database.successors[i] >= 0:
                after[i + 1, v] += (1 - change) * (1 - stay - skip) * belief[i, v]
    turned = (1 - turn) * after
    turned += 0.5 * turn * (np.roll(after, 1, axis=1) + np.roll(after, -1, axis=1))
    faces = np.array([belief[heading == k].sum() for k in range(views)])
    faces = 0.45 * faces + 0.225 * (np.roll(faces, 1) + np.roll(faces, -1)) + 0.1 / views
    for i in range(n):
        for v in range(views):
            turned[i, v] += change * faces[int(heading[i, v])] / n
            squared = np.sum((table.rows[i, v].astype(float) - row) ** 2)
            turned[i, v] *= np.exp(-0.5 * squared / settings.USUAL_SQUARED_DISTANCE)
    return turned / turned.sum()
