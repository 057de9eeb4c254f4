from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning import training
from dynresp.learning.choice_metrics import ChoiceMetrics
from dynresp.learning.holdout import Split
from dynresp.learning.svm_fitting import (
    Parameters,
    TriedParameters,
    best_first,
    fit_pipeline,
    run_in_thread,
)
from dynresp.learning.training import TrainConfig, Trained, train
from dynresp.response.prediction.hit_features import vector_columns
from dynresp.response.response import CARRY_ON
from dynresp.support.errors import UnknownNameError, UsageError

from .conftest import QUICK
from .samples import CHOICES, dataset, quiet


def labelled_as(data: Dataset, label: np.ndarray[Any, Any]) -> Dataset:
    return replace(data, label=label.astype(np.int16))


def test_it_learns_what_there_is_to_learn(trained: Trained) -> None:
    classifier = trained.classifier
    assert classifier.classes == CHOICES
    assert classifier.absent == ()
    for model in ("exact", "reduced"):
        held_out = classifier.facts["models"][model]["held_out"]
        assert held_out["accuracy"] > 0.75
        assert held_out["regret"] < 0.05
    assert len(classifier.exact.offset) == 10
    assert len(classifier.reduced.offset) == 3
    assert classifier.reduced.weights.dtype == np.float32


def test_the_classifier_predicts_as_the_pipeline_does(trained: Trained, hits: Dataset) -> None:
    classifier = trained.classifier
    some = hits.features[hits.label >= 0][:100]
    own = some[:, vector_columns("large", QUICK.slices_s)]
    exact = trained.pipelines["exact"].predict(own)
    assert classifier.rank(some)[:, 0].tolist() == exact.tolist()
    assert classifier.rank(some[3])[0, 0] == exact[3]
    reduced = trained.pipelines["reduced"].predict(own)
    assert np.mean(classifier.rank(some, reduced=True)[:, 0] == reduced) > 0.98


def test_a_light_hit_predicts_to_carry_on(trained: Trained, hits: Dataset) -> None:
    first = trained.classifier.rank(hits.features[hits.graze])[:, 0]
    assert np.mean(first == trained.classifier.classes.index(CARRY_ON)) > 0.9


def test_the_same_samples_in_another_order_train_the_same(trained: Trained, hits: Dataset) -> None:
    order = np.random.default_rng(0).permutation(len(hits))
    again = train(hits.take(order), QUICK, quiet).classifier
    np.testing.assert_array_equal(again.exact.weights, trained.classifier.exact.weights)


def test_what_it_was_trained_on_is_recorded(trained: Trained, hits: Dataset) -> None:
    on, facts = trained.classifier.trained_on, trained.classifier.facts
    missed = int(np.count_nonzero(hits.label < 0))
    usable = hits.index[hits.label >= 0]
    assert on.samples == len(Split(0, 0.1).trained(usable))
    assert (on.dataset, on.count, on.limit, on.held_out) == (
        hits.facts.origin,
        len(hits),
        None,
        0.1,
    )
    assert facts["left_out"] == missed
    assert sum(facts["samples_per_class"].values()) == on.samples
    (tried,) = facts["cross_validation"]["rounds"]
    assert [row["penalty"] for row in tried] == [10.0, 100.0]
    assert "blend_s" not in trained.classifier.settings
    assert trained.classifier.settings["window_s"] == 1 / 3


def test_the_best_parameters_are_tried_again_on_more_samples(
    hits: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "SEARCHED_SAMPLES", 60)
    monkeypatch.setattr(training, "FINALISTS", 1)
    rounds = train(hits, QUICK, quiet).classifier.facts["cross_validation"]["rounds"]
    assert [len(tried) for tried in rounds] == [2, 1]
    assert [tried[0]["samples"] for tried in rounds] == [60, 240]


def test_fewer_samples(hits: Dataset) -> None:
    assert train(hits, replace(QUICK, samples=100), quiet).classifier.trained_on.samples == 100


def test_one_class_for_each_strategy(hits: Dataset) -> None:
    classifier = train(hits, replace(QUICK, grouping="strategies"), quiet).classifier
    assert classifier.classes == ("side_fall", "step_forward_small", CARRY_ON)
    assert classifier.members[1] == ("ahead", "ahead_mirrored")


def test_the_small_vector_has_fewer_features_than_components(hits: Dataset) -> None:
    config = replace(QUICK, vector="small", components=(10, 40, 64))
    classifier = train(hits, config, quiet).classifier
    wide = len(vector_columns("small", QUICK.slices_s))
    assert len(classifier.feature_names) == wide
    tried = classifier.facts["cross_validation"]["rounds"][0]
    assert [row["components"] for row in tried] == [10, 10, wide, wide]
    assert classifier.facts["slices_s"] == [0.0, 0.1]
    assert any("com" in name for name in classifier.feature_names)


