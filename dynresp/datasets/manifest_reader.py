"""Read and check a manifest: the names behind a dataset's numbers."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import MAX_COUNT, MAX_TABLES
from dynresp.datasets.manifest import FORMAT, MANIFEST, identity_of
from dynresp.datasets.shard_schema import MAX_WIDTH, SCHEMA_VERSION, Column, Columns, columns
from dynresp.datasets.shards import ShardError
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.inputs import open_input

MAX_SHARD_SIZE = 100_000
"""Most samples of one shard."""

HIT = "hit"
"""The outcome of samples with features and a label."""

_MAX_BYTES = 64 << 20
_MAX_TEXT = 10_000


class ManifestError(DynrespError):
    """A manifest that cannot be used; the message names the file and says why."""


@dataclass(frozen=True)
class Facts:
    """What a manifest says, checked.

    Attributes:
        identity: Hash of everything that the samples depend on; shards have it, too.
        schema_version: Of the columns.
        count: How many samples the dataset has when it is complete.
        shard_size: How many samples a shard has; the last may have fewer.
        seed: Seed of the spec.
        bases: Names of the base motions, in the order of the spec.
        kinds: Kinds of impacts; `kind` counts in them.
        bodies: The character's bodies; `target` and `contact_body` count in them.
        outcomes: Possible outcomes of a hit; `outcome` counts in them.
        classes: The reactions of the library, then `carry_on`; `label` counts in them.
        strategies: Of each class; that of `carry_on` is `carry_on`.
        mirrors: For each class the index of its mirror image in `classes`; its own where it has
            none.
        feature_names: Of each feature.
        library: Name of the reaction library.
        library_identity: Its hash.
        character_identity: The character's hash.
        fps: Frames a second, in which frames count [1/s].
        settings: Settings of physics and search.
        versions: Of dynresp and the libraries that computed it.
        spec: The spec, with every default filled in.
    """

    identity: str
    schema_version: int
    count: int
    shard_size: int
    seed: int
    bases: tuple[str, ...]
    kinds: tuple[str, ...]
    bodies: tuple[str, ...]
    outcomes: tuple[str, ...]
    classes: tuple[str, ...]
    strategies: tuple[str, ...]
    mirrors: tuple[int, ...]
    feature_names: tuple[str, ...]
    library: str
    library_identity: str
    character_identity: str
    fps: float
    settings: Mapping[str, Any]
    versions: Mapping[str, str]
    spec: Mapping[str, Any]

    @property
    def origin(self) -> str:
        """Hash of what the samples are drawn from.

        Datasets with the same origin have the same hit at each index. They may differ in names,
        settings, shard size, number of samples and versions.
        """
        spec = self.spec
        bases = [
            {key: value for key, value in base.items() if key != "name"}
            for base in spec.get("base", [])
        ]
        drawn = (self.seed, bases, spec.get("impact", []), self.character_identity)
        return hashlib.sha256(json.dumps(drawn, sort_keys=True).encode()).hexdigest()[:32]

    @property
    def layout(self) -> tuple[Column, ...]:
        """Columns of its shards."""
        return columns(len(self.feature_names), len(self.classes))

    def check(self, found: Columns, source: str) -> None:
        """Refuse a shard with indices out of range.

        Args:
            found: Its contents.
            source: Name of its file.

        Raises:
            ShardError: Names the column.
        """
        names = {
            "base": self.bases,
            "kind": self.kinds,
            "target": self.bodies,
            "outcome": self.outcomes,
            "contact_body": self.bodies,
            "label": self.classes,
        }
        for column, known in names.items():
            least = -1 if column in ("contact_body", "label") else 0
            numbers = found[column]
            if len(numbers) and not (least <= numbers.min() and numbers.max() < len(known)):
                raise ShardError(f"{source}: damaged ({column} has an index out of range)")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read a manifest and check that it is one.

    Raises:
        UsageError: The folder holds no dataset, or one of another schema version.
        ManifestError: It is damaged, or a value is out of bounds.
    """
    path = folder / MANIFEST
    try:
        with open_input(path) as file:
            data = file.read(_MAX_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError):
        raise UsageError(
            f"{folder} holds no dataset (no {MANIFEST}); expected a folder that `dynresp generate` "
            "has written"
        ) from None
    except OSError as error:
        raise ManifestError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > _MAX_BYTES:
        raise ManifestError(f"{path}: damaged (larger than {_MAX_BYTES} bytes)")
    try:
        content = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        raise ManifestError(f"{path}: damaged (not JSON)") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ManifestError(f"{path}: damaged (it does not say that it is a {FORMAT})")
    version = content.get("schema_version")
    if version != SCHEMA_VERSION:
        raise UsageError(
            f"{path}: schema version {version!r}; this dynresp reads {SCHEMA_VERSION}. Generate "
            "the dataset again into another folder, or read it with the dynresp that wrote it."
        )
    parse_facts(content, str(path))
    return content


