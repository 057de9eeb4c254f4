"""Budgets: how much time a choice may take, and who chooses."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.response.choice import Chooser
from dynresp.response.prediction.classifier import Classifier
from dynresp.response.prediction.classifier_choice import ClassifierChooser
from dynresp.response.response import ResponseConfig
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.support.errors import UsageError

Budget: TypeAlias = Literal["fast", "better", "best"]
BUDGETS: tuple[str, ...] = get_args(Budget)
"""fast: align the classifier's first choice; better: align its two best and take the better one;
best: make the full search."""

_ALIGNED = {"fast": 1, "better": 2}


def chooser_for(
    budget: str,
    character: Character,
    library: ReactionLibrary,
    config: ResponseConfig,
    classifier: Classifier | None = None,
) -> Chooser:
    """Make what chooses with a budget.

    Args:
        budget: One of `BUDGETS`.
        character: The character.
        library: Its reactions.
        config: Settings of the responses.
        classifier: Trained for this character and library; "best" needs none.

    Raises:
        UsageError: There is no such budget, or it needs a classifier.
        ClassifierError: The classifier was trained for something else.
        MotionError: A clip is shorter than a window.
    """
    if budget not in BUDGETS:
        raise UsageError(f"the budget is one of {', '.join(BUDGETS)}, got {budget!r}")
    if budget == "best":
        return FullSearchChooser(character, library, config)
    if classifier is None:
        raise UsageError(
            f"the budget {budget!r} needs a trained classifier; give one, or use the budget 'best'"
        )
    return ClassifierChooser(character, library, config, classifier, best=_ALIGNED[budget])
