import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning.evaluation import evaluate
from dynresp.learning.evaluation_files import write_report
from dynresp.learning.holdout import Split
from dynresp.learning.training import Trained, train
from dynresp.response.prediction.classifier import ClassifierError
from dynresp.results.result_folder import CONFUSION, EVALUATION, PER_STRATEGY, WRITTEN
from dynresp.support.errors import UsageError

from .conftest import QUICK
from .samples import CHOICES, SETTINGS, dataset, quiet

OTHER_PLAN = {"plan": {"name": "Another"}, "impact": [{"kind": "push"}]}


def test_figures_of_what_was_held_out(trained: Trained, hits: Dataset) -> None:
    content = evaluate(trained.classifier, hits, quiet)
    held_out = Split(0, 0.1).is_held_out(hits.index) & (hits.label >= 0)
    assert content["samples"] == np.count_nonzero(held_out)
    assert content["held_out_only"]
    # The same figures as training showed.
    shown = trained.classifier.facts["models"]["exact"]["held_out"]
    for name in ("accuracy", "top2_accuracy", "within_1_percent", "regret", "regret_top2"):
        assert content[name] == shown[name]
        assert content["alone"][name] == shown["alone"][name]
    assert content["mirrors_as_one"]["accuracy"] >= content["accuracy"]
    assert content["strategy_accuracy"] >= content["accuracy"]
    assert content["left_out"]["nothing_hit"] == np.count_nonzero(hits.label < 0)


def test_the_tables_add_up(trained: Trained, hits: Dataset) -> None:
    content = evaluate(trained.classifier, hits, quiet)
    counts = np.array(content["confusion"]["counts"])
    assert content["confusion"]["classes"] == list(CHOICES)
    assert counts.sum() == content["samples"]
    assert counts.trace() == round(content["accuracy"] * content["samples"])
    rows = content["per_strategy"].values()
    assert sum(row["samples"] for row in rows) == content["samples"]
    right = sum(row["accuracy"] * row["samples"] for row in rows)
    assert right == pytest.approx(content["accuracy"] * content["samples"])


def test_it_beats_chance_and_latency_is_measured(trained: Trained, hits: Dataset) -> None:
    content = evaluate(trained.classifier, hits, quiet)
    baselines = content["baselines"]
    assert baselines["random"]["accuracy"] < baselines["nearest_neighbours"]["accuracy"]
    assert baselines["most_frequent"]["accuracy"] < content["accuracy"]
    for model in ("exact", "reduced"):
        took = content["latency_us"][model]
        assert 0.0 < took["in_batch"] <= took["alone"] < 10_000.0


def test_of_another_dataset_all_samples_count(trained: Trained) -> None:
    other = dataset(150, seed=5, spec=OTHER_PLAN)
    content = evaluate(trained.classifier, other, quiet)
    assert content["samples"] == np.count_nonzero(other.label >= 0)
    assert not content["held_out_only"]
    # The samples to look among are not here.
    assert content["baselines"]["nearest_neighbours"] is None


def test_a_dataset_that_has_grown_since(trained: Trained) -> None:
    grown = dataset(800)
    content = evaluate(trained.classifier, grown, quiet)
    held_out = Split(0, 0.1).is_held_out(grown.index) & (grown.label >= 0)
    assert content["samples"] == np.count_nonzero(held_out)


def test_the_same_samples_in_other_shards_are_not_judged_as_if_unseen(trained: Trained) -> None:
    other = dataset(400, identity="of other shards", shard_size=20, versions={"numpy": "9"})
    content = evaluate(trained.classifier, other, quiet)
    held_out = Split(0, 0.1).is_held_out(other.index) & (other.label >= 0)
    assert content["samples"] == np.count_nonzero(held_out)


def test_nothing_to_judge_by(hits: Dataset) -> None:
    all_of_it = train(hits, replace(QUICK, split=Split(0, 0.0)), quiet).classifier
    with pytest.raises(UsageError, match="--held-out"):
        evaluate(all_of_it, hits, quiet)
    missed = replace(dataset(20, spec=OTHER_PLAN), label=np.full(20, -1, np.int16))
    with pytest.raises(UsageError, match="none of the 20"):
        evaluate(all_of_it, missed, quiet)


def test_another_library_or_character_is_refused(trained: Trained) -> None:
    other = dataset(40, library="other", library_identity="0" * 16)
    with pytest.raises(ClassifierError, match=r"'tiny'.*not for 'other'"):
        evaluate(trained.classifier, other, quiet)
    with pytest.raises(ClassifierError, match="another character"):
        evaluate(trained.classifier, dataset(40, character_identity="0" * 16), quiet)


def test_other_settings_are_reported(trained: Trained, hits: Dataset) -> None:
    assert evaluate(trained.classifier, hits, quiet)["differing_settings"] == []
    changed = {**SETTINGS, "window_s": 0.2, "blend_s": 0.1}
    content = evaluate(trained.classifier, dataset(400, settings=changed), quiet)
    assert content["differing_settings"] == ["window_s"]


def test_a_choice_the_model_never_saw_is_wrong_but_costs_what_it_costs(hits: Dataset) -> None:
    label = np.where(hits.label == 0, 1, hits.label).astype(np.int16)
    blind = train(replace(hits, label=label), QUICK, quiet).classifier
    content = evaluate(blind, hits, quiet)
    assert content["model"]["absent"] == ["left"]
    row = CHOICES.index("left")
    counts = np.array(content["confusion"]["counts"])
    assert counts[:, row].sum() == 0
    assert counts[row].sum() == content["samples"] - np.delete(counts, row, axis=0).sum()


def test_strategies_are_judged_by_their_best_member(hits: Dataset) -> None:
    classifier = train(hits, replace(QUICK, grouping="strategies"), quiet).classifier
    content = evaluate(classifier, hits, quiet)
    assert content["confusion"]["classes"] == ["side_fall", "step_forward_small", "carry_on"]
    assert content["mirrors_as_one"]["accuracy"] == content["accuracy"]
    assert content["strategy_accuracy"] == content["accuracy"]


def test_the_folder_of_an_evaluation(trained: Trained, hits: Dataset, tmp_path: Path) -> None:
    content = evaluate(trained.classifier, hits, quiet)
    files = write_report(tmp_path / "out", content)["files"]
    assert files == dict.fromkeys([PER_STRATEGY, CONFUSION], WRITTEN)
    reported = json.loads((tmp_path / "out" / EVALUATION).read_text(encoding="utf-8"))
    assert reported["accuracy"] == pytest.approx(content["accuracy"], abs=1e-6)
    with (tmp_path / "out" / PER_STRATEGY).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["strategy"] for row in rows] == list(content["per_strategy"])
    assert (tmp_path / "out" / CONFUSION).read_bytes().startswith(b"\x89PNG")
