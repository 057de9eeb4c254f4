import json
from pathlib import Path

import numpy as np
import pytest

from dynresp.response.prediction.classifier import Classifier, TrainedFor, TrainedOn
from dynresp.response.prediction.classifier_file import save_classifier
from dynresp.response.prediction.hit_features import FEATURE_NAMES
from dynresp.support.errors import DynrespError
from studies.benchmarks import prediction_speed as select


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """A problem that is solved and measured in a moment."""
    for name, value in {"SAMPLES": 300, "CLASSES": 4, "BATCH": 50, "_ROUNDS": 2}.items():
        monkeypatch.setattr(select, name, value)
    monkeypatch.setattr(select, "COMPONENTS", {"exact": 8, "reduced": 4})


def test_the_report_is_whole() -> None:
    result = select.run()
    content = json.loads(json.dumps(result.to_json()))
    for key in ("name", "value", "unit", "baseline", "ratio", "machine", "agreement"):
        assert key in content
    for model in ("exact", "reduced"):
        for how in ("sklearn_votes", "batch", "sklearn_batch"):
            assert content[f"{model}_{how}"] > 0.0
    assert content["exact_alone"] > 0.0
    assert 0.5 < content["agreement"] <= 1.0
    assert content["ratio"] == pytest.approx(content["baseline"] / content["value"])


def test_the_problem_depends_on_the_seed_alone() -> None:
    one, same, other = select.synthetic(1), select.synthetic(1), select.synthetic(2)
    np.testing.assert_array_equal(one.rows, same.rows)
    np.testing.assert_allclose(one.compiled["exact"].weights, same.compiled["exact"].weights)
    assert not np.array_equal(one.rows, other.rows)
    assert one.compiled["reduced"].weights.dtype == np.float32


def test_times_are_refused_where_the_sides_disagree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        select.PairwiseQuadratic,
        "rank",
        lambda self, rows, best=1: np.zeros((len(rows), 1), dtype=np.int64),
    )
    with pytest.raises(DynrespError, match="the exact predictor chooses as scikit-learn does for"):
        select.run()


def test_a_trained_classifier(tmp_path: Path) -> None:
    subject = select.synthetic(0)
    names = tuple("abcd")
    assert subject.rows.shape[1] == 432
    classifier = Classifier(
        grouping="reactions",
        classes=names,
        members=tuple((name,) for name in names),
        absent=(),
        feature_names=FEATURE_NAMES[:432],
        trained_for=TrainedFor("made", "0", "0"),
        trained_on=TrainedOn("0", 300, 300, None, 0, 0.0),
        settings={},
        exact=subject.compiled["exact"],
        reduced=subject.compiled["reduced"],
        facts={"vector": "large", "slices_s": [0.0], "samples_per_class": {}},
    )
    path = tmp_path / "made.skops"
    save_classifier(path, classifier, subject.pipelines)
    content = select.run(model=path).to_json()
    assert content["classes"] == 4
    assert content["features"] == 432
    assert content["exact_components"] == 8
