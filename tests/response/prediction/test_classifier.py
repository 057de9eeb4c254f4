import io
import json
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dynresp.response.prediction.classifier import (
    Classifier,
    ClassifierError,
    TrainedFor,
    TrainedOn,
)
from dynresp.response.prediction.classifier_file import (
    load_classifier,
    load_pipelines,
    save_classifier,
)
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import FEATURE_NAMES
from dynresp.support.errors import DynrespError, UsageError

CLASSES = ("left", "right", "carry_on")
TAKEN = FEATURE_NAMES[3:9]


def pipeline(components: int) -> Any:
    from sklearn.decomposition import PCA
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    rng = np.random.default_rng(4)
    features, labels = rng.normal(size=(60, len(TAKEN))), rng.integers(3, size=60)
    machine = SVC(kernel="poly", degree=2, coef0=1.0, gamma=0.3, break_ties=True)
    steps = [("scale", StandardScaler()), ("components", PCA(components)), ("machine", machine)]
    return Pipeline(steps).fit(features, labels)


@pytest.fixture(scope="module")
def pipelines() -> dict[str, Any]:
    return {"exact": pipeline(5), "reduced": pipeline(2)}


@pytest.fixture(scope="module")
def classifier(pipelines: dict[str, Any]) -> Classifier:
    return Classifier(
        grouping="reactions",
        classes=CLASSES,
        members=tuple((name,) for name in CLASSES),
        absent=("roll",),
        feature_names=TAKEN,
        trained_for=TrainedFor("tiny", "a" * 16, "b" * 16),
        trained_on=TrainedOn("c" * 32, 100, 60, None, 0, 0.1),
        settings={"window_s": 0.3, "fixed": {"weights": [1.0, 2.0]}},
        exact=PairwiseQuadratic.from_pipeline(pipelines["exact"]),
        reduced=PairwiseQuadratic.from_pipeline(pipelines["reduced"]).single_precision(),
        facts={"vector": "large", "slices_s": [0.0], "samples_per_class": {"left": 60}},
    )


@pytest.fixture(scope="module")
def file(
    classifier: Classifier, pipelines: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("classifier") / "made" / "model.skops"
    save_classifier(path, classifier, pipelines)
    return path


# -- what it predicts -------------------------------------------------------------------------


def test_it_selects_its_features_by_name(classifier: Classifier, pipelines: Any) -> None:
    rng = np.random.default_rng(0)
    features = np.full((40, len(FEATURE_NAMES)), np.nan, dtype=np.float32)
    features[:, 3:9] = rng.normal(size=(40, 6))
    ranked = classifier.rank(features, 2)
    assert ranked[:, 0].tolist() == pipelines["exact"].predict(features[:, 3:9]).tolist()
    assert classifier.rank(features[7], 2).tolist() == ranked[7:8].tolist()
    reduced = pipelines["reduced"].predict(features[:, 3:9])
    assert classifier.rank(features, reduced=True)[:, 0].tolist() == reduced.tolist()


@pytest.mark.parametrize("shape", [(5,), (2, 3), (1, 1, len(FEATURE_NAMES)), ()])
def test_features_of_another_shape(classifier: Classifier, shape: tuple[int, ...]) -> None:
    with pytest.raises(UsageError, match="expected"):
        classifier.rank(np.zeros(shape))


def test_features_that_are_not_finite(classifier: Classifier) -> None:
    with pytest.raises(UsageError, match="NaN"):
        classifier.rank(np.full((1, len(FEATURE_NAMES)), np.nan))


# -- what it is trained for --------------------------------------------------------------------


def test_it_is_refused_for_anything_else(classifier: Classifier) -> None:
    own = classifier.trained_for
    classifier.check(own)
    # The name does not count: a library file may be moved.
    classifier.check(replace(own, library_name="renamed"))
    with pytest.raises(ClassifierError, match=rf"'tiny' \({'a' * 16}\), not for 'core'.*\(dddd\)"):
        classifier.check(replace(own, library_name="core", library="dddd"))
    with pytest.raises(ClassifierError, match=rf"{'b' * 16}.*\(eeee\).*dynresp train"):
        classifier.check(replace(own, character="eeee"))


def test_settings_that_differ(classifier: Classifier) -> None:
    same = {"window_s": 0.3, "fixed": {"weights": (1.0, 2.0)}, "blend_s": 1.0}
    assert classifier.differing_settings(same) == []
    assert classifier.differing_settings({**same, "window_s": 0.2}) == ["window_s"]
    assert classifier.differing_settings({"window_s": 0.3}) == ["fixed"]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"grouping": "colours"}, "grouping"),
        ({"members": (("left",),)}, "members of other classes"),
        ({"members": (("left",), (), ("carry_on",))}, "without members"),
        ({"classes": ("left", "left", "carry_on")}, "a class twice"),
        ({"members": (("left",), ("left",), ("carry_on",))}, "in two classes"),
        ({"absent": ("left",)}, "present and absent"),
        ({"classes": CLASSES[:2], "members": (("a",), ("b",))}, "predictor of other classes"),
        ({"feature_names": FEATURE_NAMES[:5]}, "predictor of other features"),
        ({"feature_names": ("0.0/tail/position_x",)}, "'0.0/tail/position_x'"),
        ({"feature_names": ()}, "no feature"),
    ],
)
def test_parts_that_do_not_fit(classifier: Classifier, changed: Any, message: str) -> None:
    with pytest.raises(ClassifierError, match=message):
        replace(classifier, **changed)