def test_nothing_held_out(hits: Dataset) -> None:
    facts = train(hits, replace(QUICK, split=Split(0, 0.0)), quiet).classifier.facts
    assert facts["models"]["exact"]["held_out"] is None


def test_choices_that_never_or_once_occur() -> None:
    data = dataset(300)
    label = data.label.copy()
    label[label == 0] = 1
    label[label == 4] = 5
    label[np.flatnonzero(~Split(0, 0.1).is_held_out(data.index) & (label == 6))[0]] = 4
    classifier = train(labelled_as(data, label), QUICK, quiet).classifier
    assert "left" in classifier.absent
    assert "left" not in classifier.classes
    assert "roll" in classifier.classes


def test_samples_whose_features_are_not_all_there_are_left_out() -> None:
    data = dataset(200)
    features = data.features.copy()
    features[:50, -1] = np.nan
    late = replace(data, features=features)
    assert train(late, QUICK, quiet).classifier.facts["left_out"] == np.sum(data.label < 0)
    whole = train(late, replace(QUICK, slices_s=(0.0, 0.5), vector="large"), quiet).classifier
    # The last feature is of the centre of mass, which the large vector does not hold.
    assert whole.facts["left_out"] == np.sum(data.label < 0)
    features = features.copy()
    features[:50, 0] = np.inf
    damaged = train(replace(data, features=features), QUICK, quiet).classifier
    assert damaged.facts["left_out"] == 50 + np.sum(data.label[50:] < 0)


def test_features_that_never_change() -> None:
    data = dataset(120)
    still = np.where(np.isnan(data.features), np.nan, np.float32(1.0))
    with pytest.raises(UsageError, match="the same features"):
        train(replace(data, features=still), QUICK, quiet)
    some = data.features.copy()
    some[:, ::2] = still[:, ::2]
    classifier = train(replace(data, features=some), QUICK, quiet).classifier
    assert np.isfinite(classifier.exact.weights).all()


def test_too_few_classes_are_refused() -> None:
    data = dataset(60)
    with pytest.raises(UsageError, match="at least two classes"):
        train(labelled_as(data, np.where(data.label < 0, -1, 2)), QUICK, quiet)
    with pytest.raises(UsageError, match="to train on: none"):
        train(labelled_as(data, np.full(60, -1)), QUICK, quiet)


def test_other_features_are_refused() -> None:
    with pytest.raises(UsageError, match="other features"):
        train(dataset(60, feature_names=("a", "b")), QUICK, quiet)


@pytest.mark.parametrize(
    "wrong",
    [
        {"vector": "middling"},
        {"slices_s": (0.05,)},
        {"samples": 1},
        {"penalties": ()},
        {"gamma_factors": (0.0,)},
        {"reduced_components": 0},
    ],
)
def test_settings_that_make_no_sense(wrong: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        TrainConfig(**wrong)


def test_an_unknown_grouping() -> None:
    with pytest.raises(UnknownNameError, match="reactions, strategies"):
        TrainConfig(grouping="colours")


def test_merit_is_regret_among_those_as_accurate_as_the_best() -> None:
    def tried(accuracy: float, regret: float) -> TriedParameters:
        figures = ChoiceMetrics(400, accuracy, 1.0, 1.0, regret, 0.0)
        return TriedParameters(Parameters(1, accuracy, 1.0), figures)

    # The standard error is two per cent.
    items = [tried(0.70, 0.0), tried(0.80, 0.03), tried(0.79, 0.02), tried(0.77, 0.01)]
    order = [item.metrics.accuracy for item in best_first(items)]
    assert order == [0.79, 0.80, 0.77, 0.70]


def test_samples_of_one_class_cannot_be_fitted(rng: np.random.Generator) -> None:
    with pytest.raises(UsageError, match="one class"):
        fit_pipeline(rng.normal(size=(9, 3)), np.zeros(9, int), Parameters(2, 1.0, 1.0))


def test_long_work_is_reported_and_its_errors_are_raised() -> None:
    import time

    reported = []
    assert run_in_thread(lambda: time.sleep(1.2) or 7, lambda: reported.append(1)) == 7
    assert reported

    def fail() -> None:
        raise UsageError("no")

    with pytest.raises(UsageError, match="no"):
        run_in_thread(fail, lambda: None)
