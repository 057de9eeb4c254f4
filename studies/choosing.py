"""How well a classifier chooses, judged on the held-out samples of a large dataset."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dynresp.support.errors import UsageError
from studies.study import Columns, Options, Study, Target, Value

KEYS = (
    "accuracy",
    "reactions_accuracy",
    "top2_accuracy",
    "within_1_percent",
    "regret",
    "regret_top2",
)
"""Values of `dynresp evaluate` that are kept; `docs/learning.md` explains them."""


def walk_classifier() -> Path | None:
    """The classifier of the dataset `walk`, where it is on this machine."""
    folder = os.environ.get("DYNRESP_DATASETS")
    file = Path(folder).expanduser() / "walk.skops" if folder else None
    return file if file and file.is_file() else None


def measure(options: Options) -> Columns:
    """Judge the classifier `walk.skops` by the dataset `walk`, both in `DYNRESP_DATASETS`.

    Raises:
        UsageError: They are not there.
        DynrespError: They cannot be read, or do not belong together.
    """
    from dynresp.datasets.dataset_reader import load_dataset
    from dynresp.learning.evaluation import evaluate
    from dynresp.response.prediction.classifier_file import load_classifier

    file = walk_classifier()
    if file is None:
        raise UsageError(
            "this study needs the dataset `walk` and the classifier `walk.skops` in the folder "
            "that DYNRESP_DATASETS names; studies/notebooks/README.md says how to make them"
        )
    options.say("judging the classifier")
    found = evaluate(load_classifier(file), load_dataset(file.with_suffix("")), lambda *_: None)
    parts = {
        "in_use": found,
        "alone": found["alone"],
        "reduced": found["reduced"],
        "reduced_alone": found["reduced"]["alone"],
        "nearest_neighbours": found["baselines"]["nearest_neighbours"],
    }
    columns = {name: _kept(part) for name, part in parts.items() if part}
    return columns | {"dataset": {"held_out": found["samples"]}}


def _kept(part: Mapping[str, Any]) -> dict[str, Value]:
    return {key: part[key] for key in KEYS if part[key] is not None}


STUDY = Study(
    "choosing",
    "how often a trained classifier chooses what the full search chooses, on held-out hits",
    "1 min, after an hour for the dataset",
    measure,
    (
        Target("accuracy", "at least 90 %", at_least=0.90, column="in_use"),
        Target("top2_accuracy", "at least 97 %", at_least=0.97, column="in_use"),
        Target("within_1_percent", "at least 95 %", at_least=0.95, column="in_use"),
        Target("regret", "at most 0.3 %", at_most=0.003, column="in_use"),
        Target("regret_top2", "at most 0.06 %", at_most=0.0006, column="in_use"),
        Target("regret", "at most 0.5 %", at_most=0.005, column="reduced"),
    ),
    ("numpy", "numba", "scikit-learn"),
    ("Classifier and dataset are `walk` of studies/notebooks/README.md.",),
)