# -- its file ---------------------------------------------------------------------------------


def test_what_is_written_is_read(classifier: Classifier, file: Path) -> None:
    found = load_classifier(file)
    for name in ("grouping", "classes", "members", "absent", "feature_names", "trained_for",
                 "trained_on", "settings", "facts"):  # fmt: skip
        assert getattr(found, name) == getattr(classifier, name)
    for model in ("exact", "reduced"):
        for array in ("projection", "offset", "weights"):
            ours, theirs = getattr(found, model), getattr(classifier, model)
            np.testing.assert_array_equal(getattr(ours, array), getattr(theirs, array))
            assert getattr(ours, array).dtype == getattr(theirs, array).dtype


def test_the_pipelines_are_read_and_skops_reads_them_too(file: Path, pipelines: Any) -> None:
    import skops.io

    features = np.random.default_rng(2).normal(size=(30, 6))
    for found in (load_pipelines(file), skops.io.load(file)):
        assert found.keys() == {"exact", "reduced"}
        for model, own in pipelines.items():
            assert found[model].predict(features).tolist() == own.predict(features).tolist()


def test_numpy_reads_the_arrays(file: Path, classifier: Classifier) -> None:
    with np.load(file, allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["exact.weights"], classifier.exact.weights)


def test_reading_needs_neither_skops_nor_scikit_learn(file: Path) -> None:
    code = (
        "import sys; from dynresp.response.prediction.classifier_file import load_classifier;"
        f"c = load_classifier({str(file)!r}); c.rank([0.0] * {len(FEATURE_NAMES)});"
        "print([m for m in ('skops', 'sklearn', 'pickle5') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def changed(file: Path, out: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    """The file with other members."""
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return out


def changed_key(key: str, value: Any) -> Callable[[dict[str, bytes]], None]:
    """A change of the file's description; None removes the key."""

    def change(members: dict[str, bytes]) -> None:
        about = json.loads(members["classifier.json"])
        about[key] = value
        if value is None:
            del about[key]
        members["classifier.json"] = json.dumps(about).encode()

    return change


def rewritten(name: str, array: np.ndarray[Any, Any]) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        data = io.BytesIO()
        np.lib.format.write_array(data, array, version=(1, 0), allow_pickle=True)
        members[name] = data.getvalue()

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.pop("classifier.json"), "not a classifier of dynresp"),
        (changed_key("format", "a cake"), "not a classifier of dynresp"),
        (changed_key("format_version", 99), "format version 99"),
        (changed_key("features_identity", "0"), "other features"),
        (changed_key("classes", None), "damaged"),
        (changed_key("classes", ["one"]), "1 classes"),
        (changed_key("classes", ["a", "b", 3]), "expected text"),
        (changed_key("classes", ["a", "b", "c", "d"]), "expected"),
        (changed_key("components", {"exact": 10**9, "reduced": 2}), "components"),
        (changed_key("components", {"exact": True, "reduced": 2}), "components"),
        (changed_key("features", ["nonsense"] * 6), "nonsense"),
        (changed_key("members", [["left"], ["right"], ["right"]]), "two classes"),
        (changed_key("trained_on", {"dataset": "x"}), "damaged"),
        (changed_key("trained_for", []), "damaged"),
        (changed_key("settings", [1]), "settings"),
        (changed_key("facts", {"vector": "large"}), "damaged"),
        (lambda m: m.pop("exact.weights.npy"), "damaged"),
        (rewritten("exact.offset.npy", np.zeros(4)), "exact.offset.npy"),
        (rewritten("exact.offset.npy", np.zeros(5, np.float32)), "exact.offset.npy"),
        (rewritten("exact.offset.npy", np.zeros(5, ">f8")), "exact.offset.npy"),
        (rewritten("exact.offset.npy", np.full(5, np.nan)), "NaN"),
        (rewritten("exact.offset.npy", np.array([{}] * 5)), "exact.offset.npy"),
        (lambda m: m.update({"exact.offset.npy": m["exact.offset.npy"] + b"x"}), "another size"),
        (lambda m: m.update({"exact.offset.npy": m["exact.offset.npy"][:-1]}), "needs"),
        (lambda m: m.update({"exact.offset.npy": b""}), "damaged"),
        (lambda m: m.update({"classifier.json": b"[" * 100_000}), "damaged"),
        (lambda m: m.update({"classifier.json": b"\xff"}), "damaged"),
    ],
)
def test_the_error_says_what_is_wrong_with_a_file(
    file: Path, tmp_path: Path, change: Callable[[dict[str, bytes]], None], message: str
) -> None:
    wrong = changed(file, tmp_path / "wrong.skops", change)
    with pytest.raises(ClassifierError, match=message) as caught:
        load_classifier(wrong)
    assert str(wrong) in str(caught.value)


