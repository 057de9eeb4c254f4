"""Choices by prediction: against the full search, with every budget, and in any order."""

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Ball, Impact
from dynresp.response.budget import chooser_for
from dynresp.response.hit_simulation import HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.prediction.classifier import (
    Classifier,
    ClassifierError,
    TrainedFor,
    TrainedOn,
)
from dynresp.response.prediction.classifier_choice import ClassifierChooser
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import FEATURE_NAMES, SLICES_S, vector_columns
from dynresp.response.responder import Responder
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.search.carry_on import align_base_motions, search_base_motions
from dynresp.response.search.hit_labels import HitLabeller, HitLabels
from dynresp.support.errors import UsageError
from tests.response.samples import FLUFF, WatchedCrowd, same_response

CONFIG = ResponseConfig()
HITS = 90


@pytest.fixture(scope="module")
def thrown(base: Motion) -> list[tuple[Motion, Impact]]:
    rng = np.random.default_rng(5)
    return [
        (
            base,
            Ball(
                rng.uniform(1.0, 2.4),
                speed=rng.uniform(4.0, 14.0),
                mass=rng.uniform(2.0, 8.0),
                from_deg=rng.uniform(0.0, 360.0),
                height=rng.uniform(0.4, 1.6),
            ),
        )
        for _ in range(HITS)
    ]


@pytest.fixture(scope="module")
def labelled(
    character: Character, library: ReactionLibrary, thrown: list[tuple[Motion, Impact]]
) -> HitLabels:
    return HitLabeller(character, library, CONFIG).label(thrown)


@pytest.fixture(scope="module")
def classifier(character: Character, library: ReactionLibrary, labelled: HitLabels) -> Classifier:
    """Trained on the same hits that it then predicts."""
    from sklearn.decomposition import PCA
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    columns = vector_columns("large", SLICES_S)
    names = [*(reaction.name for reaction in library.reactions), CARRY_ON]
    hit = labelled.label >= 0
    present, encoded = np.unique(labelled.label[hit], return_inverse=True)
    pipeline = make_pipeline(
        StandardScaler(),
        PCA(20, svd_solver="full"),
        SVC(kernel="poly", degree=2, coef0=1.0, C=1000.0, break_ties=True),
    )
    pipeline.fit(labelled.features[hit][:, columns], encoded)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    classes = tuple(names[label] for label in present)
    return Classifier(
        grouping="reactions",
        classes=classes,
        members=tuple((name,) for name in classes),
        absent=tuple(name for name in names if name not in classes),
        feature_names=tuple(FEATURE_NAMES[column] for column in columns),
        trained_for=TrainedFor.of(library, character),
        trained_on=TrainedOn("made in the test", HITS, int(hit.sum()), None, 0, 0.0),
        settings={},
        exact=predictor,
        reduced=predictor.single_precision(),
        facts={},
    )


def _responses(
    character: Character,
    library: ReactionLibrary,
    hits: list[tuple[Motion, Impact]],
    chooser: ClassifierChooser | None,
) -> list[Response]:
    return Responder(character, library, CONFIG, threads=1, chooser=chooser).respond(hits)


@pytest.mark.slow
def test_on_its_training_hits_it_chooses_as_the_full_search(
    character: Character,
    library: ReactionLibrary,
    thrown: list[tuple[Motion, Impact]],
    classifier: Classifier,
) -> None:
    chooser = ClassifierChooser(character, library, CONFIG, classifier)
    ours = _responses(character, library, thrown, chooser)
    searched = _responses(character, library, thrown, None)
    same = [a.choice == b.choice for a, b in zip(ours, searched, strict=True)]
    assert np.mean(same) > 0.95
    assert len({response.choice for response in ours}) >= 3
    for mine, other in zip(ours, searched, strict=True):
        if mine.choice is None or mine.choice != other.choice:
            continue
        assert mine.error is not None
        assert other.error is not None
        # Between frames it can fit better than the full search, which compares whole frames.
        assert mine.error < 1.1 * other.error + 0.01
        assert mine.graze == other.graze


@pytest.mark.slow
def test_two_aligned_choices_are_no_worse_than_one(
    character: Character,
    library: ReactionLibrary,
    thrown: list[tuple[Motion, Impact]],
    classifier: Classifier,
) -> None:
    one, two = (
        _responses(
            character,
            library,
            thrown,
            ClassifierChooser(character, library, CONFIG, classifier, best=best),
        )
        for best in (1, 2)
    )
    for a, b in zip(one, two, strict=True):
        if a.choice is None or b.choice is None or a.graze:
            continue
        assert set(a.errors) <= set(b.errors)
        # The base motion, and one or two reactions.
        assert (len(a.errors), len(b.errors)) == (2, 3)
        least = min(b.errors, key=lambda name: b.errors[name])
        assert b.choice == least or b.errors[CARRY_ON] > CONFIG.carry_on_max_error


