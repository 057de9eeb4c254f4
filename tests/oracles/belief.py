"""One step of the hidden Markov model, state by state."""

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.belief import BeliefConfig
from dynresp.locomotion.vision.silhouette_table import ViewTable

FloatArray = npt.NDArray[np.float64]


def step(
    database: MotionDatabase,
    table: ViewTable,
    config: BeliefConfig,
    belief: FloatArray,
    row: FloatArray,
) -> FloatArray:
    """The belief (n, views) a frame later."""
    n, views = belief.shape
    heading = np.round(np.arange(views) - database.planar[:, 3:4] / table.views.step) % views
    after = np.zeros_like(belief)
    for i in range(n):
        for v in range(views):
            for lasts, chance in ((0, config.slow), (2, config.fast)):
                target = i + lasts
                if target < n and database.clip_of[target] == database.clip_of[i]:
                    after[target, v] += (1 - config.anew) * chance * belief[i, v]
            if database.successors[i] >= 0:
                chance = 1 - config.slow - config.fast
                after[i + 1, v] += (1 - config.anew) * chance * belief[i, v]
    drifted = (1 - config.drift) * after
    drifted += 0.5 * config.drift * (np.roll(after, 1, axis=1) + np.roll(after, -1, axis=1))
    faces = np.array([belief[heading == k].sum() for k in range(views)])
    faces = 0.45 * faces + 0.225 * (np.roll(faces, 1) + np.roll(faces, -1)) + 0.1 / views
    for i in range(n):
        for v in range(views):
            drifted[i, v] += config.anew * faces[int(heading[i, v])] / n
            apart = np.sum((table.rows[i, v].astype(float) - row) ** 2)
            drifted[i, v] *= np.exp(-0.5 * apart / config.tolerance)
    return drifted / drifted.sum()
