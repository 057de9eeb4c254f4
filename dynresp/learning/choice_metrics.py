"""How good choices are, against the oracle's.

Accuracy alone judges too hard: in many hits the two best reactions fit nearly as well. The regret
says what a wrong choice costs: how much larger its window error is than that of the oracle's.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.response.search.full_search import ERROR_FLOOR
from dynresp.support.errors import UsageError

WITHIN = 0.01
"""A choice is as good as the oracle's where its error is larger by no more than this share."""

Choices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Figures:
    """How good the choices for some samples are; shares from 0 to 1.

    Attributes:
        samples: How many samples.
        accuracy: Share in which the first choice is the oracle's.
        top2_accuracy: Share in which one of the two best is.
        within_1_percent: Share in which the first choice's error is at most 1 % above the oracle's.
        regret: Mean of what the first choice's error is above the oracle's, as a share of that.
        regret_top2: The same where the better of the two best is taken.
    """

    samples: int
    accuracy: float
    top2_accuracy: float
    within_1_percent: float
    regret: float
    regret_top2: float

    def to_json(self) -> dict[str, int | float]:
        """The figures by name."""
        return asdict(self)


def measure(ranked: npt.NDArray[np.integer], labels: Choices, errors: FloatArray) -> Figures:
    """Judge choices.

    Args:
        ranked: (n, 2 or more) classes chosen, the best first.
        labels: (n,) classes that the oracle chose.
        errors: (n, classes) window errors [m].

    Raises:
        UsageError: There are no samples.
    """
    if not len(labels):
        raise UsageError("there are no samples to judge a classifier by")
    right = ranked[:, :2] == labels[:, None]
    first = regrets(ranked[:, 0], labels, errors)
    second = regrets(ranked[:, 1], labels, errors)
    return Figures(
        samples=len(labels),
        accuracy=float(right[:, 0].mean()),
        top2_accuracy=float(right.any(axis=1).mean()),
        within_1_percent=float(np.mean(first <= WITHIN)),
        regret=float(first.mean()),
        regret_top2=float(np.minimum(first, second).mean()),
    )


def regrets(chosen: npt.NDArray[np.integer], labels: Choices, errors: FloatArray) -> FloatArray:
    """What each choice costs: max(0, error / error of the oracle's choice - 1).

    The oracle does not always choose the least error, since it goes on with the base motion only
    where that fits well; a choice that would fit better than the oracle's costs nothing.

    Args:
        chosen: (n,) classes chosen.
        labels: (n,) classes that the oracle chose.
        errors: (n, classes) window errors [m].
    """
    rows = np.arange(len(labels))
    # Below the floor, errors are rounding.
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

    Whether the base motion is carried on it measures, as the oracle does: after a graze always, and
    else where it fits well enough and better than the reaction that was predicted. So of what was
    predicted only the order of the reactions counts.

    Args:
        ranked: (n, 2 or more) classes, the best first.
        errors: (n, classes) window errors [m].
        grazes: (n,) which hits were grazes.
        carry_on: The class to carry on.
        limit: Largest error with which the base motion is carried on [m].

    Returns:
        (n, 2): the choice, and the best of what else would be aligned were there time for one
        more reaction.
    """
    rows = np.arange(len(ranked))
    # A stable sort by "is to carry on" brings the reactions to the front, in their order.
    order = np.argsort(ranked == carry_on, axis=1, kind="stable")
    reactions = np.take_along_axis(np.asarray(ranked, dtype=np.intp), order, axis=1)[:, :2]
    first, other = reactions.T
    stays = errors[:, carry_on] <= np.minimum(errors[rows, first], limit)
    stays |= grazes | (first == carry_on)
    better = np.where(errors[rows, other] < errors[rows, first], other, first)
    second = np.where(better == carry_on, first, better)
    return np.stack([np.where(stays, carry_on, first), np.where(stays, second, other)], axis=1)


def merge_mirrors(classes: npt.NDArray[np.integer], mirrors: Choices) -> Choices:
    """Classes with each one's mirror image counted as itself.

    Args:
        classes: Any shape.
        mirrors: (classes,) each one's mirror image.
    """
    first = np.minimum(np.arange(len(mirrors)), mirrors)
    return np.asarray(first[classes])


def confusion(
    chosen: npt.NDArray[np.integer], labels: Choices, classes: int
) -> npt.NDArray[np.int64]:
    """How often each class was chosen (columns) where the oracle chose each class (rows)."""
    counts = np.zeros((classes, classes), dtype=np.int64)
    np.add.at(counts, (labels, chosen), 1)
    return counts
