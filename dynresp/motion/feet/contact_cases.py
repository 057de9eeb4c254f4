"""Which of the four contact cases a transition is for each foot (Lee et al. 2002, section 4.1.1).

A transition goes from frame i to frame j of a database, and the frames from j to j + b - 1 are
blended. The case is that of a foot's first stance in the blend.

By the paper's text a stance that begins with frame j itself, where the foot has just landed, is
case 4 as well if it outlasts the blend. Such a foot could be put where the motion after has it; but
it lands where the blend is strongest, and walks in which these count as case 2 slide more (5 % of
all stances by more than 1 cm, instead of 3 %).
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import numpy.typing as npt


class ContactCase(IntEnum):
    """When a stance begins and ends relative to a blend; the numbers are the paper's.

    Attributes:
        NONE: The foot does not stand in the blend.
        BEFORE: Begun before the blend, ended in it.
        AFTER: Begun in the blend, ended after it.
        INSIDE: All in the blend.
        ACROSS: It lasts for the whole blend, begun before or with it: it cannot move from where one
            motion has it to where the other does. `foot_fitting` puts it once, between the two if
            it has just begun, and leaves it there until the foot is lifted; a graph may drop
            the transition instead.
    """

    NONE = 0
    BEFORE = 1
    AFTER = 2
    INSIDE = 3
    ACROSS = 4


def contact_cases(
    contacts: npt.NDArray[np.bool_],
    ends: npt.ArrayLike,
    sources: npt.ArrayLike,
    targets: npt.ArrayLike,
    blend: int,
) -> npt.NDArray[np.uint8]:
    """The case of each foot in each transition.

    Args:
        contacts: (n, c) which feet stand in the frames of a database.
        ends: (n,) one past the last frame of the clip that a frame is in.
        sources: (m,) frames i that transitions leave.
        targets: (m,) frames j that they enter.
        blend: Frames b that are blended.

    Returns:
        (m, c) of `ContactCase`.
    """
    stands = np.asarray(contacts, dtype=bool)
    ends, sources, targets = (np.asarray(x, dtype=np.intp) for x in (ends, sources, targets))
    cases = np.zeros((len(targets), stands.shape[1]), dtype=np.uint8)
    last = targets + blend - 1
    for column, flags in enumerate(stands.T):
        until, after = _next_change(flags, ends)
        began = np.where(flags[targets], targets, until[targets])
        meets = (began <= last) & (began < ends[targets])
        # One past the last frame in which the foot stands.
        stop = np.where(flags[targets], until[targets], after[targets])
        lasts = stop > last
        case = np.where(lasts, ContactCase.AFTER, ContactCase.INSIDE)
        at_once = flags[targets]
        case = np.where(at_once & lasts, ContactCase.ACROSS, case)
        case = np.where(at_once & ~lasts & flags[sources], ContactCase.BEFORE, case)
        cases[:, column] = np.where(meets, case, ContactCase.NONE)
    return cases


def _next_change(
    flags: npt.NDArray[np.bool_], ends: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Where contact next changes in each frame's clip, and where it then changes back (n,) each.

    The clip's end where it does not.
    """
    n = len(flags)
    changes = np.flatnonzero(flags[1:] != flags[:-1]) + 1
    at = np.searchsorted(changes, np.arange(n), side="right")
    padded = np.concatenate([changes, [n, n]])
    return np.minimum(padded[at], ends), np.minimum(padded[at + 1], ends)