def parse_facts(content: Mapping[str, Any], source: str = MANIFEST) -> Facts:
    """Check the content of a manifest.

    Raises:
        ManifestError: Something is missing, of a wrong type, or out of bounds.
    """
    try:
        return _ManifestParser(content).facts()
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        why = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise ManifestError(f"{source}: damaged ({why})") from None


class _ManifestParser:
    """Makes `Facts` from the content of a manifest, or raises ValueError."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.content = content

    def facts(self) -> Facts:
        content = self.content
        if content["identity"] != identity_of(content):
            raise ValueError("its identity is not that of its content")
        classes = self._table("classes", MAX_WIDTH)
        names = _texts([item["name"] for item in classes], "classes", MAX_WIDTH)
        outcomes = _texts(content["outcomes"], "outcomes", 100)
        if HIT not in outcomes:
            raise ValueError(f"outcomes: {HIT!r} is missing")
        library, character = content["library"], content["character"]
        return Facts(
            identity=_text(content["identity"], "identity"),
            schema_version=SCHEMA_VERSION,
            count=_whole(content["count"], "count", MAX_COUNT),
            shard_size=_whole(content["shard_size"], "shard_size", MAX_SHARD_SIZE),
            seed=_whole(content["plan"]["plan"]["seed"], "seed", 2**63 - 1, 0),
            bases=_texts([b["name"] for b in self._table("bases", MAX_TABLES)], "bases", 100),
            kinds=_texts(content["kinds"], "kinds", 100),
            bodies=_texts(character["bodies"], "bodies", 100),
            outcomes=outcomes,
            classes=names,
            strategies=tuple(_text(item["strategy"], "strategy") for item in classes),
            mirrors=tuple(names.index(item["mirror"]) for item in classes),
            feature_names=_texts(content["features"], "features", MAX_WIDTH),
            library=_text(library["name"], "library"),
            library_identity=_text(library["identity"], "library"),
            character_identity=_text(character["identity"], "character"),
            fps=_rate(content["settings"]["fixed"]["fps"]),
            settings=content["settings"],
            versions={k: _text(v, "versions") for k, v in content["versions"].items()},
            spec=content["plan"],
        )

    def _table(self, key: str, most: int) -> list[dict[str, Any]]:
        rows = self.content[key]
        if not isinstance(rows, list) or not 0 < len(rows) <= most:
            raise ValueError(f"{key}: expected a list of 1 to {most} entries")
        return rows


def _text(value: Any, key: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _MAX_TEXT:
        raise ValueError(f"{key}: expected a text")
    return value


def _texts(value: Any, key: str, most: int) -> tuple[str, ...]:
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise ValueError(f"{key}: expected a list of 1 to {most} texts")
    found = tuple(_text(item, key) for item in value)
    if len(set(found)) < len(found):
        raise ValueError(f"{key}: a name occurs twice")
    return found


def _whole(value: Any, key: str, most: int, least: int = 1) -> int:
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{key}: expected a whole number from {least} to {most}")
    return value


def _rate(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value) or not 0.0 < value <= 10_000.0:
        raise ValueError("fps: expected a number above 0")
    return float(value)
