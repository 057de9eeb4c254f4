"""Who chooses in an experiment: the shipped, the user's own or a given classifier, or none."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from dynresp.experiments.experiment_reader import parse_experiment
from dynresp.experiments.runner import Run, prepare_run
from dynresp.motion.character import Character
from dynresp.motion.reactions.reaction_library import (
    BUILTIN,
    ReactionLibrary,
    builtin_library,
    load_library,
)
from dynresp.response.chooser import SHIPPED, find_classifier, shipped_classifier
from dynresp.response.prediction.classifier import ClassifierError
from dynresp.response.prediction.classifier_choice import ClassifierChooser
from dynresp.response.prediction.classifier_file import load_classifier, load_pipelines
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.response_settings import settings_record
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.support.errors import SpecError
from dynresp.support.paths import classifier_file

WALK: dict[str, Any] = {
    "experiment": {"name": "A test"},
    "base": {"motion": "builtin:walk"},
    "impact": [{"kind": "ball", "time_s": 2.0}],
    "library": {"which": "builtin"},
}


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def builtin(character: Character) -> ReactionLibrary:
    return builtin_library(character)


def prepared(folder: Path, **tables: Any) -> Run:
    return prepare_run(parse_experiment({**WALK, **tables}), folder, threads=1)


def test_the_shipped_classifier_is_for_the_built_in_library(
    character: Character, builtin: ReactionLibrary
) -> None:
    classifier = find_classifier(builtin, character)
    assert classifier is not None
    names = {name for own in classifier.members for name in own}
    assert names | set(classifier.absent) == {r.name for r in builtin.reactions} | {CARRY_ON}
    # Trained with the default settings.
    assert classifier.differing_settings(settings_record(ResponseConfig())) == []


@pytest.mark.mocap
@pytest.mark.parametrize("which", [name for name in SHIPPED if name != BUILTIN])
def test_the_shipped_classifiers_are_for_the_recorded_libraries(
    character: Character, which: str
) -> None:
    library = load_library(which, character=character)
    classifier = find_classifier(library, character)
    assert classifier is not None
    names = {name for own in classifier.members for name in own}
    assert names | set(classifier.absent) == {r.name for r in library.reactions} | {CARRY_ON}


def test_the_classifier_chooses_by_default(tmp_path: Path) -> None:
    run = prepared(tmp_path)
    assert isinstance(run.responder.chooser, ClassifierChooser)
    assert run.record()["choosing"]["budget"] == "fast"
    (answer,) = run.results(range(1), lambda *progress: None)
    # The base motion and the reaction that was predicted.
    assert len(answer.response.errors) == 2
    assert answer.response.choice in answer.response.errors


def test_the_full_search_chooses_with_the_budget_best(tmp_path: Path) -> None:
    run = prepared(tmp_path, choice={"budget": "best"})
    assert isinstance(run.responder.chooser, FullSearchChooser)
    assert run.record()["choosing"] == {"budget": "best"}


def test_the_full_search_chooses_if_there_is_no_classifier(
    tmp_path: Path, character: Character
) -> None:
    from tests.experiments.samples import write_world

    file = write_world(tmp_path, character)
    from dynresp.experiments.experiment_reader import read_experiment

    run = prepare_run(read_experiment(file), tmp_path, tmp_path / "motions", threads=1)
    assert isinstance(run.responder.chooser, FullSearchChooser)
    assert run.record()["choosing"] == {"budget": "best", "instead_of": "fast"}


def test_the_users_own_classifier_comes_before_the_shipped_one(
    tmp_path: Path, builtin: ReactionLibrary, character: Character
) -> None:
    kept = classifier_file(builtin.identity)
    kept.parent.mkdir(parents=True)
    kept.write_bytes(b"damaged")
    # It is damaged: the shipped one is used, and the record says so.
    about = prepared(tmp_path).record()["choosing"]
    assert str(kept) in about["passed_over"]
    assert about["budget"] == "fast"
    assert about["classifier"]["trained_on"] > 4000
    kept.write_bytes(shipped_classifier(BUILTIN).read_bytes())
    assert find_classifier(builtin, character) is not None


def test_a_given_classifier_must_exist_and_fit(tmp_path: Path, character: Character) -> None:
    with pytest.raises(ClassifierError, match=r"gone\.skops: no such file"):
        prepared(tmp_path, choice={"classifier": "gone.skops"})
    (tmp_path / "mine.skops").write_bytes(shipped_classifier(BUILTIN).read_bytes())
    run = prepared(tmp_path, choice={"classifier": "mine.skops", "budget": "better"})
    assert run.record()["choosing"]["budget"] == "better"
    other = dataclasses.replace(builtin_library(character), identity="another", name="another")
    with pytest.raises(ClassifierError, match="trained for the library 'builtin'"):
        find_classifier(other, character, tmp_path / "mine.skops")
    # The shipped one is not used where another library has its name.
    assert find_classifier(dataclasses.replace(other, name=BUILTIN), character) is None


def test_the_full_search_takes_no_classifier(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no classifier"):
        prepared(tmp_path, choice={"classifier": "gone.skops", "budget": "best"})


def test_settings_other_than_in_training_are_recorded(tmp_path: Path) -> None:
    run = prepared(tmp_path, settings={"window_s": 0.2})
    assert run.record()["choosing"]["classifier"]["other_settings"] == ["window_s"]


def test_the_shipped_file_reads_without_scikit_learn() -> None:
    import subprocess
    import sys

    code = (
        "import sys; from dynresp.response.prediction.classifier_file import load_classifier; "
        f"load_classifier({str(shipped_classifier(BUILTIN))!r}); "
        "print([name for name in ('sklearn', 'skops') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_shipped_classifiers_contain_no_training_samples() -> None:
    """Support vectors would be samples of recorded motion."""
    for name in SHIPPED:
        assert load_classifier(shipped_classifier(name)).trained_on.samples > 4000
        with pytest.raises(ClassifierError, match="compiled models alone"):
            load_pipelines(shipped_classifier(name))
