"""Prediction as the definition has it, slow and readable.

What `dynresp.response.prediction.compiled_classifier` must equal: the kernel with every support
vector, one vote for each pair of classes, and a sort.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def pair_decisions(pipeline: Any, row: FloatArray) -> FloatArray:
    """Decision values of all pairs of classes for one row of features, in libsvm's sign."""
    scaler, pca, svc = (step for _, step in pipeline.steps)
    z = pca.components_ @ ((row - scaler.mean_) / scaler.scale_ - pca.mean_)
    kernel = [(svc._gamma * (s @ z) + svc.coef0) ** 2 for s in svc.support_vectors_]
    owner = np.repeat(np.arange(len(svc.classes_)), svc.n_support_)
    sign = -1.0 if len(svc.classes_) == 2 else 1.0
    values = []
    for i in range(len(svc.classes_)):
        for j in range(i + 1, len(svc.classes_)):
            value = svc.intercept_[len(values)]
            for k, coefficients, c in zip(kernel, svc.dual_coef_.T, owner, strict=True):
                if c == i:
                    value += coefficients[j - 1] * k
                elif c == j:
                    value += coefficients[i] * k
            values.append(sign * value)
    return np.array(values)


def scores(decisions: FloatArray, classes: int) -> FloatArray:
    """Votes and bounded confidences of all classes, from the decisions of one row."""
    votes, confidence = np.zeros(classes), np.zeros(classes)
    pairs = [(i, j) for i in range(classes) for j in range(i + 1, classes)]
    for (i, j), value in zip(pairs, decisions, strict=True):
        votes[j if value < 0.0 else i] += 1.0
        confidence[i] += value
        confidence[j] -= value
    return votes + confidence / (3.0 * (np.abs(confidence) + 1.0))


def rank(decisions: FloatArray, classes: int) -> list[int]:
    """All classes, the best first; of equal scores the lowest index first."""
    values = scores(decisions, classes)
    return sorted(range(classes), key=lambda c: (-values[c], c))
