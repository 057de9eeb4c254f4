"""What one class stands for: a reaction, or all reactions of a strategy.

Zordan et al. 2007 (section 7) propose the latter for large libraries: the classifier picks the
strategy, and alignment picks the example within it.
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
    """How the choices of a dataset fall into classes.

    Attributes:
        names: Of the classes; to carry on is one by itself, the last.
        members: For each class the choices that belong to it.
        of: (choices,) the class of each choice of the dataset.
        strategies: Strategy of each class; that of `CARRY_ON` is `CARRY_ON`.
        mirrors: (classes,) the class that is each one's mirror image, itself where there is none.
    """

    names: tuple[str, ...]
    members: tuple[tuple[str, ...], ...]
    of: npt.NDArray[np.intp]
    strategies: tuple[str, ...]
    mirrors: npt.NDArray[np.intp]

    @property
    def carry_on(self) -> int:
        """The class to carry on with the base motion."""
        return self.names.index(CARRY_ON)

    def labels(self, labels: npt.NDArray[np.integer]) -> npt.NDArray[np.intp]:
        """Classes of the oracle's choices, (n,)."""
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
    """Put the choices of a dataset into classes.

    Args:
        choices: Names of the reactions, then `CARRY_ON`.
        strategies: Strategy of each.
        mirrors: For each the place of its mirror image.
        by: "reactions" for one class each; "strategies" for one class a strategy, mirror images
            and all.

    Raises:
        UnknownNameError: There is no such grouping.
        UsageError: The last choice is not to carry on.
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
    # A strategy is mirrored onto itself: left and right are members of the same class.
    return Groups(names, members, of, names, np.arange(len(names)))
