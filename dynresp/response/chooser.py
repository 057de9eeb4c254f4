"""`[choice]` of a spec: budget and classifier, and the chooser that they give."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import BUILTIN, RECORDED, ReactionLibrary
from dynresp.response.budget import Budget, chooser_for
from dynresp.response.choice import Chooser
from dynresp.response.prediction.classifier import Classifier, ClassifierError, TrainedFor
from dynresp.response.prediction.classifier_file import load_classifier
from dynresp.response.response import ResponseConfig
from dynresp.response.response_settings import settings_record
from dynresp.specs.shared_tables import Strict
from dynresp.support.errors import SpecError
from dynresp.support.paths import classifier_file, expanded, models_folder

SHIPPED = (BUILTIN, *RECORDED)
"""Names of the libraries for which a classifier is shipped."""


class ChoiceTable(Strict):
    """`[choice]`: how much time a choice may take, and with which classifier."""

    budget: Budget = "fast"
    classifier: Annotated[str, Field(min_length=1, max_length=1000)] | None = None


@dataclass(frozen=True)
class NamedChooser:
    """A chooser and where it comes from.

    Attributes:
        chooser: The chooser.
        record: What `result.json` says about it under `choosing`.
    """

    chooser: Chooser
    record: dict[str, Any]


def make_chooser(
    table: ChoiceTable,
    character: Character,
    library: ReactionLibrary,
    config: ResponseConfig,
    beside: Path,
) -> NamedChooser:
    """Make the chooser of a spec.

    If there is no classifier for the library, it is the full search (oracle).

    Args:
        table: The experiment's `[choice]`.
        character: The character.
        library: Its reactions.
        config: Settings of the responses.
        beside: Folder of the spec file; a relative path counts from it.

    Raises:
        SpecError: A classifier is given with the budget "best".
        ClassifierError: A classifier's file is damaged, or it was trained for something else.
        MotionError: A clip of the library is shorter than a window.
    """
    budget = table.budget
    if budget == "best" and table.classifier is not None:
        raise SpecError(
            'choice: the budget "best" makes a full search and uses no classifier; leave out '
            "classifier, or set another budget"
        )
    record: dict[str, Any] = {"budget": budget}
    classifier = None
    if budget != "best":
        named = None if table.classifier is None else beside / expanded(table.classifier, "choice")
        try:
            classifier = find_classifier(library, character, named)
        except ClassifierError as error:
            if named is not None:
                raise
            # The user's own classifier is damaged or outdated; use the shipped one.
            record["passed_over"] = str(error)
            classifier = _shipped(library, character)
        if classifier is None:
            record = {**record, "budget": "best", "instead_of": budget}
            budget = "best"
    if classifier is not None:
        record["classifier"] = _classifier_record(classifier, config)
    return NamedChooser(chooser_for(budget, character, library, config, classifier), record)


def find_classifier(
    library: ReactionLibrary, character: Character, named: Path | None = None
) -> Classifier | None:
    """Find the classifier for a library: the one given, else the user's own, else the shipped one.

    Args:
        library: The reactions.
        character: Their character.
        named: A classifier file.

    Returns:
        None if there is none.

    Raises:
        ClassifierError: The file is damaged, or was trained for something else.
    """
    kept = classifier_file(library.identity)
    if named is not None or kept.is_file():
        classifier = load_classifier(named or kept)
        classifier.check(TrainedFor.of(library, character))
        return classifier
    return _shipped(library, character)


def _shipped(library: ReactionLibrary, character: Character) -> Classifier | None:
    if library.name not in SHIPPED:
        return None
    shipped = load_classifier(shipped_classifier(library.name))
    # A user's library may have the name of a shipped one.
    return shipped if shipped.trained_for == TrainedFor.of(library, character) else None


def shipped_classifier(library: str) -> Path:
    """The file of the classifier that is shipped for a library.

    Args:
        library: One of `SHIPPED`.
    """
    return models_folder() / f"{library}.skops"


def _classifier_record(classifier: Classifier, config: ResponseConfig) -> dict[str, Any]:
    record: dict[str, Any] = {
        "classes": len(classifier.classes),
        "features": len(classifier.feature_names),
        "trained_on": classifier.trained_on.samples,
        "dataset": classifier.trained_on.dataset,
    }
    # A classifier predicts what the full search chooses with the settings of its training.
    differing = classifier.differing_settings(settings_record(config))
    return {**record, "other_settings": differing} if differing else record
