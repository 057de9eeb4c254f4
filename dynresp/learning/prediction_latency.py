"""Measure how long a prediction takes on this machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from dynresp.response.prediction.classifier import Classifier

BATCH = 1_000
"""Hits in a batch."""

_ALONE, _TOGETHER = 300, 7


def latency_us(
    classifier: Classifier, features: npt.NDArray[np.float32]
) -> dict[str, dict[str, float]]:
    """Median time of a prediction [microseconds], including the selection of the features.

    Args:
        classifier: The classifier.
        features: (n, all features), at least one.

    Returns:
        For the exact and for the reduced model: `alone` for one hit, `in_batch` for each of a
        thousand at once.
    """
    many = np.resize(features, (BATCH, features.shape[1]))
    found = {}
    for name, reduced in (("exact", False), ("reduced", True)):
        predict = partial(classifier.rank, reduced=reduced)
        one = [partial(predict, features[i % len(features)]) for i in range(_ALONE)]
        together = [partial(predict, many)] * _TOGETHER
        found[name] = {
            "alone": round(1e6 * _median(one), 2),
            "in_batch": round(1e6 * _median(together) / BATCH, 2),
        }
    return found


def _median(calls: Sequence[Callable[[], object]]) -> float:
    """Median duration [s] of some calls, after one that warms up."""
    calls[0]()
    durations = []
    for call in calls:
        began = time.perf_counter()
        call()
        durations.append(time.perf_counter() - began)
    return float(np.median(durations))
