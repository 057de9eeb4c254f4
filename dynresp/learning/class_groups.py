"""Classes of a classifier: one per reaction, or one per strategy.

Zordan et al. 2007 (section 7) propose strategies for large libraries: the classifier predicts the
strategy, and alignment selects the reaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.response.prediction.classifier import GROUPINGS
from dynresp.response.response import CARRY_ON
from dynresp.support.errors import UnknownNameError, UsageError


@dataclass(frozen=True, eq=False)
class Groups:
    """The classes of a dataset's choices.

    Attributes:
        names: Of the classes; the last is "no reaction" (`CARRY_ON`).
        members: For each class its choices.
        of: (choices,) the class of each choice of the dataset.
        strategies: Strategy of each class; that of `CARRY_ON` is `CARRY_ON`.
        mirrors: (classes,) index of each class's mirror image; its own where it has none.
    """

    names: tuple[str, ...]
    members: tuple[tuple[str, ...], ...]
    of: npt.NDArray[np.intp]
    strategies: tuple[str, ...]
    mirrors: npt.NDArray[np.intp]

    @property
    def carry_on(self) -> int:
        """Index of the class "no reaction": the base motion goes on."""
        return self.names.index(CARRY_ON)

    def labels(self, labels: npt.NDArray[np.integer]) -> npt.NDArray[np.intp]:
        """Classes of the full search's choices, (n,)."""
        return self.of[labels]

    def errors(self, errors: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Window error [m] of each class, (n, classes): the least of its members.

        Args:
            errors: (n, choices) [m].
        """
        least = np.full((len(errors), len(self.names)), np.inf)
        for choice, group in enumerate(self.of):
            np.minimum(least[:, group], errors[:, choice], out=least[:, group])
        return least


def make_groups(
    choices: Sequence[str],
    strategies: Sequence[str],
    mirrors: Sequence[int],
    by: str,
) -> Groups:
    """Group the choices of a dataset into classes.

    Args:
        choices: Names of the reactions, then `CARRY_ON`.
        strategies: Strategy of each.
        mirrors: For each the index of its mirror image.
        by: "reactions" for one class each; "strategies" for one class per strategy, which holds
            mirror images, too.

    Raises:
        UnknownNameError: There is no such grouping.
        UsageError: The last choice is not `CARRY_ON`.
    """
    if by not in GROUPINGS:
        raise UnknownNameError("grouping of classes", by, GROUPINGS)
    if not choices or choices[-1] != CARRY_ON:
        raise UsageError(f"expected {CARRY_ON!r} as the last of the choices, got {list(choices)}")
    if by == "reactions":
        return Groups(
            names=tuple(choices),
            members=tuple((name,) for name in choices),
            of=np.arange(len(choices)),
            strategies=tuple(strategies),
            mirrors=np.asarray(mirrors, dtype=np.intp),
        )
    names = tuple(dict.fromkeys(strategies))
    members = tuple(
        tuple(name for name, own in zip(choices, strategies, strict=True) if own == strategy)
        for strategy in names
    )
    of = np.array([names.index(strategy) for strategy in strategies])
    # A strategy holds its own mirror images.
    return Groups(names, members, of, names, np.arange(len(names)))
