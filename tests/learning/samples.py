"""Datasets made up by the tests: what is best depends on two numbers behind the features."""

from pathlib import Path
from typing import Any

import numpy as np

from dynresp.datasets.dataset_reader import Dataset
from dynresp.datasets.manifest import FORMAT, identity_of, write_manifest
from dynresp.datasets.manifest_reader import Facts
from dynresp.datasets.shard_schema import PARAMETERS
from dynresp.datasets.shards import encode, shard_ranges
from dynresp.response.prediction.hit_features import FEATURE_NAMES
from dynresp.response.response import CARRY_ON

CHOICES = ("left", "left_mirrored", "ahead", "ahead_mirrored", "roll", "roll_mirrored", CARRY_ON)
STRATEGIES = ("side_fall",) * 2 + ("step_forward_small",) * 2 + ("side_fall",) * 2 + (CARRY_ON,)
MIRRORS = (1, 0, 3, 2, 5, 4, 6)
# Where behind the features each choice is at its best; mirror images lie on the other side.
_CENTRES = np.array(
    [[0.0, 2.0], [0.0, -2.0], [2.0, 1.0], [2.0, -1.0], [-2.0, 1.5], [-2.0, -1.5], [0.0, 0.0]]
)
SETTINGS: dict[str, Any] = {
    "window_s": 1 / 3,
    "blend_s": 0.33,
    # The errors of what is labelled with it reach a little further.
    "carry_on_max_error_m": 1.6,
    "fixed": {"fps": 30.0, "position_weight": [1.0, 2.0]},
}


def facts(count: int, **changed: Any) -> Facts:
    values: dict[str, Any] = {
        "identity": "made up",
        "schema_version": 1,
        "count": count,
        "shard_size": 150,
        "seed": 0,
        "bases": ("walk",),
        "kinds": ("ball", "punch", "push"),
        "bodies": ("pelvis",),
        "outcomes": ("hit", "miss", "diverged"),
        "classes": CHOICES,
        "strategies": STRATEGIES,
        "mirrors": MIRRORS,
        "feature_names": FEATURE_NAMES,
        "library": "tiny",
        "library_identity": "0123456789abcdef",
        "character_identity": "fedcba9876543210",
        "fps": 30.0,
        "settings": SETTINGS,
        "versions": {},
        "spec": {"plan": {"name": "A test"}},
    }
    return Facts(**{**values, **changed})


def dataset(count: int = 400, seed: int = 0, **changed: Any) -> Dataset:
    """Hits, a few misses among them; `changed` are facts."""
    rng = np.random.default_rng(seed)
    behind = rng.normal(scale=1.6, size=(count, 2))
    mixing = np.random.default_rng(1).normal(size=(2, len(FEATURE_NAMES)))
    features = behind @ mixing + 0.1 * rng.normal(size=(count, len(FEATURE_NAMES)))
    apart = np.linalg.norm(behind[:, None] - _CENTRES, axis=2)
    errors = 0.5 + apart
    label = errors.argmin(axis=1)
    graze = apart[:, -1] < 0.3
    missed = rng.random(count) < 0.05
    label[missed], errors[missed], features[missed], graze[missed] = -1, np.nan, np.nan, False
    whole = np.zeros(count, np.int64)
    return Dataset(
        facts=facts(count, **changed),
        index=np.arange(count),
        base=whole.astype(np.int16),
        impact=whole.astype(np.int16),
        kind=whole.astype(np.int8),
        target=whole.astype(np.int8),
        parameters={name: np.zeros(count) for name in PARAMETERS},
        outcome=np.where(missed, 1, 0).astype(np.int8),
        contact_time_s=np.zeros(count),
        contact_frame=whole.astype(np.int32),
        contact_body=whole.astype(np.int8),
        contact_force=np.zeros(count, np.float32),
        contact_point=np.zeros((count, 3), np.float32),
        graze=graze,
        speed_change=np.zeros(count, np.float32),
        label=label.astype(np.int16),
        errors=errors.astype(np.float32),
        exit_frames=np.zeros((count, len(CHOICES)), np.int16),
        entry_frames=np.zeros((count, len(CHOICES)), np.int16),
        features=features.astype(np.float32),
    )


def quiet(stage: str, done: int, of: int) -> None:
    """Progress that nobody watches."""


def write_dataset(folder: Path, data: Dataset) -> Path:
    """The dataset as files, two shards or more; its identity is another than that of the facts."""
    facts = data.facts
    content: dict[str, Any] = {
        "format": FORMAT,
        "schema_version": facts.schema_version,
        "count": facts.count,
        "shard_size": facts.shard_size,
        "plan": {"plan": {"name": facts.spec["plan"]["name"], "seed": facts.seed}},
        "bases": [{"name": name} for name in facts.bases],
        "library": {"name": facts.library, "identity": facts.library_identity},
        "character": {"identity": facts.character_identity, "bodies": list(facts.bodies)},
        "settings": facts.settings,
        "classes": [
            {"name": name, "strategy": strategy, "mirror": facts.classes[mirror]}
            for name, strategy, mirror in zip(
                facts.classes, facts.strategies, facts.mirrors, strict=True
            )
        ],
        "features": list(facts.feature_names),
        "kinds": list(facts.kinds),
        "outcomes": list(facts.outcomes),
        "versions": {},
    }
    content["identity"] = identity_of(content)
    folder.mkdir(parents=True, exist_ok=True)
    write_manifest(content, folder)
    columns = {
        column.name: data.parameters[column.name]
        if column.name in data.parameters
        else getattr(data, column.name)
        for column in facts.layout
    }
    for place in shard_ranges(content["identity"], facts.count, facts.shard_size):
        rows = slice(place.first, place.first + place.rows)
        own = {name: np.ascontiguousarray(array[rows]) for name, array in columns.items()}
        (folder / place.name).write_bytes(encode(own, facts.layout, place))
    return folder
