"""Figures of choices, sample by sample."""

from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.response.search.full_search import ERROR_FLOOR


def figures(
    ranked: npt.NDArray[Any], labels: npt.NDArray[Any], errors: npt.NDArray[Any]
) -> dict[str, float]:
    """What `dynresp.learning.choice_metrics.measure` says."""
    right, right2, within = 0, 0, 0
    regret, regret2 = 0.0, 0.0
    for row, label, error in zip(ranked, labels, errors, strict=True):
        best = max(error[label], ERROR_FLOOR)
        costs = [max(0.0, error[choice] / best - 1.0) for choice in row[:2]]
        right += row[0] == label
        right2 += label in row[:2]
        within += costs[0] <= 0.01
        regret += costs[0]
        regret2 += min(costs)
    n = len(labels)
    return {
        "samples": n,
        "accuracy": right / n,
        "top2_accuracy": right2 / n,
        "within_1_percent": within / n,
        "regret": regret / n,
        "regret_top2": regret2 / n,
    }


def in_use(
    ranked: npt.NDArray[Any],
    errors: npt.NDArray[Any],
    grazes: npt.NDArray[Any],
    carry_on: int,
    limit: float,
) -> list[list[int]]:
    """What `dynresp.learning.choice_metrics.in_use` says."""
    found = []
    for row, error, graze in zip(ranked, errors, grazes, strict=True):
        reactions = [int(choice) for choice in row if choice != carry_on]
        one = reactions[0]
        two = reactions[1] if len(reactions) > 1 else None
        if graze or error[carry_on] <= min(error[one], limit):
            better = two if two is not None and error[two] < error[one] else one
            found.append([carry_on, better])
        else:
            found.append([one, carry_on if two is None else two])
    return found


def least_of_members(errors: npt.NDArray[Any], of: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """What `dynresp.learning.class_groups.Groups.errors` says."""
    groups = int(of.max()) + 1
    return np.array(
        [[min(e for e, g in zip(row, of, strict=True) if g == k) for k in range(groups)]
         for row in errors]
    )  # fmt: skip


def neighbours(
    known: npt.NDArray[Any], labels: npt.NDArray[Any], row: npt.NDArray[Any], count: int
) -> int:
    """The class of the most of the nearest samples; of equal votes that of the nearer one."""
    spread = known.std(axis=0)
    distances = [np.linalg.norm((sample - row) / spread) for sample in known]
    nearest = [int(labels[i]) for i in np.argsort(distances)[:count]]
    return max(nearest, key=lambda c: (nearest.count(c), -nearest.index(c)))
