"""Metrics of choices, compared with those of the full search: accuracy, regret, confusion.

Accuracy alone is too strict: in many hits the two best reactions fit nearly as well. Regret is the
cost of a wrong choice: how much larger its mismatch (window error) is than the full search's.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.response.search.full_search import ERROR_FLOOR
from dynresp.support.errors import UsageError

WITHIN = 0.01
"""A choice counts as equally good if its error is larger by at most this share."""

Choices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class ChoiceMetrics:
    """Metrics of the choices for some samples; shares from 0 to 1.

    Attributes:
        samples: How many samples.
        accuracy: Share in which the first choice is that of the full search.
        top2_accuracy: Share in which one of the two best choices is.
        within_1_percent: Share in which the error of the first choice is at most 1 % larger.
        regret: Mean of `regrets` of the first choice.
        regret_top2: The same for the better of the two best choices.
    """

    samples: int
    accuracy: float
    top2_accuracy: float
    within_1_percent: float
    regret: float
    regret_top2: float

    def to_json(self) -> dict[str, int | float]:
        """The metrics by name."""
        return asdict(self)


def measure(ranked: npt.NDArray[np.integer], labels: Choices, errors: FloatArray) -> ChoiceMetrics:
    """Measure choices.

    Args:
        ranked: (n, 2 or more) classes chosen, best first.
        labels: (n,) classes that the full search chose.
        errors: (n, classes) window errors [m].

    Raises:
        UsageError: There are no samples.
    """
    if not len(labels):
        raise UsageError("there are no samples to measure a classifier with")
    right = ranked[:, :2] == labels[:, None]
    first = regrets(ranked[:, 0], labels, errors)
    second = regrets(ranked[:, 1], labels, errors)
    return ChoiceMetrics(
        samples=len(labels),
        accuracy=float(right[:, 0].mean()),
        top2_accuracy=float(right.any(axis=1).mean()),
        within_1_percent=float(np.mean(first <= WITHIN)),
        regret=float(first.mean()),
        regret_top2=float(np.minimum(first, second).mean()),
    )


def regrets(chosen: npt.NDArray[np.integer], labels: Choices, errors: FloatArray) -> FloatArray:
    """The cost of each choice: max(0, error / error of the full search's choice - 1).

    The full search does not always choose the least error, because it lets the base motion go on
    only where that fits well. A choice with a smaller error costs nothing.

    Args:
        chosen: (n,) classes chosen.
        labels: (n,) classes that the full search chose.
        errors: (n, classes) window errors [m].
    """
    rows = np.arange(len(labels))
    # Errors below the floor are rounding errors.
    least = np.maximum(errors[rows, labels], ERROR_FLOOR)
    return np.asarray(np.maximum(errors[rows, chosen] / least - 1.0, 0.0))


def in_use(
    ranked: npt.NDArray[np.integer],
    errors: FloatArray,
    grazes: npt.NDArray[np.bool_],
    carry_on: int,
    limit: float,
) -> Choices:
    """Choices as the responder makes them with a classifier (`classifier_choice`).

    The responder itself measures whether a reaction is needed, as the full search does: none after
    a graze, and none where the base motion fits well enough and better than the predicted reaction.
    So only the order of the predicted reactions counts.

    Args:
        ranked: (n, 2 or more) classes, best first.
        errors: (n, classes) window errors [m].
        grazes: (n,) which hits were grazes.
        carry_on: The class "no reaction".
        limit: Largest error with which the base motion goes on [m].

    Returns:
        (n, 2): the choice, and the second choice, for a budget that aligns one more reaction.
    """
    rows = np.arange(len(ranked))
    # A stable sort by "is no reaction" brings the reactions to the front, in their order.
    order = np.argsort(ranked == carry_on, axis=1, kind="stable")
    reactions = np.take_along_axis(np.asarray(ranked, dtype=np.intp), order, axis=1)[:, :2]
    first, other = reactions.T
    stays = errors[:, carry_on] <= np.minimum(errors[rows, first], limit)
    stays |= grazes | (first == carry_on)
    better = np.where(errors[rows, other] < errors[rows, first], other, first)
    second = np.where(better == carry_on, first, better)
    return np.stack([np.where(stays, carry_on, first), np.where(stays, second, other)], axis=1)


def merge_mirrors(classes: npt.NDArray[np.integer], mirrors: Choices) -> Choices:
    """Classes, with mirror images counted as the same class.

    Args:
        classes: Any shape.
        mirrors: (classes,) each one's mirror image.
    """
    first = np.minimum(np.arange(len(mirrors)), mirrors)
    return np.asarray(first[classes])


def confusion(
    chosen: npt.NDArray[np.integer], labels: Choices, classes: int
) -> npt.NDArray[np.int64]:
    """How often each class was chosen (columns) where the full search chose each class (rows)."""
    counts = np.zeros((classes, classes), dtype=np.int64)
    np.add.at(counts, (labels, chosen), 1)
    return counts
