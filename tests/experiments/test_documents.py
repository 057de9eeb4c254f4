"""The experiments that the documents show are right."""

import re
import tomllib
from pathlib import Path

import pytest

from dynresp.experiments.experiment_reader import parse_experiment
from dynresp.experiments.runner import prepare_run, run_experiment

ROOT = Path(__file__).parents[2]
DOCUMENTS = ("docs/for_animators.md", "docs/experiments.md")
EXAMPLES = [
    (document, text)
    for document in DOCUMENTS
    for text in re.findall(
        r"^```toml\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.M | re.S
    )
]


def test_both_documents_show_one() -> None:
    assert {document for document, _ in EXAMPLES} == {
        "docs/for_animators.md",
        "docs/experiments.md",
    }


@pytest.mark.slow
@pytest.mark.parametrize(("document", "text"), EXAMPLES, ids=[name for name, _ in EXAMPLES])
def test_an_example_runs(document: str, text: str, tmp_path: Path) -> None:
    experiment = parse_experiment(tomllib.loads(text), document)
    few = experiment.output.model_copy(update={"write": ("motion.npz",)})
    empty = tmp_path / "empty"
    empty.mkdir()
    run = prepare_run(experiment.model_copy(update={"output": few}), tmp_path, empty)
    content = run_experiment(run, tmp_path / "out")
    assert content["happened"]["outcome"] in ("reaction", "carry on")


@pytest.mark.parametrize("key", ["settings", "output", "experiment", "library"])
def test_all_keys_are_explained(key: str) -> None:
    from dynresp.experiments.experiment_spec import Experiment

    text = (ROOT / "docs/experiments.md").read_text(encoding="utf-8")
    (section,) = re.findall(rf"^## `\[{key}\]`.*?(?=^##? )", text, re.M | re.S)
    table = Experiment.model_fields[key].annotation
    assert table is not None
    for name in table.model_fields:
        assert f"`{name}`" in section, name