def test_each_choice_is_the_same_alone(
    character: Character,
    library: ReactionLibrary,
    thrown: list[tuple[Motion, Impact]],
    classifier: Classifier,
) -> None:
    chooser = ClassifierChooser(character, library, CONFIG, classifier, best=2)
    together = _responses(character, library, thrown[:12], chooser)
    for hit, response in zip(thrown[:12], together, strict=True):
        same_response(_responses(character, library, [hit], chooser)[0], response)


def test_a_strategy_has_all_its_reactions_aligned(
    character: Character,
    library: ReactionLibrary,
    thrown: list[tuple[Motion, Impact]],
    labelled: HitLabels,
    classifier: Classifier,
) -> None:
    """Only two classes: no reaction, and all reactions."""
    import dataclasses

    from sklearn.decomposition import PCA
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    names = tuple(reaction.name for reaction in library.reactions)
    hit = labelled.label >= 0
    stays = (labelled.label[hit] == len(names)).astype(int)
    pipeline = make_pipeline(
        StandardScaler(),
        PCA(10, svd_solver="full"),
        SVC(kernel="poly", degree=2, coef0=1.0, C=1000.0, break_ties=True),
    ).fit(labelled.features[hit][:, classifier.columns], stays)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    grouped = dataclasses.replace(
        classifier,
        grouping="strategies",
        classes=("reacts", CARRY_ON),
        members=(names, (CARRY_ON,)),
        absent=(),
        exact=predictor,
        reduced=predictor,
    )
    chooser = ClassifierChooser(character, library, CONFIG, grouped)
    seen = 0
    for response in _responses(character, library, thrown, chooser):
        if response.choice in names:
            assert set(response.errors) == {*names, CARRY_ON}
            assert response.errors[str(response.choice)] == min(
                error for name, error in response.errors.items() if name != CARRY_ON
            )
            seen += 1
    assert seen > 5


def test_a_graze_gets_no_reaction_whatever_is_predicted(
    character: Character, library: ReactionLibrary, base: Motion, classifier: Classifier
) -> None:
    chooser = ClassifierChooser(character, library, CONFIG, classifier)
    response = _responses(character, library, [(base, Ball(1.0, **FLUFF))], chooser)[0]
    assert response.graze
    assert response.choice == CARRY_ON


def test_a_character_at_run_time_makes_the_same_choices(
    character: Character,
    library: ReactionLibrary,
    thrown: list[tuple[Motion, Impact]],
    classifier: Classifier,
) -> None:
    chooser = ClassifierChooser(character, library, CONFIG, classifier, best=2)
    expected = _responses(character, library, thrown[:8], chooser)
    bases = [base for base, _ in thrown[:8]]
    crowd = WatchedCrowd(character, library, bases, CONFIG, chooser, threads=1)
    for responder, (_, impact) in zip(crowd.responders, thrown[:8], strict=True):
        responder.hit(impact)
    longest = max(len(response.motion) for response in expected)
    for _ in range(longest):
        crowd.advance()
    for i, response in enumerate(expected):
        shown = crowd.shown(i).poses
        if response.choice is not None:
            np.testing.assert_allclose(
                shown[: response.end], response.motion.poses[: response.end], atol=1e-12
            )


def test_budgets(character: Character, library: ReactionLibrary, classifier: Classifier) -> None:
    for budget in ("fast", "better", "best"):
        chooser_for(budget, character, library, CONFIG, classifier)
    chooser_for("best", character, library, CONFIG)
    with pytest.raises(UsageError, match="'fast' needs a trained classifier"):
        chooser_for("fast", character, library, CONFIG)
    with pytest.raises(UsageError, match="one of fast, better, best, got 'cheap'"):
        chooser_for("cheap", character, library, CONFIG)


def test_a_classifier_for_something_else_is_refused(
    character: Character, library: ReactionLibrary, classifier: Classifier
) -> None:
    import dataclasses

    other = dataclasses.replace(classifier, trained_for=TrainedFor("other", "x", "y"))
    with pytest.raises(ClassifierError, match="another character"):
        ClassifierChooser(character, library, CONFIG, other)


def test_the_base_motions_fit_is_that_of_the_full_search(
    character: Character, thrown: list[tuple[Motion, Impact]]
) -> None:
    """Windows cut for a search and the alignment's kernel give the same numbers."""
    (batch,) = HitStage(character, CONFIG, 1).batches(thrown[:30])
    traces = batch.simulation.look_ahead(CONFIG.horizon_s)
    hits = look_ahead_of(character, CONFIG, batch.bases, batch.prepared, traces)
    slow = search_base_motions(character, CONFIG, hits)
    fast = align_base_motions(character, CONFIG, hits)
    assert len(slow) == len(hits) > 20
    for a, b in zip(slow, fast, strict=True):
        assert a.error == pytest.approx(b.error, rel=1e-4, abs=1e-4)
        assert (a.exit, a.entry) == (b.exit, b.entry)
