"""Recognise what a person before a camera is doing, from how the last second looked.

A small neural network learns from the silhouettes of the database to which cluster they belong. It
sees a second at once, and generalises over people's styles. The belief of
`dynresp.locomotion.vision.belief` follows single frames, and knows how the person faces the camera.
The two err in different ways, and together err less than either.
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

# The network sees the rows of these moments together, so long ago [s].
_AGES_S = (0.0, 0.133, 0.267, 0.4, 0.6, 0.8, 1.0)
# Neurons of the hidden layer, L2 regularisation of the weights, and passes over the examples.
_WIDTH, _REGULARISATION, _PASSES = 128, 1.0, 6
# At most so many examples are learnt from: frames of the database, each from one viewpoint.
_MAX_EXAMPLES = 250_000


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Recognises clusters from a second of rows.

    Attributes:
        ages: (a,) how many frames ago the rows are that the network sees; the first is 0.
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
        """Train the network on a database; takes some seconds.

        Args:
            database: The frames.
            table: What they look like.
            labels: (n,) cluster of each frame.
            seed: Seed of the choice of examples and of the network.
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
        chosen = rng.permutation(len(database) * views)[:_MAX_EXAMPLES]
        frames, viewpoints = chosen // views, chosen % views
        before = np.maximum(frames[:, None] - ages, starts[frames][:, None])
        examples = table.rows[before, viewpoints[:, None]].reshape(len(chosen), -1)
        network = MLPClassifier(
            (_WIDTH,), alpha=_REGULARISATION, batch_size=min(512, len(chosen)), max_iter=_PASSES,
            random_state=seed,
        )  # fmt: skip
        # The matrix products are small: several threads would wait for each other.
        with warnings.catch_warnings(), threadpool_limits(1):
            # It stops early on purpose, and scikit-learn warns of that.
            warnings.simplefilter("ignore", ConvergenceWarning)
            network.fit(examples, labels[frames])
        (first, last), (first_bias, last_bias) = network.coefs_, network.intercepts_
        count = int(labels.max()) + 1
        # For two classes the network has one output: that of the second.
        if last.shape[1] == 1:
            last = np.hstack([np.zeros_like(last), last])
            last_bias = np.concatenate([[0.0], last_bias])
        # A cluster without frames keeps a bias of minus infinity, so a probability of 0.
        all_last, all_bias = np.zeros((_WIDTH, count)), np.full(count, -np.inf)
        all_last[:, network.classes_], all_bias[network.classes_] = last, last_bias
        return cls(
            ages,
            (first.astype(np.float64), all_last),
            (first_bias.astype(np.float64), all_bias),
        )

    def probabilities(self, rows: npt.NDArray[np.float32]) -> FloatArray:
        """How probable each cluster is.

        Args:
            rows: (m, d) what was seen in the last frames, the latest last. If they are fewer than
                the network looks back, the first row stands for those before it.

        Returns:
            (K,) probabilities; they add up to 1.
        """
        at = np.maximum(len(rows) - 1 - self.ages, 0)
        hidden = rows[at].astype(np.float64).ravel() @ self.weights[0] + self.biases[0]
        logits = np.maximum(hidden, 0.0) @ self.weights[1] + self.biases[1]
        shares = np.exp(logits - logits.max())
        return np.asarray(shares / shares.sum())