def test_files_that_are_not_classifiers(tmp_path: Path) -> None:
    with pytest.raises(ClassifierError, match="no such file"):
        load_classifier(tmp_path / "gone.skops")
    with pytest.raises(ClassifierError, match="is a folder"):
        load_classifier(tmp_path)
    for name, data in (("empty", b""), ("text", b"hello, this is no zip file at all")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ClassifierError, match="cut short"):
            load_classifier(tmp_path / name)


def untrusted(members: dict[str, bytes]) -> None:
    """An object that skops would refuse by itself."""
    schema = json.loads(members["schema.json"])
    schema["content"]["exact"]["__class__"] = "system"
    schema["content"]["exact"]["__module__"] = "os"
    members["schema.json"] = json.dumps(schema).encode()


def needless(members: dict[str, bytes]) -> None:
    """An object that skops trusts, but that does not belong to a classifier."""
    schema = json.loads(members["schema.json"])
    schema["content"]["exact"]["__class__"] = "DummyClassifier"
    schema["content"]["exact"]["__module__"] = "sklearn.dummy"
    members["schema.json"] = json.dumps(schema).encode()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (untrusted, r"os\.system"),
        (needless, r"sklearn\.dummy\.DummyClassifier"),
        (lambda m: m.pop("schema.json"), "compiled models alone"),
        (lambda m: m.update({"schema.json": b"{}"}), "damaged"),
        (rewritten("exact.offset.npy", np.ones(5)), "another pipeline"),
    ],
)
def test_pipelines_that_are_not_trusted(
    file: Path, tmp_path: Path, change: Callable[[dict[str, bytes]], None], message: str
) -> None:
    wrong = changed(file, tmp_path / "wrong.skops", change)
    with pytest.raises(ClassifierError, match=message):
        load_pipelines(wrong)


def what_comes_of(read: Callable[[Path], Any], path: Path) -> Any:
    """What is read, or the only error that may be raised."""
    try:
        return read(path)
    except ClassifierError as error:
        return error


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_file_is_refused_or_means_the_same(
    file: Path, tmp_path: Path, classifier: Classifier, data: st.DataObject
) -> None:
    whole = bytearray(file.read_bytes())
    if data.draw(st.booleans()):
        del whole[data.draw(st.integers(0, len(whole) - 1)) :]
    for _ in range(data.draw(st.integers(1, 4))):
        if whole:
            whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "damaged.skops"
    path.write_bytes(whole)
    found = what_comes_of(load_classifier, path)
    if isinstance(found, ClassifierError):
        assert str(path) in str(found)
    else:
        assert found.classes == classifier.classes
        np.testing.assert_array_equal(found.exact.weights, classifier.exact.weights)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32 - 1))
def test_damaged_pipelines_raise_nothing_else(file: Path, tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    whole = bytearray(file.read_bytes())
    for place in rng.integers(len(whole), size=3):
        whole[place] = rng.integers(256)
    path = tmp_path / "damaged.skops"
    path.write_bytes(whole)
    found = what_comes_of(load_pipelines, path)
    if isinstance(found, ClassifierError):
        assert str(path) in str(found)


def test_a_folder_that_cannot_be_written(
    classifier: Classifier, pipelines: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(DynrespError, match="cannot write"):
        save_classifier(tmp_path / "taken" / "model.skops", classifier, pipelines)
