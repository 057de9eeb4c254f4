"""What somebody before a camera is doing, from how the last second looked.

A small neural network learns from the silhouettes of the database which cluster they belong to. It
sees a second at once, and where people differ in style it generalises; the belief of
`dynresp.locomotion.vision.belief` follows single frames and knows how somebody faces the camera.
They err in different ways, and together err less than either.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.extras import require

# Moments that are seen together: so long ago [s].
_AGES_S = (0.0, 0.133, 0.267, 0.4, 0.6, 0.8, 1.0)
# Width of the network, how strongly its weights are held small, how often it sees its examples,
# and how many there are at most: frames of the database, each from some viewpoint.
_WIDTH, _DECAY, _ROUNDS, _EXAMPLES = 128, 1.0, 6, 250_000


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Tells clusters from a second of rows.

    Attributes:
        ages: (a,) how many frames ago the rows are that it looks at; the first is 0.
        weights: Of the two layers, (a d, width) and (width, K).
        biases: Of the two layers, (width,) and (K,).
    """

    ages: IntArray
    weights: tuple[FloatArray, FloatArray]
    biases: tuple[FloatArray, FloatArray]

    @classmethod
    def trained(
        cls, database: MotionDatabase, table: ViewTable, labels: IntArray, seed: int = 0
    ) -> Recogniser:
        """Learn from a database: some seconds.

        Args:
            database: The frames.
            table: What they look like.
            labels: (n,) cluster of each.
            seed: Of the examples and the network.
        """
        # Scikit-learn takes a second to import.
        require("sklearn")
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPClassifier
        from threadpoolctl import threadpool_limits

        ages = np.array([round(age * table.fps) for age in _AGES_S], dtype=np.int32)
        starts = np.array([clip.start for clip in database.clips])[database.clip_of]
        rng = np.random.default_rng(seed)
        views = table.views.count
        chosen = rng.permutation(len(database) * views)[:_EXAMPLES]
        frames, seen_from = chosen // views, chosen % views
        before = np.maximum(frames[:, None] - ages, starts[frames][:, None])
        examples = table.rows[before, seen_from[:, None]].reshape(len(chosen), -1)
        network = MLPClassifier(
            (_WIDTH,), alpha=_DECAY, batch_size=min(512, len(chosen)), max_iter=_ROUNDS,
            random_state=seed,
        )  # fmt: skip
        # The products are small: threads would wait for each other.
        with warnings.catch_warnings(), threadpool_limits(1):
            # It stops early on purpose.
            warnings.simplefilter("ignore", ConvergenceWarning)
            network.fit(examples, labels[frames])
        (first, last), (first_bias, last_bias) = network.coefs_, network.intercepts_
        count = int(labels.max()) + 1
        # Of two classes the network has one output: the second's.
        if last.shape[1] == 1:
            last = np.hstack([np.zeros_like(last), last])
            last_bias = np.concatenate([[0.0], last_bias])
        whole, whole_bias = np.zeros((_WIDTH, count)), np.full(count, -np.inf)
        whole[:, network.classes_], whole_bias[network.classes_] = last, last_bias
        return cls(
            ages,
            (first.astype(np.float64), whole),
            (first_bias.astype(np.float64), whole_bias),
        )

    def probabilities(self, rows: npt.NDArray[np.float32]) -> FloatArray:
        """How probable each cluster is.

        Args:
            rows: (m, d) what was seen in the last frames, the latest last; where they are fewer
                than it looks back, the first counts for those before it.

        Returns:
            (K,).
        """
        at = np.maximum(len(rows) - 1 - self.ages, 0)
        hidden = rows[at].astype(np.float64).ravel() @ self.weights[0] + self.biases[0]
        logits = np.maximum(hidden, 0.0) @ self.weights[1] + self.biases[1]
        shares = np.exp(logits - logits.max())
        return np.asarray(shares / shares.sum())
