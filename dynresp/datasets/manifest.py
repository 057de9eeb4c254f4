"""The manifest of a dataset: spec, motions, settings, versions, and the names of its numbers."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import KINDS, DatasetSpec, plain
from dynresp.datasets.shard_schema import PARAMETERS, SCHEMA_VERSION
from dynresp.motion.character import Character
from dynresp.motion.named_motion import NamedMotion
from dynresp.motion.reactions.named_library import library_record
from dynresp.motion.reactions.reaction_library import MIRRORED, ReactionLibrary
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.response_settings import settings_record
from dynresp.results.result_json import versions
from dynresp.support.files import replacing

MANIFEST = "manifest.json"
FORMAT = "dynresp dataset"
# What may differ between two runs that write into the same folder.
_IGNORED = ("count", "identity")
_IGNORED_OF_PLAN = ("count", "name")


def make_manifest(
    spec: DatasetSpec,
    shard_size: int,
    character: Character,
    bases: Sequence[NamedMotion],
    library: ReactionLibrary,
    config: ResponseConfig,
    classes: Sequence[str],
    feature_names: Sequence[str],
    outcomes: Sequence[str],
) -> dict[str, Any]:
    """The content of a manifest, as JSON has it."""
    content = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "count": spec.plan.count,
        "shard_size": shard_size,
        "plan": plain(spec),
        "bases": [
            {"name": base.title, **named.record, **_motion(named)}
            for base, named in zip(spec.base, bases, strict=True)
        ],
        "library": library_record(library, spec.library.which),
        "character": {"identity": character.identity, "bodies": list(character.body_names)},
        "settings": settings_record(config),
        "classes": _classes(classes, library),
        "features": list(feature_names),
        "parameters": list(PARAMETERS),
        "kinds": list(KINDS),
        "outcomes": list(outcomes),
        "versions": {**versions(), "numba": importlib.metadata.version("numba")},
    }
    # As it is when it is read again: lists for tuples, plain dicts for mappings.
    content = json.loads(json.dumps(content, allow_nan=False))
    return {**content, "identity": identity_of(content)}


def _motion(named: NamedMotion) -> dict[str, Any]:
    motion = named.motion
    # Rounded, since the last digits may differ from machine to machine; adding 0.0 removes -0.
    poses = (motion.poses.round(4) + 0.0).astype("<f8")
    return {
        "frames": len(motion),
        "fps": motion.fps,
        "poses_sha256": hashlib.sha256(poses.tobytes()).hexdigest(),
    }


def _classes(classes: Sequence[str], library: ReactionLibrary) -> list[dict[str, str]]:
    found = []
    for name in classes:
        if name == CARRY_ON:
            found.append({"name": name, "strategy": CARRY_ON, "mirror": name})
            continue
        reaction = library.reaction(name)
        other = name.removesuffix(MIRRORED) if reaction.mirrored else name + MIRRORED
        mirror = other if other in classes else name
        found.append({"name": name, "strategy": reaction.strategy, "mirror": mirror})
    return found


def identity_of(content: Mapping[str, Any]) -> str:
    """Hash of everything that the samples depend on."""
    identifying = json.dumps(_identifying(content), sort_keys=True, allow_nan=False)
    return hashlib.sha256(identifying.encode()).hexdigest()[:32]


def _identifying(content: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in content.items() if key not in _IGNORED}
    kept["plan"] = dict(kept["plan"])
    kept["plan"]["plan"] = {
        key: value for key, value in kept["plan"]["plan"].items() if key not in _IGNORED_OF_PLAN
    }
    return kept


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Which entries of two manifests differ, of those that the samples depend on.

    Returns:
        Keys such as "plan.plan.seed" or "library.identity", in the order of the manifest.
    """
    return _differing(_identifying(one), _identifying(other), "")


def _differing(one: Any, other: Any, path: str) -> list[str]:
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [*one, *(key for key in other if key not in one)]
        inner = [
            _differing(one.get(key), other.get(key), f"{path}.{key}" if path else str(key))
            for key in keys
        ]
        return [found for part in inner for found in part]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        inner = [
            _differing(a, b, f"{path} {i + 1}")
            for i, (a, b) in enumerate(zip(one, other, strict=True))
        ]
        return [found for part in inner for found in part]
    return [] if one == other else [path]


def differences_text(found: Sequence[str]) -> str:
    """The first four differences, and how many more there are."""
    return ", ".join(found[:4]) + (f" and {len(found) - 4} more" if len(found) > 4 else "")


def write_manifest(content: Mapping[str, Any], folder: Path) -> None:
    """Write the manifest; an interrupted write leaves the old one.

    Raises:
        DynrespError: It cannot be written.
    """
    with replacing(folder / MANIFEST) as temporary:
        text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
