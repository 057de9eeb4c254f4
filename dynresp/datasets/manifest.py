"""The manifest of a dataset: what it is made from, by what, and what its numbers mean."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import KINDS, DatasetPlan, plain
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
# What may differ between two runs into one folder.
_FREE = ("count", "identity")
_FREE_OF_PLAN = ("count", "name")


def make_manifest(
    plan: DatasetPlan,
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
        "count": plan.plan.count,
        "shard_size": shard_size,
        "plan": plain(plan),
        "bases": [
            {"name": base.title, **taken.record, **_motion(taken)}
            for base, taken in zip(plan.base, bases, strict=True)
        ],
        "library": library_record(library, plan.library.which),
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


def _motion(taken: NamedMotion) -> dict[str, Any]:
    motion = taken.motion
    # Rounded, since the last digits may differ from machine to machine; 0.0 takes away -0.
    poses = (motion.poses.round(4) + 0.0).astype("<f8")
    return {
        "frames": len(motion),
        "fps": motion.fps,
        "poses_sha256": hashlib.sha256(poses.tobytes()).hexdigest(),
    }


def _classes(classes: Sequence[str], library: ReactionLibrary) -> list[dict[str, str]]:
    told = []
    for name in classes:
        if name == CARRY_ON:
            told.append({"name": name, "strategy": CARRY_ON, "mirror": name})
            continue
        reaction = library.reaction(name)
        other = name.removesuffix(MIRRORED) if reaction.mirrored else name + MIRRORED
        mirror = other if other in classes else name
        told.append({"name": name, "strategy": reaction.strategy, "mirror": mirror})
    return told


def identity_of(content: Mapping[str, Any]) -> str:
    """Hash of all that decides over the samples."""
    decisive = json.dumps(_decisive(content), sort_keys=True, allow_nan=False)
    return hashlib.sha256(decisive.encode()).hexdigest()[:32]


def _decisive(content: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in content.items() if key not in _FREE}
    kept["plan"] = dict(kept["plan"])
    kept["plan"]["plan"] = {
        key: value for key, value in kept["plan"]["plan"].items() if key not in _FREE_OF_PLAN
    }
    return kept


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Which entries of two manifests differ, of those that decide over the samples.

    Returns:
        Places such as "plan.plan.seed" or "library.identity", in the order of the manifest.
    """
    return _differing(_decisive(one), _decisive(other), "")


def _differing(one: Any, other: Any, place: str) -> list[str]:
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [*one, *(key for key in other if key not in one)]
        inner = [
            _differing(one.get(key), other.get(key), f"{place}.{key}" if place else str(key))
            for key in keys
        ]
        return [found for part in inner for found in part]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        inner = [
            _differing(a, b, f"{place} {i + 1}")
            for i, (a, b) in enumerate(zip(one, other, strict=True))
        ]
        return [found for part in inner for found in part]
    return [] if one == other else [place]


def told(found: Sequence[str]) -> str:
    """Differences in words, the first few of them."""
    return ", ".join(found[:4]) + (f" and {len(found) - 4} more" if len(found) > 4 else "")


def write_manifest(content: Mapping[str, Any], folder: Path) -> None:
    """Write the manifest, whole or not at all.

    Raises:
        DynrespError: It cannot be written.
    """
    with replacing(folder / MANIFEST) as temporary:
        text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
