"""What the notebooks share: which study they show, where its datasets lie, and the hits behind them.

`DYNRESP_STUDY` is `small`, by default: some hundreds of hits on the built-in motions, made when they
are needed. Or it is `full`: the figures of the `.ipynb` files, from datasets that take an hour to
make. `DYNRESP_DATASETS` names the folder of the datasets; the small study needs none.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np

from dynresp.datasets.dataset_reader import Dataset, load_dataset
from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.dataset_spec_reader import parse_dataset_spec
from dynresp.datasets.sample_draws import Sample, draw_sample
from dynresp.learning.holdout import Split
from dynresp.learning.training import TrainConfig, train
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import Motion
from dynresp.motion.named_motion import load_spec_motion
from dynresp.motion.reactions.named_library import load_named_library
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.response.hit_simulation import HitStage
from dynresp.response.look_ahead import LookAhead, look_ahead_of
from dynresp.response.prediction.classifier import Classifier, TrainedFor
from dynresp.response.prediction.classifier_file import load_classifier, save_classifier
from dynresp.response.response import ResponseConfig
from dynresp.response.response_settings import response_config
from dynresp.support.errors import UsageError
from dynresp.support.paths import example_specs

FULL = os.environ.get("DYNRESP_STUDY", "small") == "full"
"""Whether this is the full study."""

PLANS = {
    "walk": "core_walk_balls.toml",
    "idle": "core_idle_balls.toml",
    "guard": "core_guard_balls.toml",
    "punches": "core_walk_punches.toml",
    "full": "full_walk_balls.toml",
}
"""The datasets, and the example plans that they are made from."""

SPLIT = Split(held_out=0.1 if FULL else 0.3)
"""Which samples are held out."""

INK, GREY = "#23272e", "#9aa3ad"
BLUE, ORANGE, GREEN, RED = "#2f6db3", "#e08214", "#2a9d6f", "#c8402f"

_COUNTS = {"full": 15_000}
_SMALL_PLAN = """
plan = {{ name = "{name}, small", count = 300, seed = 1 }}
library = {{ which = "builtin" }}
base = [{{ motion = "builtin:{base}" }}]
impact = [{{ from_deg = {{ uniform = [0.0, 360.0] }}, {impact} }}]
"""
_IMPACTS = (
    'kind = "ball", mass_kg = { uniform = [3.0, 8.0] }, speed_m_s = { uniform = [4.0, 14.0] }, '
    "height_m = { uniform = [0.1, 1.7] }",
    'kind = "punch", mass_kg = { uniform = [2.0, 5.0] }, speed_m_s = { uniform = [5.0, 11.0] }, '
    'target = { choice = ["head", "chest", "abdomen"] }',
)


def style() -> None:
    """Make figures of one look, of a size that a notebook can hold."""
    mpl.rcParams.update(
        {
            "figure.dpi": 80,
            "savefig.dpi": 80,
            "font.size": 10,
            "axes.titlesize": 11,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.edgecolor": INK,
            "legend.frameon": False,
            "figure.constrained_layout.use": True,
        }
    )


@cache
def folder() -> Path:
    """Where the datasets lie."""
    named = os.environ.get("DYNRESP_DATASETS", "")
    if named:
        return Path(named).expanduser()
    if FULL:
        raise UsageError("the full study needs its datasets; name their folder, DYNRESP_DATASETS")
    return Path(tempfile.mkdtemp(prefix="dynresp-study-"))


@cache
def dataset(name: str) -> Dataset:
    """The hits of a dataset, without the throws that missed.

    Args:
        name: One of `PLANS`.

    Raises:
        UsageError: The full study has not got it; the message says by which command it is made.
    """
    if name == "full" and not FULL:
        # There is one built-in library, and it is the same dataset.
        return dataset("walk")
    where = folder() / name
    if FULL:
        if not where.is_dir():
            plan = example_specs("datasets") / PLANS[name]
            count = f" --count {_COUNTS[name]}" if name in _COUNTS else ""
            raise UsageError(
                f"there is no {where}; make it: dynresp generate {plan} --out {where}{count}"
            )
    elif not where.is_dir():
        _make_small(name, where)
    return load_dataset(where, hits_only=True)


def _make_small(name: str, where: Path) -> None:
    """Make a dataset of some hundred hits like those of the full study, all motions built in."""
    base = name if name in ("idle", "guard") else "walk"
    plan = where.with_suffix(".toml")
    plan.parent.mkdir(parents=True, exist_ok=True)
    plan.write_text(_SMALL_PLAN.format(name=name, base=base, impact=_IMPACTS[name == "punches"]))
    # A program of its own: its workers would run a notebook that is run as a script once more.
    command = [sys.executable, "-m", "dynresp", "generate", str(plan), "--out", str(where)]
    subprocess.run([*command, "--shard-size", "200"], check=True, capture_output=True)


@cache
def classifier() -> Classifier:
    """The classifier that was trained on walking, with all samples that are not held out.

    Raises:
        UsageError: The full study has not got it; the message says by which command it is made.
    """
    file = folder() / "walk.skops"
    if not file.is_file():
        if FULL:
            raise UsageError(
                f"there is no {file}; make it: dynresp train {folder() / 'walk'} --out {file}"
            )
        quick = TrainConfig(
            split=SPLIT, components=(24,), penalties=(10.0,), gamma_factors=(1.0,),
            reduced_components=12,
        )  # fmt: skip
        trained = train(load_dataset(folder() / "walk"), quick, lambda *_: None)
        save_classifier(file, trained.classifier, trained.pipelines)
    return load_classifier(file)


@dataclass(frozen=True)
class Situation:
    """What the hits of a dataset happen to, loaded so that they can be simulated again.

    Attributes:
        plan: The dataset's plan.
        character: The character.
        bases: Base motions.
        library: The reactions.
        config: Settings.
    """

    plan: DatasetSpec
    character: Character
    bases: tuple[Motion, ...]
    library: ReactionLibrary
    config: ResponseConfig
    stage: HitStage = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "stage", HitStage(self.character, self.config, 1))

    def samples(self, indices: Iterable[int]) -> list[Sample]:
        """The hits of the dataset with these indices."""
        durations = [base.duration for base in self.bases]
        return [draw_sample(self.plan, durations, int(index)) for index in indices]

    def look_aheads(self, indices: Iterable[int]) -> list[LookAhead]:
        """Each hit simulated by itself, up to where the choice can be made."""
        seen = []
        for sample in self.samples(indices):
            (batch,) = self.stage.batches([(self.bases[sample.base], sample.impact)])
            traces = batch.simulation.look_ahead(self.config.horizon_s)
            seen.append(
                look_ahead_of(self.character, self.config, batch.bases, batch.prepared, traces)
            )
        return seen


@cache
def situation(name: str) -> Situation:
    """What the hits of a dataset happen to.

    Raises:
        UsageError: The dataset was made with another library than there is on this machine.
    """
    facts = dataset(name).facts
    plan = parse_dataset_spec(dict(facts.spec))
    character, config, beside = (
        default_character(),
        response_config(plan.settings),
        example_specs("experiments"),
    )
    folders, fps = motion_folders(None), config.physics.fps
    bases = tuple(
        load_spec_motion(base, base.otherwise, "base", folders, beside, fps, character).motion
        for base in plan.base
    )
    library = load_named_library(plan.library.which, folders, beside, fps, character)
    found = TrainedFor.of(library, character)
    if (found.library, found.character) != (facts.library_identity, facts.character_identity):
        raise UsageError(
            f"the dataset {name!r} was made with the library {facts.library!r}, and here it is "
            f"{library.name!r}, or another version; name the motions folder with DYNRESP_MOTIONS"
        )
    return Situation(plan, character, bases, library, config)


def held_out(name: str, count: int, seed: int, *, grazes: bool = True) -> np.ndarray:
    """Indices of so many hits that were held out, chosen by a seed.

    Args:
        name: One of `PLANS`.
        count: How many.
        seed: The seed.
        grazes: Whether hits that are carried on through by rule are among them.
    """
    data = dataset(name)
    rows = SPLIT.is_held_out(data.index) & (data.label >= 0)
    if not grazes:
        rows &= ~data.graze
    return np.sort(np.random.default_rng(seed).choice(data.index[rows], count, replace=False))


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table: words to the left, numbers to the right."""
    lines = [[str(cell) for cell in row] for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(headings, *lines, strict=True)]
    for line in (list(headings), ["-" * width for width in widths], *lines):
        cells = [
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())


def percent(share: float, digits: int = 1) -> str:
    """A share in words."""
    return f"{100 * share:.{digits}f} %"


def words(name: str) -> str:
    """The name of a reaction or a strategy as it is read."""
    return name.replace("_mirrored", ", mirrored").replace("_", " ")
